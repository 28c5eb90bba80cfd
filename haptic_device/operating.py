# SPDX-License-Identifier: Apache-2.0
"""Operating point: parameter values on a device, made into the record the servo takes."""

import math

import numpy as np

from haptic_device.device import plant_of, settings_of
from haptic_device.law import (
    encoder,
    exchange,
    operator,
    passivity,
    plant,
)
from haptic_device.parameters import ESTIMATORS, EXCHANGE_METHODS, MOST_WALLS, SOURCES
from haptic_device.runtime.exchange import GAINS

ARM = 0.05  # [m] between grip and tip, which turns accelerations into angular ones
SWITCHED = 2.0
"""Times |B| that a damper may need whose velocity comes from windows of any lengths: |v̂| is at most the largest mean of
the last steps, and the l² norm of that maximum is at most twice that of the steps (Hardy and Littlewood 1930)."""
DIRECT = {  # parameter → field of SETTINGS with the same number
    "cancellation.ratio": "cancellation_ratio",
    "cancellation.band": "cancellation_band",
    "cancellation.stretch": "cancellation_stretch",
    "cancellation.twist": "cancellation_twist",
    "cancellation.filter": "cancellation_filter",
    "velocity.lag": "velocity_lag",
    "velocity.window": "velocity_window",
    "passivity.control": "passivity_control",
    "passivity.budget": "passivity_budget",
    "exchange.hold": "exchange_hold",
    "exchange.fade": "exchange_fade",
    "exchange.budget": "exchange_budget",
    "exchange.tank": "exchange_tank",
    "exchange.horizon": "exchange_horizon",
    "local.compliance": "local_compliance",
    "local.apart": "local_apart",
    "local.hold": "local_hold",
    "local.rejoin": "local_rejoin",
    "engage.time": "engage_time",
    "engage.force": "engage_force",
    "engage.torque": "engage_torque",
    "fault.silence": "silence",
    "fault.saturation": "saturation",
    "fault.duty": "duty",
    "fault.unattended": "unattended",
}


def hand_from(device, values):
    """Loopback's records of these parameter values: PLANT with its hand, PLANT_MEMORY at the start, MOTION.

    motion.* is in the world; the records are in the device's own units. Raises ValueError where the start lies outside
    the workspace.
    """
    body, memory, motion = plant_of(device), np.zeros(1, plant.PLANT_MEMORY), operator.script(values)
    operator.grip_by(body, values)
    scale = np.array([device.scale[0], device.scale[0], device.scale[1]])
    motion["points"] /= scale
    motion["radius"] /= device.scale[0]
    there = np.arange(3) < len(device.axes)
    start = np.where(there, values["motion.start"], 0.0) / scale
    for axis, position in zip(device.axes, start, strict=False):
        low, high = axis.workspace
        unit = "rad" if axis.name == "theta" else "m"
        if not low <= position <= high:
            given = f"motion.start {axis.name} is at {position:g} {unit} of the device"
            raise ValueError(f"{given}; its workspace is {low:g} to {high:g} {unit}")
    memory["position"] = memory["target"] = start
    return body, memory, motion


def settings_from(device, values, version=0):
    """SETTINGS record of this operating point. Raises ValueError, one sentence, where values do not fit together."""
    settings = settings_of(device)
    settings["version"], settings["period"] = version, 1.0 / values["servo.rate"]
    for name, field in DIRECT.items():
        settings[field] = values[name]
    settings["velocity_estimator"] = ESTIMATORS.index(values["velocity.estimator"])
    settings["cancellation_source"] = SOURCES.index(values["cancellation.source"])
    for name, field in (("stiffness", "stiffness"), ("damping", "damping")):
        settings[field][0, :2] = values[f"coupling.{name}"]
        settings[field][0, 2] = values[f"coupling.rotational_{name}"]
    settings["duty_kept"] = math.exp(-1.0 / (values["servo.rate"] * values["fault.duty_time"]))
    settings["force_limit"][0] = (values["force.limit"], values["force.limit"], values["force.limit_rotational"])
    _set_walls(settings, values)
    _set_exchange(settings, values)
    settings["margin"][0], settings["cross"] = margins(settings[0], 0.0)[0], _cross(settings[0])
    return settings


def _set_exchange(settings, values):
    """Settings of the exchange that follow from others."""
    settings["exchange_method"] = EXCHANGE_METHODS.index(values["exchange.method"])
    settings["exchange_play"] = max(2.0 / values["servo.rate"], 1.0 / values["exchange.rate"])
    held = settings["device_limit"] - np.abs(settings["gravity"])
    settings["coupling_limit"] = np.maximum(0.0, np.minimum(settings["force_limit"], held / settings["scale"]))
    ratio = values["force.limit_rotational"] / values["force.limit"] if values["force.limit"] > 0.0 else 1.0
    settings["exchange_slew"][0] = values["exchange.slew"] * np.array([1.0, 1.0, ratio])
    settings["exchange_agility"][0] = values["exchange.agility"] * np.array([1.0, 1.0, 1.0 / ARM])
    settings["surplus"][0] = surplus(settings[0], 0.0)


