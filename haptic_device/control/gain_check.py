# SPDX-License-Identifier: Apache-2.0
"""Whether the device's own damping covers all gains together, and what is left of it."""

import math
from typing import NamedTuple

import numpy as np

from haptic_device.config.kinematics import GRID
from haptic_device.control import account, actuation_delay, damping_compensation, passivity, rows
from haptic_device.control.records import ACCOUNT
from haptic_device.digits import apart, plain

WHOLE = 100.0  # N/m, N m/rad from which on an allowed stiffness is a whole number
JOINTLY = 1e-6  # N/m to which the stiffness that walls and coupling allow together is found
WAYS = 100.0  # most that the stiffness allowed in one direction of a linkage is beyond that of the worst
PRECISE = 1e-4  # of a lateness that is too much, to which the most is found


class Judgement(NamedTuple):
    """Of one set of gains where forces act `lateness` [s] late: what the device's damping has left over, and a refusal.

    margins: of each axis; surplus: of each axis, what no standing spring or damper needs [N s/m, N s/m, N m s/rad];
    plane, theta: the less of x and y [N s/m], and about theta [N m s/rad]; friction: beyond what covers the encoder's
    step [N | N m]; sentence: why these gains are refused, "" where plane and theta are above 0.
    """

    lateness: float
    margins: np.ndarray
    surplus: np.ndarray
    plane: float
    theta: float
    friction: np.ndarray
    sentence: str

    def into(self, settings):
        """The same SETTINGS array of one, with what is left of the damping."""
        return _count(settings, self.lateness, self.margins, self.surplus)


def judge(settings, lateness):
    """The one Judgement of gains where forces act this late [s]; settings: one record of `settings_unjudged`."""
    by_axis, plane, theta = margins(settings, lateness)
    sentence = "" if np.min((plane, theta)) > 0.0 else next(_reasons(settings, lateness))
    return Judgement(lateness, by_axis, surplus(settings, lateness), plane, theta, friction_left(settings), sentence)


def delays(settings):
    """How late forces act [s] where the writes are on time: the device's delays, and the error of its stamps.

    settings: one record. A sample may be that much older than its stamp says.
    """
    return float(settings["hardware"]["delay"] + settings["hardware"]["stamp_error"])


def least_lateness(settings):
    """How late forces act at least [s]: the device's own delays, less the error of its stamps."""
    return max(0.0, float(settings["hardware"]["delay"] - settings["hardware"]["stamp_error"]))


def counted(settings, lateness):
    """As Judgement.into, for gains that nobody is to be told of."""
    return _count(settings, lateness, margins(settings[0], lateness)[0], surplus(settings[0], lateness))


def _count(settings, lateness, by_axis, surplus):
    known = settings["passivity"]
    known["lateness"], known["margin"][0], known["surplus"][0] = lateness, by_axis, surplus
    settings["port"][0] = _port(settings[0], lateness)[0]
    return settings


def _port(settings, lateness):
    """`port` of these settings where forces act up to `lateness` [s] late, as an array of one record."""
    return _judged(settings, lateness)[0]


def _left(settings, lateness):
    """Damping left over outside of walls and inside, (2, 3) [N s/m, N s/m, N m s/rad], at the device."""
    return _judged(settings, lateness)[1]


def _judged(settings, lateness):
    """`port` and what is left of the damping by it, with the weights of K and B that leave most (passivity.weights)."""
    tables, least, period = _tables(settings), min(least_lateness(settings), lateness), float(settings["period"])
    has, damping = slice(int(settings["axes"])), settings["hardware"]["damping"]
    most, found = -np.inf, None
    for ratio in sorted({_ratio(table, period) for table in tables}):
        port = np.array([settings["port"]]).view(np.recarray)
        actuation_delay.set_lateness(port[0], least, lateness, period, ratio)
        left = _by_table(settings, port[0], tables)
        share = float(np.min(left[:, has] / damping[has]))
        if found is None or share > most:
            most, found = share, (port, left)
    return found


