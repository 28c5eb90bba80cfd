# SPDX-License-Identifier: Apache-2.0
"""One recorded run as a report needs it: the columns that it shows, whatever of them is there, and what was not."""

from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from haptic_device.message_fields import AXES
from haptic_device.recording.bag_contents import Joints, Nanoseconds, Recording, Records
from haptic_device.recording.status import number
from haptic_device.theory.quantity import Array, Flags
from haptic_display.run.report.conditions import conditions, period
from haptic_display.run.report.impedance import Impedance, fit, held_still
from haptic_display.run.report.oscillation import Spectrum, spectrum_of
from haptic_display.run.report.wall_contacts import Contact, contacts, touching

TELLING = 0.9  # share of the force that a fit in contact has to explain
AVERAGED = 8  # ticks, where only the servo's own columns are there
WRENCH = "force.x", "force.y", "torque.z"  # entries of `wrench` along the axes


@dataclass
class Run:
    """A recording and results computed from it. A property raises ValueError if its data is not in the recording.

    Time 0 is the first tick with the motor engaged, or the first message if there is no trace.

    Attributes:
        recording: the recording.
        name: name of the bag.
        notes: problems of the bag, one sentence each.
        no_trace: why there is no trace that can be shown, or "".
        started: when the command began, on CLOCK_MONOTONIC [s], if that is known.

    Examples:
        >>> from haptic_display.run.report.reading import read_run
        >>> run = read_run("run/bag")
        >>> [f"{one.begin:.1f} to {one.end:.1f} s, {one.force:.1f} N" for one in run.contacts]
        ['0.9 to 2.0 s, 1.7 N']
        >>> time, x = run.places(0)["handle"]
        >>> time.shape == x.shape
        True
    """

    recording: Recording
    name: str
    notes: list[str] = field(default_factory=list)
    no_trace: str = ""
    started: float | None = None

    @property
    def traced(self) -> bool:
        """Whether the servo's ticks can be shown."""
        return not self.no_trace

    @cached_property
    def rows(self) -> Records:
        """The ticks from the first to the last with the motor engaged, or all if it never was."""
        if self.no_trace:
            raise ValueError(self.no_trace)
        trace = self.recording.trace
        timed = np.isfinite(trace["deadline"])
        if timed.any() and not timed.all():
            self.notes.append(f"{np.sum(~timed)} ticks without a deadline are left out")
            trace = trace[timed]
        back = np.flatnonzero(np.diff(trace["deadline"]) < 0.0)
        if len(back):
            first, others = back[0] + 1, len(trace) - back[0] - 1
            self.notes.append(f"after {first} ticks the trace goes back in time: the other {others} are left out")
            trace = trace[:first]
        if len(trace) < 2:
            raise ValueError(f"the trace has {len(trace)} ticks; two are needed")
        engaged = trace["engage"] > 0
        if engaged.sum() < 2:
            self.notes.append("the motor was never engaged: figures are of all ticks")
            return trace
        return trace[np.argmax(engaged) : len(trace) - np.argmax(engaged[::-1])]

    @cached_property
    def seconds(self) -> Array:
        """Time of each tick [s] from the first."""
        return (self.rows["deadline"] - self.rows["deadline"][0]) * 1e-9

    @cached_property
    def span(self) -> tuple[int, int]:
        """When the first and the last message that was read came, without a trace [ns of the system clock]."""
        recording = self.recording
        times = [int(time) for joints in recording.joints.values() for time in joints.received[[0, -1]]]
        times += [status.time for statuses in recording.diagnostics.values() for status in statuses]
        times += [mark.time for mark in recording.marks]
        return min(times), max(times)

    @property
    def length(self) -> float:
        """From the first to the last tick, or message without a trace [s]."""
        return float(self.seconds[-1]) if self.traced else (self.span[1] - self.span[0]) * 1e-9

    @property
    def begun(self) -> datetime | None:
        """When the recording began, in this machine's time zone; None in lock-step, which has no date."""
        if self.recording.last_values("haptic_driver").get("realtime") == "lock-step":
            return None
        system = self.recording.pairs[0]
        first = int(system[0]) if len(system) else self.span[0]
        return datetime.fromtimestamp(first * 1e-9).astimezone()

    @cached_property
    def scene(self) -> str:
        """Name of the scene, or "" if it was not recorded."""
        said = self.recording.last_values("haptic_simulation").get("scene", "")
        attached = [name for name in self.recording.attachments if name.startswith("scene/")]
        return Path(said or (attached[0] if attached else "")).stem

    def since(self, time: Nanoseconds) -> Array:
        """Times of the system clock [ns] as times from the first tick, or message without a trace [s]."""
        if not self.traced:
            return np.multiply(time - self.span[0], 1e-9, dtype=float)
        return (self.recording.monotonic(time) - self.rows["deadline"][0]) * 1e-9

    def places(self, axis: int) -> dict[str, tuple[Array, Array]]:
        """Of handle and tool: times [s] and positions [m | rad]. Raises ValueError if there are none."""
        if not self.traced:
            return self._by_topic({"handle": "handle", "tool": "tool"}, "position", axis)
        there = self.rows["tool_age"] >= 0
        chosen = slice(None) if there.all() else there
        return {
            "handle": (self.seconds, self.rows["position"][:, axis]),
            "tool": (self.seconds[chosen], self.rows["tool_position"][chosen, axis]),
        }

    def forces(self, axis: int) -> dict[str, tuple[Array, Array]]:
        """Total on the handle, and of the coupling: times [s] and forces [N | N m]. Raises ValueError without any."""
        if not self.traced:
            motor = self.recording.joints.get("motor")
            joints = motor is not None and AXES[0] not in motor.names  # whose torques are no forces on the handle
            topics = {"on handle": "wrench" if joints else "motor", "of the coupling": "handle"}
            return self._by_topic(topics, "effort", axis)
        columns = {"on handle": "force_on_handle", "of the coupling": "force_coupling"}
        return {name: (self.seconds, self.rows[column][:, axis]) for name, column in columns.items()}

    def _by_topic(self, topics: dict[str, str], part: str, axis: int) -> dict[str, tuple[Array, Array]]:
        """Times and values of one axis of the topics that there are, zero where a topic lacks it."""
        found = {}
        for label, topic in topics.items():
            if joints := self.recording.joints.get(topic):
                time, name = self.since(joints.published), WRENCH[axis] if topic == "wrench" else AXES[axis]
                found[label] = time, joints.entry(name, part) if name in joints.names else np.zeros(len(time))
        if not found:
            raise ValueError(f"no topic {' or '.join(topics.values())} was recorded")
        return found

    @cached_property
    def ground_truth(self) -> Joints:
        """`operator/state` while the ticks ran."""
        state = self.recording.joint("operator/state")
        if not self.traced:
            return state
        time = state.entry("time") - self.rows["deadline"][0] * 1e-9
        during = (time >= 0.0) & (time <= self.seconds[-1])
        first, count = int(np.argmax(during)), int(during.sum())
        chosen = slice(first, first + count) if during[first : first + count].all() else during  # a view, if it can be
        return Joints._make((state.names, *(column[chosen] for column in state[1:])))

    @property
    def no_truth(self) -> str:
        """Why the energy truly given is not known, or ""."""
        return self.recording.lacks("operator/state", "energy_given", "time")

    @property
    def given(self) -> Array:
        """Energy [J] truly given to the operator since the first true sample here, at each true sample."""
        given = self.ground_truth.entry("energy_given")
        return given - given[:1]

    @property
    def booked(self) -> npt.NDArray[np.floating]:
        """Energy [J] given to the operator since the first tick here, as the servo counts it, at each tick."""
        booked = self.rows["energy_given"]
        return (booked - booked[0]).sum(axis=1)

    @cached_property
    def ground_truth_seconds(self) -> Array:
        """Time of each sample of the ground truth [s] from the first tick."""
        if not self.traced:
            return self.since(self.ground_truth.published)
        return self.ground_truth.entry("time") - self.rows["deadline"][0] * 1e-9

    @cached_property
    def tool_energy(self) -> npt.NDArray[np.float32]:
        """Work [J] of the coupling on the tool up to each tick, by the tool samples as the servo got them (trapezoids).

        The energy of a tool sample in the trace is another quantity: the energy that the exchange method sends.
        """
        work, known = np.zeros(len(self.rows) - 1, np.float32), self.rows["tool_age"][:-1] >= 0
        for axis in range(len(AXES)):
            force, place = self.rows["tool_effort"][:, axis], self.rows["tool_position"][:, axis]
            work += np.nan_to_num((force[1:] + force[:-1]) * 0.5 * np.diff(place)) * known
        return np.append(np.float32(0.0), np.cumsum(work, dtype=float).astype(np.float32))

    @property
    def distance(self) -> npt.NDArray[np.floating]:
        """From handle to tool in the plane [m] at each tick with a tool. Raises ValueError if there is none."""
        there = self.rows["tool_age"] >= 0
        if not there.any():
            raise ValueError("no tool sample was ever used")
        x, y = (self.rows["tool_position"][there, i] - self.rows["position"][there, i] for i in (0, 1))
        return np.hypot(x, y, out=x)

    @cached_property
    def conditions(self) -> dict[str, str]:
        """Gains, T, b and method, as far as they were recorded."""
        if found := conditions(self.recording):
            return found
        return {"T": f"{period(self.rows) * 1e6:.0f} µs"} if self.traced else {}

    @cached_property
    def touch(self) -> Flags:
        """Whether each tick was in contact; without a trace, the tool at each of its messages."""
        if not self.traced:
            return self.recording.joint("tool").entry("contact") > 0.0
        return touching(self.rows)

    @cached_property
    def contacts(self) -> list[Contact]:
        """The contacts, in the order of time; without a trace those of the tool, by the coupling's force on it."""
        if not self.traced:
            parts = [self._by_topic({"tool": "tool"}, "effort", axis)["tool"] for axis in (0, 1)]
            return contacts(parts[0][0], self.touch, np.stack([force for _, force in parts], axis=1))
        return contacts(self.seconds, self.touch, self.rows["force_on_handle"][:, :2])

    @cached_property
    def spectrum(self) -> Spectrum:
        """Spectrum of the force on the handle in x and y."""
        sent = self.rows["handle_sequence"][-1] - self.rows["handle_sequence"][0]
        exchange = max(0.0, float(sent / self.seconds[-1])) if np.isfinite(sent) else 0.0
        return spectrum_of(self.rows["force_on_handle"][:, :2], 1.0 / period(self.rows), exchange)

    @cached_property
    def physical_damping(self) -> Array:
        """b of each axis [N s/m, N m s/rad] as the driver reports it; NaN if it does not."""
        said = self.recording.last_values("haptic_driver").get("physical_damping", "")
        values = [number(word) for word in said.split(",") if word.strip()]
        return np.array((values + [np.nan] * 3)[:3])

    @cached_property
    def impedances(self) -> dict[tuple[str, str], Impedance]:
        """The useful `fits`: in contact, only fits that explain the force."""
        return {what: found for what, found in self.fits.items() if what[0] == "free" or found.explained >= TELLING}

    @cached_property
    def fits(self) -> dict[tuple[str, str], Impedance]:
        """What the display added to the device: {(contact | free, axis): fit of minus the motor's force}.

        In contact the fit uses only times at which the tool stood still and the handle moved, and it uses the distance
        from the tool, because a moving tool is a second input. The fit does not use the force of the hand: in the
        closed loop it would find the spring of the hand.
        """
        time, parts = self._felt()
        place = np.clip(np.searchsorted(self.seconds, time, side="right") - 1, 0, len(self.seconds) - 1)
        touch, engaged = self.touch[place], self.rows["engage"][place] >= 1.0
        found = {}
        for axis, (position, velocity, force) in parts.items():
            tool = self._held_to(AXES.index(axis), place)
            held = held_still(time, tool, position)
            with np.errstate(divide="ignore", invalid="ignore"):  # a state published twice: no number, and left out
                stretch = position - tool, velocity - np.gradient(tool, time)
            for kind, chosen, way in (
                ("contact", touch & held & engaged, stretch),
                ("free", ~touch & engaged, (position, velocity)),
            ):
                episode = np.cumsum(np.diff(chosen, prepend=chosen[:1]) != 0)
                place_of, speed_of, push_of = (column[chosen] for column in (*way, force))
                fitted = fit(time[chosen], place_of, speed_of, push_of, episode[chosen])
                if fitted is not None:
                    found[kind, axis] = fitted
        return found

    def _held_to(self, axis: int, place: npt.NDArray[np.intp]) -> Array:
        """Where the tool is in this axis; 0 where a wall holds the handle."""
        tool = self.rows["tool_position"][place, axis].astype(float)
        return np.where(np.abs(self.rows["force_walls"][place]).max(axis=1) > 0.0, 0.0, tool)

    def _felt(self) -> tuple[Array, dict[str, tuple[Array, Array, Array]]]:
        """Times [s], and position, velocity, minus motor force of each axis: of the truth, else of the trace."""
        state = self.recording.joints.get("operator/state")
        names = [name for name in AXES if state and name in state.names and f"motor_{name}" in state.names]
        truth = self.ground_truth if names else None
        if truth is None or len(truth.stamp) < 2:
            return self._felt_by_servo()
        parts = {
            name: (truth.entry(name), truth.entry(name, "velocity"), -truth.entry(f"motor_{name}", "effort"))
            for name in names
        }
        return self.ground_truth_seconds, parts

    def _felt_by_servo(self) -> tuple[Array, dict[str, tuple[Array, Array, Array]]]:
        """The same as the servo saw it: means of some ticks, which an encoder's steps hardly touch."""
        count = len(self.rows) // AVERAGED * AVERAGED

        def blocks(values: Array) -> Array:
            return values[:count].reshape(-1, AVERAGED).mean(axis=1)

        time = blocks(self.seconds)
        if len(time) < 2:
            return time, {}
        parts = {}
        for index, name in enumerate(AXES):
            position = blocks(self.rows["position"][:, index])
            force = -blocks(self.rows["force_on_handle"][:, index].astype(float))
            with np.errstate(divide="ignore", invalid="ignore"):  # where time stands still: no number
                parts[name] = position, np.gradient(position, time), force
        return time, parts

    @cached_property
    def marks(self) -> list[tuple[float, str]]:
        """Markers: time from the first tick [s] and text."""
        seconds = self.since(np.array([mark.time for mark in self.recording.marks], np.int64))
        return [(float(time), mark.text) for time, mark in zip(seconds, self.recording.marks, strict=True)]

    def attached(self, name: str) -> dict[str, Any]:
        """An attachment in YAML; empty if there is none, or it is none."""
        try:
            content = yaml.safe_load(self.recording.attachments.get(name, b""))
        except (yaml.YAMLError, UnicodeDecodeError):
            return {}
        return content if isinstance(content, dict) else {}
