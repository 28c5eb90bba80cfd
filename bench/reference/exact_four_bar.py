# SPDX-License-Identifier: Apache-2.0
"""A four-bar linkage in its one coordinate, the crank's angle a; coupler b and rocker c follow by closure.

Rates over the crank's: b' = A sin(a - c)/(B sin(c - b)), c' = A sin(a - b)/(C sin(c - b)) (lengths A, B, C).
Lagrange's equation  M a'' + M'/2 a'^2 + V' = Q  with M the sum of m |dp/da|^2 + I (dangle/da)^2 of all bars and of the
tool, a point mass on the crank's end that turns by itself. Integrated by Dormand & Prince's formula of order 8 to
1e-13, independent of the methods that it is compared with.
"""

import math

import numpy as np
from scipy.integrate import solve_ivp

from bench.reference.exact_axis import turning
from haptic_sim.lockstep.error_metrics import Case

TOLERANCE = 1e-13


def angles(lengths, crank: float) -> tuple[float, float]:
    """Angles of coupler and rocker [rad] of a linkage (ground, crank, coupler, rocker) [m], open branch."""
    d, a, b, c = lengths
    x, y = d - a * math.cos(crank), -a * math.sin(crank)
    f = math.hypot(x, y)
    coupler = math.atan2(y, x) + math.acos((b * b + f * f - c * c) / (2.0 * b * f))
    end_x, end_y = a * math.cos(crank) + b * math.cos(coupler) - d, a * math.sin(crank) + b * math.sin(coupler)
    return coupler, math.atan2(end_y, end_x)


def four_bar(case: Case) -> dict[str, np.ndarray]:
    """Body → poses at the looks."""
    linkage = _Linkage(case)
    places, rates = np.hsplit(case.path(), 2)
    crank = _integrate(linkage, case, places, rates)
    poses = [linkage.poses(angle) for angle in crank]
    return {name: np.array([pose[name] for pose in poses]) for name in poses[0] if name != "tool"} | {
        "tool": np.array([(*pose["tool"], angle) for pose, angle in zip(poses, turning(case), strict=True)])
    }


def _integrate(linkage, case, places, rates):
    """Crank's angle at the looks."""
    period, state, found = case.period * 1e-9, np.array([linkage.start, 0.0]), [linkage.start]
    step = None
    for k in range(len(places) - 1):
        moved, changed = (places[k + 1] - places[k])[:2] / period, (rates[k + 1] - rates[k])[:2] / period
        hand = places[k, :2], rates[k, :2], moved, changed
        piece = solve_ivp(
            linkage.rate, (0.0, period), state, "DOP853", rtol=TOLERANCE, atol=1e-15, args=(hand,), first_step=step
        )
        step = min(piece.t[1] - piece.t[0] if len(piece.t) > 1 else period, period)
        state = piece.y[:, -1]
        if (k + 1) % (case.look // case.period) == 0:
            found.append(state[0])
    return found


class _Linkage:
    """Bars as the scene has them: frames in their first pins, x along the bar."""

    def __init__(self, case):
        scene = case.scene
        bars = {body.name: body for body in scene.bodies}
        self.left, self.right = bars["crank"].pose[:2], bars["rocker"].pose[:2]
        ends = {joint.name: joint.anchors for joint in scene.joints}
        crank, (coupler, rocker) = ends["coupler_pin"][0][0], (pin[0] for pin in ends["rocker_pin"])
        self.lengths = self.right[0] - self.left[0], crank, coupler, rocker
        self.start, self.gravity, self.gains = bars["crank"].pose[2], scene.gravity, case.gains
        self.tool_mass = scene.tool.mass
        self.masses = [bars[name].mass_properties for name in ("crank", "coupler", "rocker")]

    def poses(self, a):
        """Body → pose of its frame; of the tool the place alone."""
        b, c = angles(self.lengths, a)
        end = self._end(a)
        return {"crank": (*self.left, a), "coupler": (*end, b), "rocker": (*self.right, c), "tool": end}

    def rate(self, t, state, hand):
        """(a, a')' with the hand at hand[0] + t hand[2], at hand[1] + t hand[3]."""
        a, w = state
        mass, slope, load = self._inertia(a)
        (x, y), length = self._end(a), self.lengths[1]
        along = -length * math.sin(a), length * math.cos(a)
        pull = [
            self.gains[0] * (hand[0][k] + t * hand[2][k] - (x, y)[k])
            + self.gains[1] * (hand[1][k] + t * hand[3][k] - along[k] * w)
            for k in range(2)
        ]
        return w, (load + pull[0] * along[0] + pull[1] * along[1] - 0.5 * slope * w * w) / mass

    def _end(self, a):
        return self.left[0] + self.lengths[1] * math.cos(a), self.left[1] + self.lengths[1] * math.sin(a)

    def _inertia(self, a):
        """M, dM/da and gravity's generalized force."""
        _, la, lb, lc = self.lengths
        b, c = angles(self.lengths, a)
        sine, cosine = math.sin(c - b), math.cos(c - b)
        db, dc = la * math.sin(a - c) / (lb * sine), la * math.sin(a - b) / (lc * sine)
        turn = cosine * (dc - db) / sine
        ddb = la * math.cos(a - c) * (1.0 - dc) / (lb * sine) - db * turn
        ddc = la * math.cos(a - b) * (1.0 - db) / (lc * sine) - dc * turn
        ends = np.array([-la * math.sin(a), la * math.cos(a)]), np.array([-la * math.cos(a), -la * math.sin(a)])
        nothing = np.zeros(2), np.zeros(2)
        mass, slope, load = self.tool_mass * la * la, 0.0, self.tool_mass * float(np.dot(self.gravity, ends[0]))
        for properties, angle, d, dd, (first, second) in zip(
            self.masses, (a, b, c), (1.0, db, dc), (0.0, ddb, ddc), (nothing, ends, nothing), strict=True
        ):
            arm = properties.center[0]
            across, back = np.array([-math.sin(angle), math.cos(angle)]), np.array([math.cos(angle), math.sin(angle)])
            speed = first + arm * d * across
            curve = second + arm * (dd * across - d * d * back)
            mass += properties.mass * float(speed @ speed) + properties.inertia * d * d
            slope += 2.0 * (properties.mass * float(speed @ curve) + properties.inertia * d * dd)
            load += properties.mass * float(np.dot(self.gravity, speed))
        return mass, slope, load