def worst_pose(settings, lateness):
    """Place (x[, y]) [m] of a linkage's handle at which these gains leave least damping; () without joints."""
    if not (joints := int(settings["port"]["joints"])):
        return ()
    shares, device = _at_poses(settings, lateness).min(axis=0), settings["hardware"]
    at = np.array(np.unravel_index(shares.argmin(), shares.shape)) / (GRID - 1)
    low, high = device["position_low"][:joints], device["position_high"][:joints]
    return tuple((low + (high - low) * at[:joints]).tolist())


def _at_poses(settings, lateness):
    """Shares of the joints' damping left over outside of walls and inside, all over the workspace, (2, GRID, …)."""
    port, known = _port(settings, lateness), np.zeros(1, ACCOUNT).view(np.recarray)
    known["damping"] = port.damping
    return np.array([_shares(settings, port[0], table, known[0]) for table in _tables(settings)])


def _shares(settings, port, table, known):
    shares = np.empty((GRID, GRID if port.joints > 1.0 else 1))
    account.at_poses(settings, port, table.view(np.recarray), table.size, known, shares)
    return shares


def _ratio(table, period):
    """Of |B| to T K, of all rows of a table that pull in the plane."""
    plane = table[np.any(table["normal"][:, :2] != 0.0, axis=1)]
    stiffness, damping = plane["stiffness"].sum(), np.abs(plane["damping"]).sum()
    return float(damping / (period * stiffness)) if stiffness > 0.0 else 1e9


def _by_table(settings, port, tables):
    known, left = np.zeros(1, ACCOUNT).view(np.recarray), np.zeros((2, 3))
    measured = settings["cancellation"]["source"] == damping_compensation.MEASURED
    for i, table in enumerate(tables):
        # what is measured of the drag pays for itself, b or not
        known["damping"] = port.damping * (1.0 - settings["cancellation"]["ratio"] * (measured and i == 0))
        account.needs(port, table.view(np.recarray), table.size, known[0])
        left[i] = known[0].left * settings["hardware"]["scale"] ** 2
        if joints := int(port.joints):
            left[i, :joints] = _shares(settings, port, table, known[0]).min() * settings["hardware"]["damping"][:joints]
    return left


def _tables(settings):
    """The rows that are in force together: outside of walls, where damping is cancelled, and inside."""
    both, axes, gains = np.zeros((2, rows.MOST), rows.ROW), int(settings["axes"]), settings["coupling"]
    for i in range(axes):
        coupling, cancelled = both[:, rows.COUPLING + i], both[0, rows.CANCELLATION + i]
        coupling["normal"][:, i], coupling["weight"] = 1.0, 1.0
        coupling["stiffness"], coupling["damping"] = gains["stiffness"][i], gains["damping"][i]
        if settings["cancellation"]["source"] == damping_compensation.MODEL:
            cancelled["normal"][i], cancelled["weight"] = 1.0, 1.0
            cancelled["damping"] = -settings["cancellation"]["ratio"] * settings["port"]["damping"][i]
    wall, count = settings["wall"], int(settings["wall"]["count"])
    walls = both[1, rows.WALLS : rows.WALLS + count]
    walls["normal"][:, 0], walls["normal"][:, 1], walls["weight"] = wall["x"][:count], wall["y"][:count], 1.0
    walls["stiffness"], walls["damping"] = wall["stiffness"][:count], wall["damping"][:count]
    return both


def surplus(settings, lateness):
    """Damping [N s/m | N m s/rad] of each axis that no standing spring or damper needs."""
    return np.maximum(0.0, _left(settings, lateness).min(axis=0)) * (np.arange(3) < int(settings["axes"]))