def surplus(settings, lateness):
    """Damping [N s/m | N m s/rad] of each axis that no gain needs, whatever the direction: by Gershgorin's bound."""
    worst = np.array(settings["physical_damping"], float)
    for need in _needs(settings, lateness):
        left = np.diag(settings["physical_damping"]) - need
        crossed = np.sum(np.abs(left), axis=1) - np.abs(np.diag(left))
        worst = np.minimum(worst, np.diag(left) - crossed)
    return np.maximum(0.0, worst)


def margins(settings, lateness):
    """Physical damping left over: by axis (3), in the worst direction of x and y [N s/m], about theta [N m s/rad].

    diag(b) less, for every wall and the coupling, scale² times what each needs along its direction (law/passivity); the
    lesser of outside and inside of walls, where nothing is cancelled.
    lateness: how late forces act beyond the nominal period [s], delays of the device included.
    """
    left = [np.diag(settings["physical_damping"]) - need for need in _needs(settings, lateness)]
    axes = int(settings["axes"])
    by_axis = np.min([np.diag(each) for each in left], axis=0) * (np.arange(3) < axes)
    plane = min(float(np.linalg.eigvalsh(each[: min(2, axes), : min(2, axes)])[0]) for each in left)
    return by_axis, plane, float(by_axis[2]) if axes == 3 else math.inf


def softer(wished, known, lateness):
    """Whether gains need no more damping than the known ones in any direction, outside of walls and inside."""
    pairs = zip(_needs(wished, lateness), _needs(known, lateness), strict=True)
    return all(np.linalg.eigvalsh(old - new)[0] >= -1e-9 for new, old in pairs)


def _needs(settings, lateness):
    """Damping that all gains together need, as matrices over x, y, theta: outside of walls, and inside."""
    outside, inside = np.zeros((2, 3, 3))
    period, scale, switched = float(settings["period"]), settings["scale"], _switched(settings)
    for i in range(int(settings["axes"])):
        for need, damping in ((outside, _coupling_damping(settings, i)), (inside, abs(settings["damping"][i]))):
            stiffness = settings["stiffness"][i]
            need[i, i] = scale[i] ** 2 * passivity.least_damping(stiffness, damping * switched, period, lateness)
        alone = passivity.least_damping(0.0, _cancelled(settings, i) * switched, period, lateness)  # with no tool
        outside[i, i] = max(outside[i, i], scale[i] ** 2 * alone)
    for j in range(int(settings["walls"])):
        normal = scale * (settings["wall_x"][j], settings["wall_y"][j], 0.0)
        stiffness, damping = settings["wall_stiffness"][j], settings["wall_damping"][j] * switched
        need = passivity.least_damping(stiffness, damping, period, lateness)
        inside += np.outer(normal, normal) * need * _switch_price(settings, normal, lateness)
    return outside, inside


def _switch_price(settings, normal, lateness):
    """How many times its damping a wall needs because cancellation ends at it (docs/passivity.md).

    Nothing is paid where the band is no narrower than the handle's longest way towards the wall in one tick.
    """
    travel = float(np.abs(normal) @ settings["velocity_limit"]) * (float(settings["period"]) + lateness)
    if settings["cancellation_band"] >= travel:
        return 1.0
    return 2.0 / (1.0 + math.sqrt(1.0 - float(settings["cancellation_ratio"]) ** 2))


def _coupling_damping(settings, axis):
    """Damping that counts for the coupling, held while damping cancellation is still on, perhaps."""
    damping = settings["damping"][axis]
    return max(abs(damping), abs(damping - _cancelled(settings, axis)))


def _cancelled(settings, axis):
    """Damping that cancellation takes away, at the world's handle [N s/m | N m s/rad]."""
    return settings["cancellation_ratio"] * settings["physical_damping"][axis] / settings["scale"][axis] ** 2


def _switched(settings):
    """What the estimator of velocity makes of a damper."""
    windows = settings["velocity_estimator"] == encoder.ADAPTIVE_WINDOW and settings["velocity_window"] > 1.0
    return SWITCHED if windows else 1.0


def _cross(settings):
    """λ with which the observer shares the cross term of oblique walls between x and y (law/observer)."""
    left = settings["physical_damping"] - np.diag(_needs(settings, 0.0)[1])
    if int(settings["axes"]) < 2 or left[0] <= 0.0 or left[1] <= 0.0:
        return 1.0
    return float(np.sqrt(left[0] / left[1]))


def refusal(settings, lateness=0.0):
    """The sentence that refuses gains which the device's damping does not cover; "" if it covers them."""
    if min(margins(settings, lateness)[1:]) > 0.0:
        return ""
    return next(filter(None, _blames(settings, lateness)), _together(settings, lateness))


