# SPDX-License-Identifier: Apache-2.0
"""Device loop and simulation put together without clock or DDS: the live system's tick, plant and exchange, repeatable.

Time is the servo's deadlines. A handle sample is taken every exchange period from the newest tick; its answer counts
from the first tick that is at least `delay` later. Delay, jitter and loss are injected here, from a seed.
"""

from typing import Any, NamedTuple, Protocol

import numpy as np

from haptic_device.config.description import Device
from haptic_device.control import contact_model, controller_config, enable_state, gain_check, records, tool_contacts
from haptic_device.device import loopback_config, simulated_device
from haptic_device.realtime import servo_loop
from haptic_sim.exchange.endpoint import ExchangeEndpoint
from haptic_sim.exchange.simulation import HandleSample, Simulation, ToolSample

SECOND = 1_000_000_000
SESSION = 1.0  # of either side
Flying = list[tuple[int, int, int, Any]]
"""Samples on their way: arrival [ns], sequence, sent [ns], sample."""


class Network(NamedTuple):
    """Delay and loss of samples between driver and simulation. Each direction has half of delay and jitter.

    Attributes:
        delay: round trip of a handle sample and its answer [s].
        jitter: largest deviation from the delay, evenly distributed [s].
        loss: share of the exchanges that are lost, 0…1; each direction loses samples independently.
        seed: of the random numbers.

    Examples:
        >>> from haptic_sim.lockstep.lockstep import Network
        >>> Network(delay=0.01)
        Network(delay=0.01, jitter=0.0, loss=0.0, seed=0)
    """

    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0
    seed: int = 0


PERFECT = Network()


class Played(Protocol):
    """A recorded motion in place of the operator's script (recorded_operator.py)."""

    def run(self, system: "Lockstep", rows: np.ndarray, start: int) -> None:
        """Ticks of the system from this time [ns] on."""