def margins(settings, lateness):
    """Physical damping beyond the need: for each axis, the less of x and y, and about theta.

    The first result is an array (3) [N s/m, N s/m, N m s/rad]; the other two are numbers [N s/m] and [N m s/rad]. The
    gains are passive if these two are above 0.

    From the physical damping the function subtracts the need of all walls and of the coupling (control/account), times
    scale². It does this outside of walls and inside, where no damping is cancelled, and returns the smaller results.

    Args:
        settings: one record of SETTINGS (control/records).
        lateness: how late forces act beyond the nominal period, with the device's delays [s].

    Examples:
        >>> from haptic_device.control.controller_config import settings_from
        >>> from haptic_device.config.description import load_device
        >>> from haptic_device.control.gain_check import margins
        >>> from haptic_device.config.parameter_types import defaults
        >>> from haptic_sim.node.parameters import NODES
        >>> gains = {"coupling.stiffness": 2000.0, "coupling.damping": 2.0, "servo.rate": 4000.0}
        >>> values = defaults(NODES["haptic_driver"]) | gains
        >>> plane = margins(settings_from(load_device("desktop"), values)[0], 0.0)[1]
        >>> round(plane, 9)  # b - KT/2 - B
        0.75
    """
    axes = int(settings["axes"])
    by_axis = _left(settings, lateness).min(axis=0) * (np.arange(3) < axes)
    return by_axis, float(by_axis[: min(2, axes)].min()), float(by_axis[2]) if axes == 3 else math.inf


def friction_left(settings):
    """Coulomb friction [N | N m] of each axis beyond what covers the encoder's step, (3), at the device.

    A spring and a damper that stay give nothing at an edge of the step where 2 f_c ≥ (K + 2|B|/T) Δ (Abbott and Okamura
    2005). Nothing is refused for it: what they can give is some µW.
    """
    period, step = float(settings["period"]), settings["hardware"]["step"] * settings["hardware"]["scale"]
    needs = np.zeros((2, 3))
    for need, table in zip(needs, _tables(settings), strict=True):
        normal = np.abs(table["normal"])
        noise = (0.5 * table["stiffness"] + np.abs(table["damping"]) / period) * (normal @ step)
        need += (normal * noise[:, None]).sum(axis=0)
    return settings["hardware"]["friction"] - settings["hardware"]["scale"] * needs.max(axis=0)


def softer(wished, known, lateness):
    """Whether gains need no more damping than the known ones on any axis and at any pose, outside walls and inside."""
    less = np.all(_left(wished, lateness) - _left(known, lateness) >= -1e-9)
    if less and wished["port"]["joints"]:
        less = np.all(_at_poses(wished, lateness) - _at_poses(known, lateness) >= -1e-9)
    return bool(less)


def refusal(settings, lateness=0.0):
    """Why the driver refuses these gains, in one sentence; "" where the device's damping covers them.

    Args:
        settings: one record of SETTINGS (control/records).
        lateness: how late forces act, as in `margins` [s].

    Examples:
        >>> from haptic_device.control.controller_config import settings_from
        >>> from haptic_device.config.description import load_device
        >>> from haptic_device.control.gain_check import refusal
        >>> from haptic_device.config.parameter_types import defaults
        >>> from haptic_sim.node.parameters import NODES
        >>> values = defaults(NODES["haptic_driver"]) | {"coupling.stiffness": 20000.0, "coupling.damping": 2.0}
        >>> print(refusal(settings_from(load_device("desktop"), values)[0]))
        coupling.stiffness 20000 N/m with coupling.damping 2 N s/m needs b > 4.5 N s/m at T = 0.25 ms;
        the device has 3: allowed under 8000 N/m
    """
    return next(refusals(settings, lateness), "")


def refusals(settings, lateness=0.0, other=None):
    """A sentence for each wall and axis whose gains the device's damping does not cover, or one for all together.

    other: a lateness [s] for which each says the allowed stiffness too.
    """
    if not np.min(margins(settings, lateness)[1:]) > 0.0:  # NaN too
        yield from _reasons(settings, lateness, other)


def _reasons(settings, lateness, other=None):
    """The sentences of refusals, for gains that are not covered."""
    alone = False
    for sentence in filter(None, _blames(settings, lateness, other)):
        alone = True
        yield sentence
    if not alone:
        yield _together(settings, lateness)


def _worst(settings, lateness):
    """Of two joints: at which pose that is, and what helps; "" where all poses are alike."""
    if settings["port"]["joints"] < 2.0:
        return ""
    x, y = worst_pose(settings, lateness)
    told = f"the worst pose has the handle at x = {x:.3g} m, y = {y:.3g} m from its origin"
    return f"; {told}: a use_workspace without it allows more"


