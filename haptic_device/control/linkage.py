# SPDX-License-Identifier: Apache-2.0
"""The boundary between joints and handle: haptic_device/config/kinematics compiled, and what goes through J.

    x = p(θ),   x' = J θ',   τ = Jᵀ F                                                                              (1)

Laws above this boundary see the handle, the account and the motors the joints. A third axis goes straight through.
"""

import numpy as np

from haptic_device.config import kinematics
from haptic_device.jit import kernel, njit

NAMES = "kind", "base", "proximal", "distal", "assembly", "travel", "origin_x", "origin_y"
LINKAGE = np.dtype([(name, "f8") for name in NAMES])
"""kind: place in kinematics.KINDS; travel [m/rad] of a sector pulley; all else as of kinematics.Kinematics."""
CARTESIAN = float(kinematics.CARTESIAN)

_pose, _angles = njit(kinematics.pose), njit(kinematics.angles)
_SINGULAR, _CLEAR = kinematics.SINGULAR, kinematics.CLEAR


def fill(link, described):
    """Writes a description's kinematics into a LINKAGE record."""
    link["kind"], link["assembly"] = described.kind, described.assembly
    for name in ("base", "proximal", "distal"):
        link[name] = getattr(described, name) or 0.0
    link["travel"], link["origin_x"], link["origin_y"] = described.travel, *described.origin


@kernel
def pose(link, a, b):
    """(x, y, ∂x/∂a, ∂x/∂b, ∂y/∂a, ∂y/∂b, c) at joint angles [rad]; x, y from the origin of the handle [m]."""
    found = _pose(link, a, b)
    return found[0] - link.origin_x, found[1] - link.origin_y, found[2], found[3], found[4], found[5], found[6]


@kernel
def angles(link, x, y):
    """Joint angles (a, b) [rad] of the handle at this place from its origin [m], and c; c ≤ 0: it cannot be there."""
    return _angles(link, x + link.origin_x, y + link.origin_y)


@kernel
def share_near_singular(c):
    """Share 0…1 of all forces at this distance from a singular pose: none up to SINGULAR, all from CLEAR."""
    return min(1.0, max(0.0, (c - _SINGULAR) / (_CLEAR - _SINGULAR)))


@njit
def to_joints(jacobian, force):
    """Torques of the joints for a force on the handle, in its place: τ = Jᵀ F."""
    x, y = force[0], force[1]
    force[0] = jacobian[0, 0] * x + jacobian[1, 0] * y
    force[1] = jacobian[0, 1] * x + jacobian[1, 1] * y


@njit
def determinant(jacobian, joints):
    """det J of so many joints; of one, its J."""
    return jacobian[0, 0] * jacobian[1, 1] - jacobian[0, 1] * jacobian[1, 0] if joints > 1.0 else jacobian[0, 0]


@njit
def to_handle(jacobian, joints, torque):
    """(x, y) of the force on the handle that torques of so many joints make: F = J⁻ᵀ τ; 0 before a first pose."""
    det = determinant(jacobian, joints)
    if det == 0.0:
        return 0.0, 0.0
    if joints == 1.0:
        return torque[0] / det, 0.0
    x = (jacobian[1, 1] * torque[0] - jacobian[1, 0] * torque[1]) / det
    y = (jacobian[0, 0] * torque[1] - jacobian[0, 1] * torque[0]) / det
    return x, y


@njit
def motion_of(jacobian, turned):
    """(x, y) of the handle's motion that this motion of the joints makes: J θ'."""
    x = jacobian[0, 0] * turned[0] + jacobian[0, 1] * turned[1]
    return x, jacobian[1, 0] * turned[0] + jacobian[1, 1] * turned[1]


@njit
def joint_normal(jacobian, joints, i, normal):
    """Writes the direction (3) in the handle's world along which a row acts on joint i alone: row i of J⁻¹."""
    det = determinant(jacobian, joints)
    normal[0], normal[1], normal[2] = 1.0 / det if det != 0.0 else 0.0, 0.0, 0.0
    if joints > 1.0 and det != 0.0:
        normal[0] = (jacobian[1, 1] if i == 0 else -jacobian[1, 0]) / det
        normal[1] = (-jacobian[0, 1] if i == 0 else jacobian[0, 0]) / det


@kernel
def felt_damping(jacobian, joints, damping):
    """Least damping of the handle in any direction at a pose [N s/m]: 1/λ_max(b⁻¹ Jᵀ J); b: of joints [N m s/rad]."""
    (xa, xb), (ya, yb) = (jacobian[0, 0], jacobian[0, 1]), (jacobian[1, 0], jacobian[1, 1])
    second = damping[1] if joints > 1.0 else 0.0
    return 1.0 / largest(xa * xa + ya * ya, xa * xb + ya * yb, xb * xb + yb * yb, damping[0], second)


@kernel
def largest(xx, xy, yy, a, b):
    """Largest λ with det(M − λ diag(a, b)) = 0, of a symmetric M; b = 0: of one joint."""
    if b <= 0.0:
        return xx / a if a > 0.0 else 0.0
    p, q = xx / a, yy / b
    return 0.5 * (p + q) + np.sqrt(0.25 * (p - q) * (p - q) + xy * xy / (a * b))
