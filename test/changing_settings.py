# SPDX-License-Identifier: Apache-2.0
"""A hand in lock-step while settings change as live parameters do, and what is judged of it tick by tick."""

import numpy as np
from lockstep_systems import device, values

from haptic_device.control import controller_config, gain_check
from haptic_device.control.records import TRACE_ROW
from haptic_device.control.virtual_coupling import spring_store
from haptic_sim.lockstep.lockstep import Lockstep

RATE, FORCE = 1000.0, 3.0  # [Hz], [N] of the hand on the wall
WIDE = {"workspace": (-10.0, 10.0), "motor_limit": 15.0}
WALL = {"wall__normals": (1.0, 0.0), "wall__offsets": (0.0,), "wall__stiffness": (500.0,), "wall__damping": (0.0,)}
NO_WALL = dict.fromkeys(WALL, ())
NO_COUPLING = {"coupling__stiffness": 0.0, "coupling__damping": 0.0}
USED = {"force": ("limit",), "coupling": ("stiffness", "damping", "limit"), "cancellation": ("ratio",)}


class Changing(Lockstep):
    """`wish` changes settings from the next tick on, `go` runs tick by tick and keeps what is judged.

    hand: of the loopback; pull: place [m] of a tool that stands on the x axis; late: of the motor's write [s], delay:
    of the actuation [s].
    """

    def __init__(self, hand, pull=None, late=0.0, delay=0.0, damping=3.0, axes=1, **driver):
        self.wished = values("haptic_driver", **{"servo__rate": RATE, "engage__time": 0.05} | driver)
        body = device(damping, axes=axes, actuation_delay=delay)
        body = body.model_copy(update={"axes": tuple(axis.model_copy(update=WIDE) for axis in body.axes)})
        super().__init__(body, self.wished, values("haptic_loopback", **hand), None, write_delay=late)
        self.rows, self._pull, self._before = [], pull, None
        self.given, self.held, self.beyond = [], [], [np.zeros(axes)]

    def settings_by(self, **changes):
        """Settings that differ by these parameters from what is wished for, as a driver counts them."""
        wished = self.wished | {name.replace("__", "."): value for name, value in changes.items()}
        settings = controller_config.settings_from(self.device, wished, int(self.settings["version"][0]) + 1)
        return gain_check.counted(settings, float(settings["hardware"]["delay"][0]) + self.write_delay * 1e-9)

    def wish(self, **changes):
        """New values of parameters, from the next tick on."""
        self.settings = self.settings_by(**changes)
        self.wished |= {name.replace("__", "."): value for name, value in changes.items()}

    def go(self, seconds):
        """Runs for so long; the tool that stands somewhere says so at each tick."""
        for _ in range(round(seconds * RATE)):
            if self._pull is not None:
                self.tool["session"], self.tool["position"][0, 0] = 1.0, self._pull
                self.tool["sequence"] += 1.0
                self.tool["answered"], self.tool["sent"] = self.tool["sequence"], self.ticks * self.period
            rows, now = self.run(1.0 / RATE), self.memory["in_force"][0].copy()
            row = rows.view(TRACE_ROW)[0]  # whose fields are found faster than those of a record
            if self._before is not None:
                self.beyond.append(_beyond(*self._before, row, now))
            self._before = row, now
            self.rows.append(rows[0])
            self.given.append(float(self.plant_memory["energy_given"][0]))
            self.held.append(self._held(row))
        return self

    def _held(self, row):
        """What springs, tank and the device's masses hold [J]."""
        wall, spring = self.memory[0]["in_force"]["wall"], self.memory[0]["spring"]
        energy = max(0.0, float(self.memory["tank"]["level"][0]))  # a row has it as it was before the tick's end
        for j in range(int(wall["count"])):
            depth = max(0.0, wall["offset"][j] - wall["x"][j] * row["position"][0] - wall["y"][j] * row["position"][1])
            energy += 0.5 * row["engage"] * wall["stiffness"][j] * depth**2
        for i, axis in enumerate(self.device.axes):
            stretch = row["coupling_position"][i] - row["position"][i]
            energy += spring_store(spring["stiffness"][i], spring["limit"][i], stretch)
            energy += 0.5 * axis.mass * self.plant_memory["velocity"][0, i] ** 2
        return energy

    @property
    def forged(self):
        """Most [J] that the hand got by the plant's truth, from any tick on, beyond what was held then."""
        given = np.array(self.given)
        return float(np.max(given - np.minimum.accumulate(given + self.held)))

    @property
    def budget(self):
        """Energy [J] that may be given before any has been paid."""
        return float(self.settings["exchange"]["budget"][0] + self.settings["passivity"]["budget"][0])

    @property
    def slew(self):
        """What a tick may change the force by beyond the handle's own motion [N]."""
        return float(self.settings["exchange"]["slew"][0, 0]) / RATE + 1e-9

    @property
    def there(self):
        """Whether all that is wished for is in force; unused places of walls and axes say nothing."""
        wished, now = self.settings[0], self.memory["in_force"][0]
        used = {"wall": ("x", "y", "offset", "stiffness", "damping")} | USED
        counts = {"wall": int(wished["wall"]["count"])}
        same = wished["wall"]["count"] == now["wall"]["count"]
        for group, names in used.items():
            width = counts.get(group, len(self.device.axes))
            same &= all(
                np.array_equal(np.atleast_1d(wished[group][n])[:width], np.atleast_1d(now[group][n])[:width])
                for n in names
            )
        return bool(same)