def shortfall(settings, judged):
    """Why this Judgement of the settings leaves no damping over: the gains that do not fit, or the lateness where they
    would fit without; "" if some is left.
    """
    lateness, sentence = judged.lateness, judged.sentence
    if not sentence:
        return ""
    if refusal(settings, 0.0):
        both = zip(_blames(settings, lateness), _blames(settings, 0.0), strict=True)
        return next((late for late, in_time in both if in_time), sentence)
    own, most = delays(settings), most_lateness(settings, lateness)
    return (
        f"forces act {lateness * 1e3:.3g} ms late (99 % of the writes within {(lateness - own) * 1e3:.3g} ms, the "
        f"device's delays {own * 1e3:.3g} ms), and these gains leave at most {most * 1e3:.3g} ms: lower them, or "
        "see haptic doctor"
    )


def most_lateness(settings, beyond):
    """The lateness [s] up to which these gains leave damping over, below one that is `beyond`; 0 if they never do."""
    low, high = 0.0, beyond
    while high - low > PRECISE * beyond:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if min(margins(settings, middle)[1:]) > 0.0 else (low, middle)
    return low


def _blames(settings, lateness, other=None):
    """A sentence for each wall and each axis of the coupling that alone needs more than there is."""
    late, walls, coupling, ratio = (lateness, other), settings["wall"], settings["coupling"], settings["cancellation"]
    joints = int(settings["port"]["joints"])
    for j in range(int(walls["count"])):
        which = f" of wall {j}" if walls["count"] > 1 else ""
        told = f"wall.stiffness {walls['stiffness'][j]:.6g} N/m{which} with damping {walls['damping'][j]:.4g} N s/m"
        yield _blame(told, "N/m", settings, "wall", j, late)
    for i in range(int(settings["axes"])):
        yield _blame_cancellation(settings, i, lateness)
        stiffness, damping = coupling["stiffness"][i], coupling["damping"][i]
        if (stiffness <= 0.0 and damping <= 0.0) or 0 < i < joints:  # joints have both of the plane
            continue
        name, unit = ("coupling.rotational_", "N m/rad") if i == 2 else ("coupling.", "N/m")
        told = f"{name}stiffness {stiffness:.6g} {unit} with {name}damping {damping:.4g} {_of_damping(unit)}"
        if _cancelled(settings, i) > 0.0:
            told += f" and cancellation.ratio {ratio['ratio']:g}"
        yield _blame(told, unit, settings, "coupling", slice(joints) if i < joints else i, late)


def _cancelled(settings, axis):
    """Damping that the model's cancellation takes away, at the world's handle [N s/m | N m s/rad]."""
    acts = settings["cancellation"]["source"] == damping_compensation.MODEL
    return settings["cancellation"]["ratio"] * settings["port"]["damping"][axis] if acts else 0.0


def _of_damping(unit):
    """Unit of a damping beside a stiffness in this unit."""
    return unit.replace("/", " s/")


def _alone(settings, part, place, coupled=False):
    """The same settings with one wall, or one axis of the coupling; coupled: and with the whole coupling."""
    alone = settings.copy()
    for other in ("wall", "coupling"):
        keep = np.zeros(len(alone[other]["stiffness"]), bool)
        keep[place if other == part else slice(None)] = other == part or coupled
        alone[other]["stiffness"][~keep] = alone[other]["damping"][~keep] = 0.0
    return alone


