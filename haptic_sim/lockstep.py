# SPDX-License-Identifier: Apache-2.0
"""Device loop and simulation put together without clock or DDS: the live system's tick, plant and exchange, repeatable.

Time is the servo's deadlines. A handle sample is taken every exchange period from the newest tick; its answer counts
from the first tick that is at least `delay` later. Delay, jitter and loss are injected here, from a seed.
"""

from typing import NamedTuple

import numpy as np

from haptic_device import operating
from haptic_device.law import engage, servo
from haptic_device.runtime import loop
from haptic_sim.simulation import HandleSample, Simulation

SECOND = 1_000_000_000


class Network(NamedTuple):
    """delay: of handle sample and answer together [s]; jitter: uniform ± [s]; loss: share of turns lost; seed."""

    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0
    seed: int = 0


PERFECT = Network()


class Lockstep:
    """The system of one operating point; `run` goes on where it stopped.

    driver, loopback: values of those nodes' parameters, all of them; device: as the driver has it; write_delay: time
    [s] from each deadline to the motor's write. Without a simulation the handle is in free space.
    """

    def __init__(self, device, driver, loopback, simulation: Simulation | None, network=PERFECT, write_delay=0.0):
        self.device, self.simulation, self.network = device, simulation, network
        self.settings = operating.settings_from(device, driver)
        self.gains = operating.gains_from(driver)[0]
        self.memory, self.tool = np.zeros(1, servo.MEMORY), np.zeros(1, loop.TOOL)
        self.plant, self.plant_memory, self.motion = operating.hand_from(device, loopback)
        self.ticks, self.period = 0, round(SECOND / driver["servo.rate"])
        self.exchange_period = SECOND / driver["exchange.rate"]
        self.write_delay, self.command = round(write_delay * SECOND), engage.ENABLE
        self._random = np.random.default_rng(network.seed)
        self._sent, self._flying = 0, []  # answers on their way: (arrival [ns], sequence, sent [ns], ToolSample)

    def run(self, seconds) -> np.recarray:
        """Rows of the ticks of this time."""
        rows = np.zeros(round(seconds * SECOND / self.period), servo.TICK).view(np.recarray)
        done = 0
        while done < len(rows):
            until = min(len(rows), done + self._ticks_to_event())
            self._tick(rows[done:until])
            done = until
            self._exchange(rows[done - 1])
        return rows

    def _tick(self, rows):
        self._arrive()
        start = (self.ticks + 1) * self.period
        loop.run_lockstep(
            self.settings, self.memory, rows, self.tool, self.plant, self.plant_memory, self.motion, start, self.ticks,
            self.write_delay, self.command,
        )  # fmt: skip
        self.ticks += len(rows)

    def _ticks_to_event(self):
        """Ticks until a handle sample is due or an answer arrives, at least one."""
        if self.simulation is None:
            return 1 << 40
        times = [(self._sent + 1) * self.exchange_period, *(answer[0] for answer in self._flying)]
        return max(1, int(-(-min(times) // self.period)) - self.ticks)

    def _arrive(self):
        """The newest answer that has arrived by the next deadline counts; older ones are thrown away."""
        deadline = (self.ticks + 1) * self.period
        landed = [answer for answer in self._flying if answer[0] <= deadline]
        self._flying = [answer for answer in self._flying if answer[0] > deadline]
        for _, sequence, sent, sample in landed:
            if sequence > self.tool["answered"][0]:
                self._take(sequence, sent, sample)

    def _take(self, sequence, sent, sample):
        tool = self.tool[0]
        tool["session"], tool["sequence"], tool["answered"], tool["sent"] = 1.0, sequence, sequence, sent
        tool["contact"], tool["energy"], tool["handle_sequence"] = sample.contact, sample.energy, self._sent
        for name, numbers in (
            ("position", sample.position),
            ("velocity", sample.velocity),
            ("effort", sample.force_on_tool),
        ):
            tool[name][: len(self.device.axes)] = numbers[: len(self.device.axes)]

    def _exchange(self, row):
        if self.simulation is None or row.deadline < (self._sent + 1) * self.exchange_period - self.period:
            return
        self._sent += 1
        if self._random.random() < self.network.loss:
            return
        names = ("stiffness", "damping", "rotational_stiffness", "rotational_damping")
        gains = (float(self.gains[name]) for name in names)
        handle = HandleSample(int(row.deadline), tuple(row.position.tolist()), tuple(row.velocity.tolist()), *gains)
        flight = self.network.delay + self.network.jitter * (2.0 * self._random.random() - 1.0)
        self._flying.append(
            (
                int(row.deadline) + round(flight * SECOND),
                self._sent,
                int(row.deadline),
                self.simulation.exchange(handle),
            )
        )