def pressing(depth=FORCE / 500.0, hand=500.0, seconds=2.0, **given):
    """A hand [N/m] that presses slowly with FORCE on a wall of 500 N/m at x = 0, and holds from 0.3 to 0.7 of the time.

    Then it goes back to x = 10 mm. depth: of the handle when it holds; given: as of Changing.
    """
    motion = {"motion__name": "press_wall", "motion__start": (0.01, 0.0, 0.0), "motion__duration": seconds}
    motion |= {"motion__target": (-depth - FORCE / hand, 0.0, 0.0), "hand__stiffness": hand}
    return Changing(motion, **NO_COUPLING | WALL | given).go(0.06 + 0.3 * seconds + 0.3)


def stretching(hand=500.0, stretch=0.006, **given):
    """The same hand on a coupling of 500 N/m to a tool that stands at x = 0."""
    motion = {"motion__name": "press_wall", "motion__duration": 2.0, "hand__stiffness": hand}
    motion |= {"motion__target": (stretch + FORCE / hand, 0.0, 0.0)}
    gains = {"coupling__stiffness": 500.0, "coupling__damping": 0.3}
    return Changing(motion, 0.0, **{"damping": 3.2} | gains | given).go(0.96)


def _beyond(before, old, row, new):
    """Change of the force on the handle, less what its own motion makes of it by gains in force before or after [N].

    The controller's own damping, the force ramp, and a display that lets go, count for nothing.
    """
    axes = int(new["axes"])
    if row["engage"] < before["engage"]:
        return np.zeros(axes)
    changed = np.abs(row["force_on_handle"] - before["force_on_handle"])
    changed -= np.abs(row["force_passivity"] - before["force_passivity"])
    own = _own(new, before, row)
    if old.tobytes() != new.tobytes():
        own = np.maximum(own, _own(old, before, row))
    own += (row["engage"] - before["engage"]) * np.abs(row["force_on_handle"]) / max(row["engage"], 1e-12)
    return np.maximum(0.0, changed - own)[:axes]


def _own(settings, before, row):
    """What the handle's own motion changes the force by [N] at most, by these settings."""
    way, turn = np.abs(row["position"] - before["position"]), np.abs(row["velocity"] - before["velocity"])
    coupling, cancelled = settings["coupling"], settings["cancellation"]["ratio"] * settings["hardware"]["damping"]
    own = coupling["stiffness"] * way + (coupling["damping"] + cancelled) * turn
    wall, fastest = settings["wall"], np.maximum(np.abs(row["velocity"]), np.abs(before["velocity"]))
    for j in range(int(wall["count"])):
        normal = np.array([wall["x"][j], wall["y"][j], 0.0])
        outside = [normal @ one["position"] >= wall["offset"][j] - 1e-12 for one in (before, row)]
        # a damper begins and ends where its wall does
        change = row["velocity"] - before["velocity"]
        rate = np.abs(normal) @ fastest if outside[0] != outside[1] else abs(normal @ change)
        push = wall["stiffness"][j] * abs(normal @ (row["position"] - before["position"])) + wall["damping"][j] * rate
        own += np.abs(normal) * push
    return own
