# SPDX-License-Identifier: Apache-2.0
"""A hand in lock-step while settings change as live parameters do, and what is judged of it tick by tick."""

import numpy as np
from lockstep_systems import device, values

from haptic_device.control import controller_config, gain_check, rows
from haptic_device.control.records import TRACE_ROW
from haptic_sim.lockstep.lockstep import Lockstep

RATE, FORCE = 1000.0, 3.0  # [Hz], [N] of the hand on the wall
WIDE = {"workspace": (-10.0, 10.0), "motor_limit": 15.0}
WALL = {"wall__normals": (1.0, 0.0), "wall__offsets": (0.0,), "wall__stiffness": (500.0,), "wall__damping": (0.0,)}
NO_WALL = dict.fromkeys(WALL, ())
NO_COUPLING = {"coupling__stiffness": 0.0, "coupling__damping": 0.0}


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
            before, ran, table = self._before, self.run(1.0 / RATE), self.memory["rows"][0]
            row = ran.view(TRACE_ROW)[0]  # whose fields are found faster than those of a record
            if before is not None:
                self.beyond.append(_beyond(*before, row, self.settings))
            self._before = row, table[table["weight"] > 0.0].copy()
            self.rows.append(ran[0])
            self.given.append(float(self.plant_memory["energy_given"][0]))
            kinds = zip(self.device.axes, self.plant_memory["velocity"][0], strict=False)
            moving = sum(axis.mass * velocity**2 for axis, velocity in kinds)
            self.held.append(max(0.0, float(row["exchange_tank"])) + float(row["stored"]) + 0.5 * moving)
        return self

    @property
    def forged(self):
        """Most [J] that the hand got by the plant's truth, from any tick on, beyond what was held then."""
        given = np.array(self.given)
        return float(np.max(given - np.minimum.accumulate(given + self.held)))

    # energy [J] that may be given before any has been paid
    budget = property(lambda self: float(self.settings["exchange"]["budget"][0]))

    @property
    def paid(self):
        """The most [J] that the account fell by, from any tick on."""
        left = np.array([row.exchange_tank + row.exchange_energy for row in self.rows])
        return float(np.max(np.maximum.accumulate(left) - left))

    # what springs and dampers together may change the force by in a tick beyond the handle's own motion [N]
    slew = property(lambda self: 1.25 * float(self.settings["exchange"]["slew"][0, 0]) / RATE + 1e-9)

    @property
    def there(self):
        """Whether all that is wished for is in force."""
        wished, table, axes = self.settings[0], self.memory["rows"][0], len(self.device.axes)
        coupling, count = table[rows.COUPLING : rows.COUPLING + axes], int(wished["wall"]["count"])
        walls, beyond = table[rows.WALLS : rows.WALLS + count], table[rows.WALLS + count :]
        cancelled = -wished["cancellation"]["ratio"] * wished["port"]["damping"][:axes]
        on, fade = self.rows[-1].engage > 0.0, self.rows[-1].exchange_fade
        pairs = [(coupling[n], wished["coupling"][n][:axes]) for n in ("stiffness", "damping")]
        pairs += [(walls[n], wished["wall"][n][:count]) for n in ("offset", "stiffness", "damping")]
        pairs += [(walls["normal"][:, i], wished["wall"][n][:count]) for i, n in enumerate("xy")]
        pairs += [(coupling["high"], wished["coupling"]["limit"][:axes]), (coupling["weight"], on * fade)]
        pairs += [(walls["weight"], on), (beyond["weight"], 0.0)]
        pairs += [(table["damping"][rows.CANCELLATION : rows.CANCELLATION + axes], cancelled)]
        return all(np.array_equal(now, np.broadcast_to(wanted, now.shape)) for now, wanted in pairs)


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


def _beyond(before, table, row, settings):
    """Change of the force on the handle, less what its own motion makes of it [N].

    table: that was in force before. A display that lets go counts for nothing.
    """
    axes = int(settings["axes"][0])
    if row["engage"] < before["engage"]:
        return np.zeros(axes)
    was, now = before["force_on_handle"], row["force_on_handle"]
    way = row["position"] - before["position"]
    own = np.zeros(3)
    for one in table:
        rate = one["rate"] - one["normal"] @ way * RATE
        spring = np.clip(one["stiffness"] * (one["offset"] - one["normal"] @ row["position"]), one["low"], one["high"])
        both = np.clip(spring + one["damping"] * rate, one["low"], one["high"])
        outside = one["low"] == 0.0 and spring <= 0.0
        own += 0.0 if outside else one["weight"] * both * one["normal"]
    low, high = np.minimum(was, own), np.maximum(was, own)
    return np.maximum(0.0, np.maximum(low - now, now - high))[:axes]
