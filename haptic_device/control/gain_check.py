# SPDX-License-Identifier: Apache-2.0
"""Whether the device's own damping covers all gains together, and what is left of it."""

import functools
import math
from typing import NamedTuple

import numpy as np

from haptic_device.control import passivity, velocity_estimator
from haptic_device.digits import apart, plain

WHOLE = 100.0  # N/m, N m/rad from which on an allowed stiffness is a whole number
JOINTLY = 1e-6  # N/m to which the stiffness that walls and coupling allow together is found
PRECISE = 1e-4  # of a lateness that is too much, to which the most is found


class Judgement(NamedTuple):
    """Of one set of gains where forces act `lateness` [s] late: what the device's damping has left over, and a refusal.

    margins: of each axis; surplus: of each axis, what no standing spring or damper needs [N s/m, N s/m, N m s/rad];
    plane, theta: in the worst direction of x and y [N s/m], and about theta [N m s/rad]; sentence: why these gains are
    refused, "" where plane and theta are above 0.
    """

    lateness: float
    margins: np.ndarray
    surplus: np.ndarray
    plane: float
    theta: float
    sentence: str

    def into(self, settings):
        """The same SETTINGS array of one, with what is left of the damping."""
        return _count(settings, self.lateness, self.margins, self.surplus)


def judge(settings, lateness):
    """The one Judgement of gains where forces act this late [s]; settings: one record of `settings_unjudged`."""
    by_axis, plane, theta = margins(settings, lateness)
    sentence = "" if np.min((plane, theta)) > 0.0 else next(_reasons(settings, lateness))
    return Judgement(lateness, by_axis, surplus(settings, lateness), plane, theta, sentence)


def delays(settings):
    """How late forces act [s] where the writes are on time: the device's delays, and the error of its stamps.

    settings: one record. A sample may be that much older than its stamp says.
    """
    return float(settings["hardware"]["delay"] + settings["hardware"]["stamp_error"])


def counted(settings, lateness):
    """As Judgement.into, for gains that nobody is to be told of."""
    return _count(settings, lateness, margins(settings[0], lateness)[0], surplus(settings[0], lateness))


def _count(settings, lateness, by_axis, surplus):
    known = settings["passivity"]
    known["lateness"], known["margin"][0], known["surplus"][0] = lateness, by_axis, surplus
    return settings


def surplus(settings, lateness):
    """Damping [N s/m | N m s/rad] of each axis that no standing spring or damper needs, by Gershgorin's bound."""
    worst = np.array(settings["hardware"]["damping"], float)
    # what a coupling needs beyond a wall is for what late forces give: the tank sets that aside (control/energy_tank)
    for need in _needs(settings, lateness, passivity.least_damping):
        left = np.diag(settings["hardware"]["damping"]) - need
        crossed = np.sum(np.abs(left), axis=1) - np.abs(np.diag(left))
        worst = np.minimum(worst, np.diag(left) - crossed)
    return np.maximum(0.0, worst)


