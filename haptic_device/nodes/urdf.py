# SPDX-License-Identifier: Apache-2.0
"""A device description as URDF, for whoever draws or plans with robots: its joints, their limits, links to see.

A linkage is a tree from base_link: five bars are two branches, and the first bears the handle. Joints that no motor
drives (elbow_1, elbow_2, pivot, or x of a sector pulley) follow from the others: `states`.
"""

import cmath
from typing import NamedTuple
from xml.etree import ElementTree

from haptic_device.config.description import Device
from haptic_device.control.controller_config import settings_of
from haptic_device.message_fields import frame_id

_AXIS = {"x": "1 0 0", "y": "0 1 0", "theta": "0 0 1"}
_SEEN = {"base_link": ("box", {"size": "0.02 0.02 0.004"}), "handle": ("sphere", {"radius": "0.006"})}


class RobotJoint(NamedTuple):
    """A joint that moves `child` along x or y, or turns it about z (kind), from a place [m] in `parent`.

    limits: lower, upper, velocity, effort; () if it turns freely.
    """

    name: str
    parent: str
    child: str
    kind: str = "theta"
    limits: tuple[float, ...] = ()
    place: tuple[float, float] = (0.0, 0.0)


def tree(device: Device) -> tuple[RobotJoint, ...]:
    """The joints, first those of the drives, in their order. `handle` does not turn with the link that bears it."""
    bars, limits = device.kinematics, [(*at.workspace, at.velocity_limit, at.motor_limit) for at in device.axes]
    if not device.joints:
        names = [axis.name for axis in device.axes]
        links = "base_link", *(f"{name}_link" for name in names[:-1]), "handle"
        return tuple(map(RobotJoint, names, links, links[1:], names, limits))
    fastest, at = settings_of(device)["port"]["fastest"][0].tolist(), tuple(-value for value in bars.origin)
    driven = [(one.name, (*one.limits, fast, one.limit)) for one, fast in zip(device.joints, fastest, strict=False)]
    if bars.type == "sector_pulley":
        below = -(bars.handle_radius + bars.sector_radius + bars.pulley_radius)
        pulley = RobotJoint(driven[0][0], "base_link", "pulley_link", limits=driven[0][1], place=(at[0], below))
        return pulley, RobotJoint("x", "base_link", "handle", "x", limits[0])
    (first, at_first), (second, at_second) = driven
    elbow, elbows = (bars.proximal, 0.0), []
    found = [RobotJoint(first, "base_link", "proximal_1", limits=at_first, place=at)]
    if bars.type == "five_bar":
        other = at[0] + bars.base, at[1]
        found.append(RobotJoint(second, "base_link", "proximal_2", limits=at_second, place=other))
        elbows = [RobotJoint(f"elbow_{k}", f"proximal_{k}", f"distal_{k}", place=elbow) for k in (1, 2)]
    else:
        found.append(RobotJoint(second, "proximal_1", "distal_1", limits=at_second, place=elbow))
    theta = [RobotJoint("theta", "pivot_link", "handle", limits=given) for given in limits[2:]]
    end = theta[0].parent if theta else "handle"
    return (*found, *theta, *elbows, RobotJoint("pivot", "distal_1", end, place=(bars.distal, 0.0)))


def states(device: Device, position: list[float], velocity: list[float]) -> tuple[list[float], list[float]] | None:
    """Positions and velocities of all joints of `tree`; None if the handle cannot be there.

    position: of three drives; velocity: of the handle at the device [m/s, m/s, rad/s].
    """
    bars, count, n = device.kinematics, len(device.joints), len(device.axes)
    if not count:
        return position[:n], velocity[:n]
    x, y, xa, xb, ya, yb, c = bars.pose(*position[:count])
    if c <= 0.0:
        return None
    vx, vy = velocity[:2]
    if count == 1:
        return [position[0], x - bars.origin[0]], [vx / xa, vx]
    det = xa * yb - xb * ya
    rates = (yb * vx - xb * vy) / det, (xa * vy - ya * vx) / det
    elbows, pivots = [], []  # each link a complex number: its angle from the one before, and how fast it turns
    for motor, angle, rate in zip(bars.motors, position, rates, strict=False):
        proximal = cmath.rect(bars.proximal, angle)
        distal = complex(x, y) - motor - proximal
        turning = ((complex(vx, vy) - 1j * rate * proximal) / distal).imag
        elbows.append((cmath.phase(distal / proximal), turning - rate))
        pivots.append((-cmath.phase(distal), -turning))
    places, speeds = zip(*(elbows if bars.type == "five_bar" else ()), pivots[0], strict=True)
    return [*position[:n], *places], [*rates, *velocity[2:n], *speeds]


def urdf(device: Device, namespace: str) -> str:
    """The device as URDF, joints in the device's units [m | rad], frames as `frame_id` has them in a namespace.

    A device has a mass for each axis, or joint, and none for a link: no link has inertia.
    """
    robot, joints = ElementTree.Element("robot", name=device.name), tree(device)
    for link in ("base_link", *(joint.child for joint in joints)):
        _link(robot, frame_id(namespace, link), *_seen(device, link))
    for told in joints:
        kind = "prismatic" if told.kind != "theta" else "revolute" if told.limits else "continuous"
        joint = ElementTree.SubElement(robot, "joint", name=told.name, type=kind)
        if any(told.place):
            ElementTree.SubElement(joint, "origin", xyz=" ".join(map(repr, (*told.place, 0.0))))
        ElementTree.SubElement(joint, "parent", link=frame_id(namespace, told.parent))
        ElementTree.SubElement(joint, "child", link=frame_id(namespace, told.child))
        ElementTree.SubElement(joint, "axis", xyz=_AXIS[told.kind])
        if told.limits:
            limits = zip(("lower", "upper", "velocity", "effort"), told.limits, strict=True)
            ElementTree.SubElement(joint, "limit", {name: repr(value) for name, value in limits})
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def _seen(device, link):
    """Shape, its sizes, and x of its middle [m], of a link that is seen."""
    if link == "pulley_link":
        return "cylinder", {"radius": repr(device.kinematics.pulley_radius), "length": "0.006"}, 0.0
    if length := getattr(device.kinematics, link[:-2], None):  # proximal_1, distal_2
        return "box", {"size": f"{length!r} 0.006 0.003"}, length / 2.0
    return *_SEEN.get(link, ("", {})), 0.0


def _link(robot, name, shape, size, middle):
    link = ElementTree.SubElement(robot, "link", name=name)
    if shape:
        visual = ElementTree.SubElement(link, "visual")
        if middle:
            ElementTree.SubElement(visual, "origin", xyz=f"{middle!r} 0.0 0.0")
        ElementTree.SubElement(ElementTree.SubElement(visual, "geometry"), shape, size)