def _blames(settings, lateness):
    """A sentence for each wall and each axis of the coupling that alone needs more than there is."""
    for j in range(int(settings["walls"])):
        normal = settings["scale"] * (settings["wall_x"][j], settings["wall_y"][j], 0.0)
        has = slice(int(settings["axes"]))  # a normal may lean by rounding towards an axis that is not there
        there = 1.0 / np.sum(normal[has] ** 2 / settings["physical_damping"][has])
        gains = settings["wall_stiffness"][j], settings["wall_damping"][j]
        price = _switch_price(settings, normal, lateness)
        yield _blame("wall.stiffness", *gains, there, settings, lateness, price)
    for i in range(int(settings["axes"])):
        there = settings["physical_damping"][i] / settings["scale"][i] ** 2
        yield _blame_cancellation(settings, i, lateness)
        if settings["stiffness"][i] <= 0.0 and settings["damping"][i] <= 0.0:
            continue
        name, counted = "coupling.rotational_" if i == 2 else "coupling.", _coupling_damping(settings, i)
        told = f"{name}damping {settings['damping'][i]:.4g} {'N m s/rad' if i == 2 else 'N s/m'}"
        if counted > abs(settings["damping"][i]):
            told += f" and cancellation.ratio {settings['cancellation_ratio']:g}"
        yield _blame(f"{name}stiffness", settings["stiffness"][i], counted, there, settings, lateness, told=told)


def _blame(name, stiffness, damping, there, settings, lateness, price=1.0, told=""):
    """told: which gains make the damping that counts, where it is not the wall's own."""
    period, counted = float(settings["period"]), damping * _switched(settings)
    need = price * passivity.least_damping(stiffness, counted, period, lateness)
    if need < there:
        return ""
    unit, damping_unit = ("N m/rad", "N m s/rad") if "rotational" in name else ("N/m", "N s/m")
    per_stiffness = passivity.least_damping(1.0, 0.0, period, lateness)
    most = max(0.0, there / price - passivity.least_damping(0.0, counted, period, lateness)) / per_stiffness
    twice = " (twice, for adaptive_window)" if counted > damping else ""
    late = f", {lateness * 1e3:.3g} ms late" if lateness > 0.0 else ""
    late += ", cancellation.band being narrower than a tick's travel" if price > 1.0 else ""
    return (
        f"{name} {stiffness:.6g} {unit} with {told or f'damping {damping:.4g} {damping_unit}'}{twice} "
        f"needs b > {need:.4g} {damping_unit} at T = {period * 1e3:.4g} ms{late}; the device has {there:.4g}: "
        f"at most {math.floor(most):g} {unit}"
    )


def _blame_cancellation(settings, axis, lateness):
    """The sentence where nothing but the damping cancelled in free space needs more than there is."""
    ratio, b = float(settings["cancellation_ratio"]), float(settings["physical_damping"][axis])
    counted = ratio * b * _switched(settings)
    need = passivity.least_damping(0.0, counted, float(settings["period"]), lateness)
    if need < b:
        return ""
    unit = "N m s/rad" if axis == 2 else "N s/m"
    twice = " (twice, for adaptive_window)" if counted > ratio * b else ""
    late = f", {lateness * 1e3:.3g} ms late" if lateness > 0.0 else ""
    return (
        f"cancellation.ratio {ratio:g}{twice} needs b > {need:.4g} {unit}{late}; "
        f"the device has {b:.4g}: at most {math.floor(1e3 * ratio * b / need) / 1e3:g}"
    )


def _together(settings, lateness):
    lacking = abs(margins(settings, lateness)[1])
    return (
        f"walls and coupling together need {lacking:.3g} N s/m more physical damping than the device has in their "
        "worst direction: lower wall.stiffness or coupling.stiffness"
    )


def _set_walls(settings, values):
    offsets, normals = values["wall.offsets"], values["wall.normals"]
    count = len(offsets)
    if count > MOST_WALLS:
        raise ValueError(f"wall.offsets names {count} walls; the limit is {MOST_WALLS}")
    for name, per_wall in (("wall.normals", 2), ("wall.stiffness", 1), ("wall.damping", 1)):
        if len(values[name]) != per_wall * count:
            raise ValueError(f"{name} has {len(values[name])} numbers; {count} walls need {per_wall * count}")
    settings["walls"] = count
    for i in range(count):
        nx, ny = normals[2 * i : 2 * i + 2]
        length = math.hypot(nx, ny)
        if abs(length - 1.0) > 1e-3:
            raise ValueError(f"wall.normals of wall {i} is [{nx:g}, {ny:g}], of length {length:g}; write a unit vector")
        if abs(ny) > 1e-3 and int(settings["axes"][0]) < 2:
            raise ValueError(f"wall.normals of wall {i} is [{nx:g}, {ny:g}]; the device has no y axis, so ny must be 0")
        settings["wall_x"][0, i], settings["wall_y"][0, i] = nx / length, ny / length
        settings["wall_offset"][0, i] = offsets[i]
        settings["wall_stiffness"][0, i], settings["wall_damping"][0, i] = (
            values["wall.stiffness"][i],
            values["wall.damping"][i],
        )


def gains_from(values):
    """GAINS record of the coupling, as the exchange ships them."""
    gains = np.zeros(1, GAINS)
    names = ("stiffness", "damping", "rotational_stiffness", "rotational_damping")
    numbers = [values[f"coupling.{name}"] for name in names]
    for name, number in zip(names, numbers, strict=True):
        gains[name] = number
    gains["hash"] = exchange.gains_hash(*numbers)
    return gains