def margins(settings, lateness):
    """Physical damping beyond the need: for each axis, in the worst direction of x and y, and about theta.

    The first result is an array (3) [N s/m, N s/m, N m s/rad]; the other two are numbers [N s/m] and [N m s/rad]. The
    gains are passive if these two are above 0.

    From the physical damping diag(b) the function subtracts the need of each wall and of the coupling along their
    directions, times scale² (control/passivity). It does this outside of walls and inside, where no damping is
    cancelled, and returns the smaller results.

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
    left = [np.diag(settings["hardware"]["damping"]) - need for need in _needs(settings, lateness)]
    axes = int(settings["axes"])
    by_axis = np.min([np.diag(each) for each in left], axis=0) * (np.arange(3) < axes)
    plane = min(float(np.linalg.eigvalsh(each[: min(2, axes), : min(2, axes)])[0]) for each in left)
    return by_axis, plane, float(by_axis[2]) if axes == 3 else math.inf


def softer(wished, known, lateness):
    """Whether gains need no more damping than the known ones in any direction, outside of walls and inside."""
    pairs = zip(_needs(wished, lateness), _needs(known, lateness), strict=True)
    return all(np.linalg.eigvalsh(old - new)[0] >= -1e-9 for new, old in pairs)


def _needs(settings, lateness, coupling=passivity.coupling_damping):
    """Damping that all gains together need, as matrices over x, y, theta: outside of walls, and inside.

    coupling: what a coupling needs; passivity.least_damping for one whose set position stands still.
    """
    outside, inside = np.zeros((2, 3, 3))
    period, scale, switched = float(settings["period"]), settings["hardware"]["scale"], _switched(settings)
    for i in range(int(settings["axes"])):
        for need, damping in (
            (outside, _coupling_damping(settings, i)),
            (inside, abs(settings["coupling"]["damping"][i])),
        ):
            stiffness = settings["coupling"]["stiffness"][i]
            need[i, i] = scale[i] ** 2 * coupling(stiffness, damping * switched, period, lateness)
        alone = passivity.least_damping(0.0, _cancelled(settings, i) * switched, period, lateness)  # with no tool
        outside[i, i] = max(outside[i, i], scale[i] ** 2 * alone)
    for j in range(int(settings["wall"]["count"])):
        normal = scale * (settings["wall"]["x"][j], settings["wall"]["y"][j], 0.0)
        stiffness, damping = settings["wall"]["stiffness"][j], settings["wall"]["damping"][j] * switched
        need = passivity.least_damping(stiffness, damping, period, lateness)
        inside += np.outer(normal, normal) * need * _switch_price(settings, normal, lateness)
    return outside, inside


def _switch_price(settings, normal, lateness):
    """How many times its damping a wall needs because cancellation ends at it (docs/theory/passivity.md).

    Nothing is paid where the band is no narrower than the handle's longest way towards the wall in one tick.
    """
    travel = float(np.abs(normal) @ settings["hardware"]["velocity_limit"]) * (float(settings["period"]) + lateness)
    if settings["cancellation"]["band"] >= travel:
        return 1.0
    return 2.0 / (1.0 + math.sqrt(1.0 - float(settings["cancellation"]["ratio"]) ** 2))


def _coupling_damping(settings, axis):
    """Damping that counts for the coupling, held while damping cancellation is still on, perhaps."""
    damping = settings["coupling"]["damping"][axis]
    return max(abs(damping), abs(damping - _cancelled(settings, axis)))


def _cancelled(settings, axis):
    """Damping that cancellation takes away, at the world's handle [N s/m | N m s/rad]."""
    return (
        settings["cancellation"]["ratio"]
        * settings["hardware"]["damping"][axis]
        / settings["hardware"]["scale"][axis] ** 2
    )


def _switched(settings):
    """What the estimator of velocity makes of a damper."""
    windows = (
        settings["velocity"]["estimator"] == velocity_estimator.ADAPTIVE_WINDOW and settings["velocity"]["window"] > 1.0
    )
    return velocity_estimator.SWITCHED if windows else 1.0


def cross(settings):
    """λ with which the observer shares the cross term of oblique walls between x and y (control/passivity_observer)."""
    left = settings["hardware"]["damping"] - np.diag(_needs(settings, 0.0)[1])
    if int(settings["axes"]) < 2 or left[0] <= 0.0 or left[1] <= 0.0:
        return 1.0
    return float(np.sqrt(left[0] / left[1]))


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
    late, walls, coupling, hardware = (lateness, other), settings["wall"], settings["coupling"], settings["hardware"]
    for j in range(int(walls["count"])):
        normal = hardware["scale"] * (walls["x"][j], walls["y"][j], 0.0)
        has = slice(int(settings["axes"]))  # a normal may lean by rounding towards an axis that is not there
        there = 1.0 / np.sum(normal[has] ** 2 / hardware["damping"][has])
        gains, which = (walls["stiffness"][j], walls["damping"][j]), f" of wall {j}" if walls["count"] > 1 else ""
        told = f"wall.stiffness {gains[0]:.6g} N/m{which} with damping {gains[1]:.4g} N s/m"
        price = functools.partial(_switch_price, settings, normal)
        coupled = functools.partial(_most_of_walls, settings, j)
        yield _blame(told, "N/m", passivity.least_damping, *gains, there, settings, late, price, coupled)
    for i in range(int(settings["axes"])):
        there = hardware["damping"][i] / hardware["scale"][i] ** 2
        yield _blame_cancellation(settings, i, lateness)
        stiffness, damping, counted = coupling["stiffness"][i], coupling["damping"][i], _coupling_damping(settings, i)
        if stiffness <= 0.0 and damping <= 0.0:
            continue
        name, unit = ("coupling.rotational_", "N m/rad") if i == 2 else ("coupling.", "N/m")
        told = f"{name}stiffness {stiffness:.6g} {unit} with {name}damping {damping:.4g} {_of_damping(unit)}"
        if counted > abs(damping):
            told += f" and cancellation.ratio {settings['cancellation']['ratio']:g}"
        yield _blame(told, unit, passivity.coupling_damping, stiffness, counted, there, settings, late)