def _blame(told, unit, settings, part, place, late):
    """Why one wall, or one axis of the coupling (of a linkage its plane), needs more than is there beside cancellation.

    told: its gains, in words; unit: of the stiffness; late: the lateness, and another for which it is said too what is
    allowed, or None.
    """
    (lateness, other), alone = late, _alone(settings, part, place)
    damping, axes = settings["hardware"]["damping"], int(settings["axes"])
    left = _left(alone, lateness).min(axis=0)[:axes]
    where = np.arange(3)[place].min() if part == "coupling" else int(np.argmin(left[:2] / damping[: min(2, axes)]))
    if left[where] > 0.0:
        return ""
    scale = settings["hardware"]["scale"][where] ** 2

    def most(tried, late):
        """Stiffness below which there is enough, up to the most that any lateness allows."""
        tried = tried.copy()

        def fits(stiffness):
            tried[part]["stiffness"][place] = stiffness
            return _left(tried, late).min(axis=0)[where] > 0.0

        most = 2.0 * damping[where] / (scale * float(settings["period"]))
        # a linkage has more in other directions than in its worst
        return _cut(_largest(fits, WAYS * most if settings["port"]["joints"] else most))

    def allowed(late):
        limit = most(alone, late)
        coupled = part == "wall" and np.any(settings["coupling"]["stiffness"] + settings["coupling"]["damping"] > 0.0)
        beside = most(_alone(settings, part, place, True), late) if coupled else math.inf
        with_coupling = f" ({plain(beside, unit)} with this coupling)" if 0.0 < beside < limit else ""
        return f"under {plain(limit, unit)}{with_coupling}" if limit > 0.0 else "at no stiffness"

    lacking, has = apart((damping[where] - left[where]) / scale, damping[where] / scale)
    late = f", {lateness * 1e3:.3g} ms late" if lateness > 0.0 else ""
    return (
        f"{told} needs b > {lacking} {_of_damping(unit)} at T = {float(settings['period']) * 1e3:.4g} ms{late}; "
        f"the device has {has}: allowed {allowed(lateness)}{_elsewhere(lateness, other, allowed)}"
        f"{_worst(alone, lateness) if where < 2 else ''}"
    )


def _most(settings, part, places, lateness):
    """Stiffness [N/m] to which those of a part are to be cut so that x and y have damping left over; 0: none."""
    tried, given = settings.copy(), settings[part]["stiffness"].copy()

    def fits(middle):
        tried[part]["stiffness"][places] = np.minimum(given, middle)[places]
        return margins(tried, lateness)[1] > 0.0

    return _largest(fits, float(given[places].max(initial=0.0)))


def _cut(limit):
    """A limit of stiffness without the digits that nobody sets."""
    return math.floor(limit) if limit >= WHOLE else math.floor(1e2 * limit) / 1e2


def _largest(fits, high):
    """Stiffness up to `high` below which it fits; 0: none does."""
    low = 0.0
    while high - low > JOINTLY:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fits(middle) else (low, middle)
    return high if low > 0.0 else 0.0


def _elsewhere(lateness, other, allowed):
    """Which stiffness is allowed at another lateness."""
    if other is not None and other > lateness:
        return f", and {allowed(other)} where forces act {other * 1e3:.3g} ms late, as they do here"
    if other is not None and other < lateness:
        return f", and {allowed(other)} on time"
    return ", or more with a shorter delay" if allowed(0.0) != allowed(lateness) else ""


def _blame_cancellation(settings, axis, lateness):
    """The sentence where nothing but the damping cancelled in free space needs more than there is."""
    ratio, b = float(settings["cancellation"]["ratio"]), float(settings["port"]["damping"][axis])
    counted, joint = _cancelled(settings, axis), axis < int(settings["port"]["joints"])
    scale = 1.0 if joint else float(settings["hardware"]["scale"][axis])
    need = passivity.least_damping(0.0, counted, float(settings["period"]), lateness, least_lateness(settings))
    if need < b:
        return ""
    unit = "N m s/rad" if joint or axis == 2 else "N s/m"
    needed, has = apart(need * scale**2, b * scale**2)
    late = f", {lateness * 1e3:.3g} ms late" if lateness > 0.0 else ""
    return (
        f"cancellation.ratio {ratio:g} needs b > {needed} {unit}{late}; "
        f"the device has {has}: at most {math.floor(1e3 * ratio * b / need) / 1e3:g}"
    )


def _together(settings, lateness):
    lacking = abs(margins(settings, lateness)[1])
    parts = {"wall": slice(None), "coupling": slice(2)}
    limits = {part: _cut(_most(settings, part, places, lateness)) for part, places in parts.items()}
    known = [f"{part}.stiffness to under {plain(most, 'N/m')}" for part, most in limits.items() if most > 0.0]
    lower = " or ".join(known) or "wall.stiffness or coupling.stiffness"
    return (
        f"walls and coupling together need {lacking:.3g} N s/m more physical damping than the device has in their "
        f"worst direction: lower {lower}{_worst(settings, lateness)}"
    )
