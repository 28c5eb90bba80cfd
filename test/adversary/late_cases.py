# SPDX-License-Identifier: Apache-2.0
"""Displays whose forces act late, with gains near the limit that the driver accepts, and who tries them how."""

from typing import NamedTuple

import numpy as np

from adversary.exchange_search import Adversary, search
from haptic_device.config.description import load_device
from haptic_device.config.parameter_types import defaults
from haptic_device.config.parameters import NODES
from haptic_device.control import controller_config, gain_check, passivity

BUDGET = 2e-5  # [J]
OVER = 1.05  # times the damping that is needed


class Case(NamedTuple):
    """name; parameters of each operating point; servo's rate [1/s]; the adversary, whose delay the description has, and
    whose writes the driver has measured but for those beyond."""

    name: str
    points: tuple[dict, ...]
    rate: float
    against: Adversary


def point(stiffness, damping, **parameters):
    """Parameters of an operating point; `__` for a dot."""
    return {"coupling.stiffness": stiffness, "coupling.damping": damping} | {
        name.replace("__", "."): value for name, value in parameters.items()
    }


def wall(stiffness, damping=0.0, offset=0.0):
    """Parameters of one wall that holds the handle at x > offset, with no limit of force: what it stores is plain."""
    numbers = {"normals": (1.0, 0.0), "offsets": (offset,), "stiffness": (stiffness,), "damping": (damping,)}
    return {f"wall__{name}": value for name, value in numbers.items()} | {"force__limit": 1000.0}


SOFT, STIFF, GUARDED = point(1000.0, 0.5), point(2000.0, 2.0), point(1000.0, 0.5, passivity__control=True)
MIXED = point(2000.0, 0.05), point(200.0, 1.0)  # stiff and damped at once are more than the device takes
MIXED_WALLS = point(100.0, 0.0, **wall(2000.0)), point(100.0, 0.0, **wall(100.0, 1.0))
GAINS = (
    point(500.0, 2.0),
    point(1000.0, 0.1),
    point(1000.0, 0.1, force__limit=2.0),
    point(200.0, 0.0, cancellation__ratio=0.5),
)
WALLS = (
    point(500.0, 0.5, force__limit=1000.0),
    point(500.0, 0.5, **wall(500.0)),
    point(200.0, 1.0, **wall(1000.0, 0.2, 0.003)),
)
LATE = 1e-3  # [s], a period at 1 kHz
EVERY = Adversary(0, 0.2, 0.0, 1.0, 1, delay=3e-4, write=1e-4, beyond=1, orders=1)
CASES = (
    Case("on time", (SOFT,), 1000.0, Adversary()),
    Case("1 T late", (SOFT,), 1000.0, Adversary(delay=LATE)),
    Case("25 µs late", (STIFF,), 4000.0, Adversary(delay=25e-6)),
    Case("125 µs late", (STIFF,), 4000.0, Adversary(delay=125e-6)),
    Case("500 µs late", (STIFF,), 4000.0, Adversary(delay=500e-6)),
    Case("jitter", (SOFT,), 1000.0, Adversary(delay=125e-6, write=100e-6)),
    Case("jitter, and later", (SOFT,), 1000.0, Adversary(delay=125e-6, write=100e-6, beyond=1)),
    Case("missed ticks", (SOFT,), 1000.0, Adversary(delay=LATE, rough=1)),
    Case("messages", (SOFT,), 1000.0, Adversary(late=3, loss=0.3, mixed=10, delay=LATE)),
    Case("clutch, enable", (SOFT,), 1000.0, Adversary(delay=LATE, orders=1)),
    Case("live gains", GAINS, 1000.0, Adversary(delay=LATE)),
    Case("live, on time", MIXED, 1000.0, Adversary()),
    Case("live walls, on time", MIXED_WALLS, 1000.0, Adversary()),
    Case("live walls", WALLS, 1000.0, Adversary(delay=LATE)),
    Case("all, limit, gains", GAINS, 1000.0, EVERY),
    Case("controller on", (GUARDED,), 1000.0, Adversary(delay=LATE)),
)


def settings_of(method, case):
    """SETTINGS of each operating point, for a device with OVER times the damping that the points need.

    Raises ValueError where the driver would refuse one.
    """
    against, device = case.against, load_device("desktop")
    lateness = against.delay + against.write
    axis = {"counts_per_unit": 1e9, "velocity_limit": 1e6, "workspace": (-1e6, 1e6), "motor_limit": 1e4}
    axis["damping"] = OVER * max(_needed(one, case.rate, lateness, against.delay) for one in case.points)
    axes = (device.axes[0].model_copy(update=axis),)
    device = device.model_copy(update={"axes": axes, "actuation_delay": against.delay, "sensing_delay": 0.0})
    values = defaults(NODES["haptic_driver"])
    values |= {"exchange.method": method, "servo.rate": case.rate, "passivity.control": False}
    values["exchange.budget"] = BUDGET
    # so that fading and engaging come about within a path
    values |= {"exchange.hold": 0.02, "exchange.fade": 0.01, "engage.time": 0.01, "engage.force": 20.0}
    points = [controller_config.settings_from(device, values | one, version) for version, one in enumerate(case.points)]
    for one in points:
        if refused := gain_check.refusal(gain_check.counted(one, lateness)[0], lateness):
            raise ValueError(refused)
    return np.concatenate(points)


def _needed(values, rate, lateness, least):
    """Damping [N s/m] of the device that these parameters need, all together."""
    stiffness = values["coupling.stiffness"] + sum(values.get("wall.stiffness", ()))
    damping = values["coupling.damping"] + sum(values.get("wall.damping", ()))
    need = 0.0
    for _ in range(100):  # what is cancelled is a share of it
        cancelled = values.get("cancellation.ratio", 0.0) * need
        need = passivity.least_damping(stiffness, damping + cancelled, 1.0 / rate, lateness, least)
    return need


def drawn(method, case, evaluations, seed=0):
    """Most energy [J] beyond the budget that was drawn, or that the books of a full tank were above the truth."""
    given, each = settings_of(method, case), -(-evaluations // 3)
    full, found = case.against._replace(books=1, full=1), []
    for ticks, against in ((30, full), (60, full), (60, case.against._replace(books=1, reach=0.1))):
        found.append(search(given, against, max(ticks, 3 * case.against.late), each, seed))
    return max(max(one.energy - BUDGET, one.overcredit) for one in found)