def _of_damping(unit):
    """Unit of a damping beside a stiffness in this unit."""
    return unit.replace("/", " s/")


def _most_of_walls(settings, wall, lateness):
    """Stiffness [N/m] below which this wall, without the others, is covered together with the coupling; 0: none."""
    kept = np.zeros(len(settings["wall"]["stiffness"]))
    kept[wall] = settings["wall"]["stiffness"][wall]
    alone = settings.copy()
    alone["wall"]["stiffness"], alone["wall"]["damping"][kept == 0.0] = kept, 0.0
    return _most(alone, "wall", slice(None), lateness)


def _most(settings, part, places, lateness):
    """Stiffness [N/m] to which those of a part are to be cut so that x and y have damping left over; 0: none."""
    tried, given = settings.copy(), settings[part]["stiffness"].copy()
    low, high = 0.0, float(given[places].max(initial=0.0))
    while high - low > JOINTLY:
        middle = 0.5 * (low + high)
        tried[part]["stiffness"][places] = np.minimum(given, middle)[places]
        low, high = (middle, high) if margins(tried, lateness)[1] > 0.0 else (low, middle)
    return high if low > 0.0 else 0.0


def _cut(limit):
    """A limit of stiffness without the digits that nobody sets."""
    return math.floor(limit) if limit >= WHOLE else math.floor(1e2 * limit) / 1e2


def _blame(told, unit, needed, stiffness, damping, there, settings, late, priced=lambda lateness: 1.0, coupled=None):
    """told: the gains, in words; unit: of the stiffness; needed: of a wall or a coupling; damping: what counts; late:
    the lateness, and another for which it is said too what is allowed, or None; coupled: the stiffness that is allowed
    together with the coupling, at a lateness.
    """
    (lateness, other), period, counted = late, float(settings["period"]), damping * _switched(settings)
    price = priced(lateness)
    need = price * needed(stiffness, counted, period, lateness)
    if need < there:
        return ""

    def allowed(late):
        left = max(0.0, there / priced(late) - needed(0.0, counted, period, late))
        limit = left / needed(1.0, 0.0, period, late)
        limit, beside = _cut(limit), _cut(coupled(late)) if coupled else math.inf
        with_coupling = f" ({plain(beside, unit)} with this coupling)" if 0.0 < beside < limit else ""
        return f"under {plain(limit, unit)}{with_coupling}" if limit > 0.0 else "at no stiffness"

    twice = " (twice, for adaptive_window)" if counted > damping else ""
    lacking, has = apart(need, there)
    late = f", {lateness * 1e3:.3g} ms late" if lateness > 0.0 else ""
    late += ", cancellation.band being narrower than a tick's travel" if price > 1.0 else ""
    return (
        f"{told}{twice} needs b > {lacking} {_of_damping(unit)} at T = {period * 1e3:.4g} ms{late}; "
        f"the device has {has}: allowed {allowed(lateness)}{_elsewhere(lateness, other, allowed)}"
    )


def _elsewhere(lateness, other, allowed):
    """Which stiffness is allowed at another lateness."""
    if other is not None and other > lateness:
        return f", and {allowed(other)} where forces act {other * 1e3:.3g} ms late, as they do here"
    if other is not None and other < lateness:
        return f", and {allowed(other)} on time"
    return ", or more with a shorter delay" if allowed(0.0) != allowed(lateness) else ""


def _blame_cancellation(settings, axis, lateness):
    """The sentence where nothing but the damping cancelled in free space needs more than there is."""
    ratio, b = float(settings["cancellation"]["ratio"]), float(settings["hardware"]["damping"][axis])
    counted = ratio * b * _switched(settings)
    need = passivity.least_damping(0.0, counted, float(settings["period"]), lateness)
    if need < b:
        return ""
    unit = "N m s/rad" if axis == 2 else "N s/m"
    twice = " (twice, for adaptive_window)" if counted > ratio * b else ""
    needed, has = apart(need, b)
    late = f", {lateness * 1e3:.3g} ms late" if lateness > 0.0 else ""
    return (
        f"cancellation.ratio {ratio:g}{twice} needs b > {needed} {unit}{late}; "
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
        f"worst direction: lower {lower}"
    )