class Lockstep:
    """Servo, device model and simulation in one process, without clock and ROS. Equal values give identical results.

    Raises ValueError if values do not fit together. In every exchange period the newest tick gives a handle sample. Its
    answer is used from the first tick after the delay on.

    Args:
        device: the device, as the driver has it.
        driver: all parameters of these nodes, {name: value}.
        loopback: all parameters of these nodes, {name: value}.
        simulation: the world behind the exchange, or None for a handle in free space.
        network: the network between driver and simulation.
        write_delay: time from each deadline to the write to the motor [s].
        hand: a recorded motion that replaces the script of the loopback.

    Examples:
        >>> from haptic_device.config.description import load_device
        >>> from haptic_device.config.parameter_types import defaults
        >>> from haptic_sim.node.parameters import NODES
        >>> from haptic_sim.lockstep.lockstep import Lockstep
        >>> wall = {"normals": (1.0, 0.0), "offsets": (0.0,), "stiffness": (1000.0,), "damping": (0.0,)}
        >>> walls = {f"wall.{name}": values for name, values in wall.items()}
        >>> free = {"coupling.stiffness": 0.0, "coupling.damping": 0.0}
        >>> motion = {"motion.name": "press_wall", "motion.start": (0.01, 0.0, 0.0), "motion.target": (-0.01, 0.0, 0.0)}
        >>> driver = defaults(NODES["haptic_driver"]) | walls | free
        >>> loopback = defaults(NODES["haptic_loopback"]) | motion
        >>> rows = Lockstep(load_device("desktop"), driver, loopback, None).run(2.0)
        >>> last = rows[-1]
        >>> print(f"{last.force_walls[0]:.3f} N, {-1000.0 * last.position[0]:.3f} N")  # the wall's force is K x depth
        3.320 N, 3.320 N
    """

    def __init__(
        self,
        device: Device,
        driver: dict[str, Any],
        loopback: dict[str, Any],
        simulation: Simulation | None,
        network: Network = PERFECT,
        write_delay: float = 0.0,
        hand: Played | None = None,
    ):
        self.device, self.simulation, self.network, self._hand = device, simulation, network, hand
        self.settings = controller_config.settings_from(device, driver)
        gain_check.counted(self.settings, gain_check.delays(self.settings[0]) + write_delay)
        self.gains = controller_config.gains_from(driver, self.settings)[0]
        self.memory, self.tool = np.zeros(1, records.STATE), np.zeros(1, servo_loop.TOOL)
        self.plant, self.plant_memory, self.motion = loopback_config.hand_from(device, loopback)
        self.ticks, self.period = 0, round(SECOND / driver["servo.rate"])
        self.exchange_period = SECOND / driver["exchange.rate"]
        self.write_delay, self.command = round(write_delay * SECOND), enable_state.ENABLE
        self._random = np.random.default_rng(network.seed)
        self.near, self._local = np.zeros(1, contact_model.SET), driver["exchange.method"] == "local"
        if simulation is not None:
            self._endpoint = ExchangeEndpoint(simulation, simulation.scene.tool.pose, driver["exchange.method"])
        self._sent = self._heard = 0  # handle samples: newest sent, newest answered
        self._going: Flying = []
        self._coming: Flying = []

    def run(self, seconds: float) -> np.recarray:
        """The next ticks of this time [s]: a structured array, a row a tick, with the columns of `trace`."""
        rows = np.zeros(round(seconds * SECOND / self.period), records.TRACE_ROW).view(np.recarray)
        done = 0
        while done < len(rows):
            until = min(len(rows), done + self._ticks_to_event())
            self._tick(rows[done:until])
            done = until
            self._exchange(rows[done - 1])
        return rows

    def _tick(self, rows: np.ndarray) -> None:
        self._arrive()
        start = (self.ticks + 1) * self.period
        if self._hand is None:
            self.script_ticks(rows, start)
        else:
            self._hand.run(self, rows, start)
        self.ticks += len(rows)

    def script_ticks(self, rows: np.ndarray, start: int) -> None:
        """Ticks from this time [ns] on, against the plant with the hand's script on it."""
        device = self.plant, self.plant_memory, self.motion
        timing = start, self.ticks, self.write_delay
        simulated_device.run_lockstep(self.settings, self.memory, rows, self.tool, *device, *timing, self.command)

    def _ticks_to_event(self) -> int:
        """Ticks until a handle sample is due, or until the next tick finds a sample that has arrived; at least one."""
        if self.simulation is None:
            return 1 << 40
        due = -(-(self._sent + 1) * self.exchange_period // self.period)
        found = (-(-one[0] // self.period) - 1 for one in self._going + self._coming)
        return max(1, int(min((due, *found))) - self.ticks)

    def _arrive(self) -> None:
        """What has arrived by the next deadline counts, newest first come; older ones are thrown away."""
        deadline = (self.ticks + 1) * self.period
        landed, self._going = _split(self._going, deadline)
        for arrival, sequence, sent, handle in landed:
            if sequence > self._heard:
                self._heard = sequence
                answer = self._endpoint.exchange(handle, arrival), self._look()
                self._fly(self._coming, arrival, sequence, sent, answer)
        landed, self._coming = _split(self._coming, deadline)
        for _, sequence, sent, (sample, near) in landed:
            if sequence > self.tool["answered"][0]:
                self._take(sequence, sent, sample)
                if near is not None:
                    self._take_contacts(sequence, sent, *near)

    def _look(self) -> tuple[dict[str, float], np.ndarray] | None:
        """The local contacts that go with an answer: what a set says once, and its table."""
        if not self._local or self.simulation is None:
            return None
        near = self.simulation.local_contacts
        near.look(self.network.delay + self.exchange_period / SECOND)
        return near.common, near.table.copy()

    def _take_contacts(self, sequence: int, sent: int, common: dict[str, float], table: np.ndarray) -> None:
        self.near["number"], self.near["sent"], self.near["table"] = sequence, sent, table
        for name, value in common.items():
            self.near[name] = value
        tool_contacts.take(self.memory.view(np.recarray)[0].virtual_tool.contacts, self.near[0])

    def _fly(self, flying: Flying, now: int, sequence: int, sent: int, sample: Any) -> None:
        """Puts a sample on its way, unless it is lost."""
        if self._random.random() < 1.0 - (1.0 - self.network.loss) ** 0.5:
            return
        flight = 0.5 * (self.network.delay + self.network.jitter * (2.0 * self._random.random() - 1.0))
        flying.append((now + max(0, round(flight * SECOND)), sequence, sent, sample))

    def _take(self, sequence: int, sent: int, sample: ToolSample) -> None:
        tool = self.tool[0]
        tool["session"], tool["sequence"], tool["answered"], tool["sent"] = SESSION, sequence, sequence, sent
        tool["contact"], tool["energy"], tool["handle_sequence"] = sample.contact, sample.energy, self._sent
        axes = len(self.device.axes)
        tool["position"][:axes], tool["velocity"][:axes] = sample.position[:axes], sample.velocity[:axes]
        tool["effort"][:axes] = sample.force_on_tool[:axes]

    def _exchange(self, row: np.record) -> None:
        if self.simulation is None or row.deadline < (self._sent + 1) * self.exchange_period:
            return
        self._sent += 1
        *gains, _, limit = self.gains.tolist()
        port = (tuple(row.position.tolist()), tuple(row.velocity.tolist()))
        now, shipped = int(row.deadline), float(row.exchange_energy)
        self._fly(self._going, now, self._sent, now, HandleSample._make((now, *port, *gains, shipped, tuple(limit))))


def _split(flying: Flying, deadline: int) -> tuple[Flying, Flying]:
    """Samples that have arrived, in order of arrival, and those still on their way."""
    landed = sorted((one for one in flying if one[0] <= deadline), key=lambda one: one[:2])
    return landed, [one for one in flying if one[0] > deadline]
