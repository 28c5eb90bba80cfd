# SPDX-License-Identifier: Apache-2.0
"""Servo tick, turn of the bridge, codec and device put together in made-up time; how long bytes take is of a seed.

What runs is the product's: the tick, the page's words, the bridge's turn and next look, the codec. The line is a pair
of sockets; bytes are on their way in between. The devices are the emulators and the firmware's core, each with a plant
and a hand that pulls by spring and damper; `given` is the energy that the hand got, by that plant.
"""

import contextlib
import ctypes
import functools
import heapq
import itertools
import math
import socket
from typing import NamedTuple

import codec_host
import firmware_builds
import numba
import numpy as np
from lockstep_systems import values
from numba import types
from numba.typed import List
from ticks import tick

from haptic_device.control import controller_config, enable_state, gain_check, records
from haptic_device.jit import kernel
from haptic_device.link import bridge_loop, codec, haply, moteus, open_serial, open_udp
from haptic_device.realtime import hardware_interface, shared_memory

MS, SECOND = 1_000_000, 1_000_000_000
BEGAN = SECOND  # [ns]
LOOK = 50_000  # [ns] between looks of a bridge that has to look again: no faster, so that an hour is not a day
COMPUTE = 20_000  # [ns] from a sample to the motor value that is made of it
HAND_STEP = MS  # [ns] between looks of a hand
NEVER = 1 << 62
BEGIN, TURN, LAST_WORD = range(3)
SERVO, BRIDGE, DEVICE = "servo", "bridge", "device"


class Way(NamedTuple):
    """One way on a line [ns]: the shortest, an exponential beyond it of this mean, cut at the longest; share lost."""

    shortest: int = 20_000
    tail: int = 0
    longest: int = NEVER
    loss: float = 0.0


AT_ONCE = Way()


def _bridge(what, encoders, decoders, state, words, control, truth_mail, target_mail, session, now, memory, room):
    """A step of the bridge's loop at this time; returns when it wants to look again."""
    m, came, encode, decode = memory[0], bridge_loop.receive(control, memory[0], room), encoders[0], decoders[0]
    if what == BEGIN:
        bridge_loop.begin(words, target_mail, now, m, room)
    elif what == TURN:
        bridge_loop.turn(encode, decode, state, words, control, truth_mail, target_mail, session, came, now, m, room)
    else:
        bridge_loop.last_word(encode, decode, state, words, control, truth_mail, session, came, now, m, room)
    return bridge_loop.next_look(control, now, m)


def _new_memory():
    return np.zeros(1, bridge_loop.MEMORY), bridge_loop.buffers.py_func()


ENCODE, DECODE = types.FunctionType(codec.ENCODE), types.FunctionType(codec.DECODE)
LISTS = types.ListType(ENCODE), types.ListType(DECODE)


def _listed(encode, decode):
    """In lists: numba looks up the address of a function that it is given, with each call anew."""
    encoders, decoders = List.empty_list(ENCODE), List.empty_list(DECODE)
    encoders.append(encode)
    decoders.append(decode)
    return encoders, decoders


@functools.cache
def _compiled():
    kinds = types.int64, *LISTS, *[types.int64[::1]] * 5, types.int64, types.int64
    step = kernel(types.int64(*kinds, *map(numba.typeof, _new_memory())))(_bridge)
    return step, kernel(types.Tuple(LISTS)(ENCODE, DECODE))(_listed)


class Emulated:
    """An emulator as a mechanism."""

    datagram = False

    def __init__(self, emulator, log, kind, options, device):
        self.emulator, self.log, self.next = emulator, log, BEGAN
        self.codec, self.description = kind.codec(options, device), device

    def serve(self, data, now):
        self.next = now + HAND_STEP
        answer = self.emulator.serve(data, now)
        return [answer] if answer else []

    due = property(lambda self: min(self.next, self.emulator.due))


class Knob(Emulated):
    """A moteus knob whose lever stands there [m]; x is the arc of its end."""

    def __init__(self, place=0.0, watchdog=0.1):
        emulated, log = codec_host.emulated("moteus"), codec_host.Log()
        self.length, drive = emulated.LEVER, emulated.Drive(1, log, place / emulated.LEVER / math.tau)
        self.joint = drive.motor
        options, device = codec_host.described("moteus_knob", moteus)
        super().__init__(
            emulated.Bus(log, {1: drive}), log, moteus, options.model_copy(update={"watchdog": watchdog}), device
        )

    def hold(self, goal):
        """The hand pulls the lever's end to this place [m]."""
        joint, squared = self.joint, self.length**2
        joint.goal, joint.spring, joint.damper = goal / self.length, 300.0 * squared, 8.0 * squared

    force = property(lambda self: self.joint.torque / self.length)
    speed = property(lambda self: self.joint.velocity * self.length)
    given = property(lambda self: self.joint.given)


class Arms(Emulated):
    """A Haply 2DIY; once its board is set up in the rest pose a hand has led the handle to this x [m], half way up."""

    def __init__(self, place=0.0):
        log = codec_host.Log()
        board = codec_host.emulated("haply").Board(log)
        super().__init__(board, log, haply, *codec_host.described("haply_2diy_gen3", haply))
        self.arms, self._led = board.arms, False
        (low, high), (x, y) = self.description.axes[1].workspace, self.description.kinematics.origin
        self._middle = x, y + 0.5 * (low + high)
        self.hold(place)

    def hold(self, goal):
        """The hand pulls the handle to this x [m]."""
        self._goal = self._middle[0] + goal, self._middle[1]
        if self._led:
            self.arms.hold(*self._goal)

    def serve(self, data, now):
        answer = super().serve(data, now)
        if not self._led and self.log.said("setup"):
            self._led = True
            self.arms.lead(*self.description.kinematics.angles(*self._goal)[0])
        return answer

    @property
    def force(self):
        """x of the motors' force at the handle [N]: of J⁻ᵀ τ."""
        jacobian = np.reshape(self.description.kinematics.pose(*self.arms.angles)[2:6], (2, 2))
        return np.linalg.solve(jacobian.T, self.arms.torque)[0]

    speed = property(lambda self: self.arms.memory["velocity"][0, 0])
    given = property(lambda self: self.arms.memory["energy_given"][0])


class Reference:
    """The firmware's core and the reference device's plant; the handle stands there [m].

    skew, ahead [ns]: of its clock; the plant goes with it, but for a step of ahead.
    """

    def __init__(self, datagram=True, place=0.0, skew=0.0):
        self.datagram, self.skew, self.ahead, self._port = datagram, skew, 0, firmware_builds.ports()
        kind = open_udp if datagram else open_serial
        options, device = codec_host.described("reference_udp" if datagram else "reference_pty", kind)
        self.codec, self.description, self.stiffness, self.damping = kind.codec(options, device), device, 300.0, 5.0
        numbers = [(axis.mass, axis.damping, axis.coulomb, 0.0, 0.0, 5.0, 300.0, 0.0) for axis in device.axes]
        numbers[0] = (*numbers[0][:7], place)
        self._port.plant_port_begin((ctypes.c_double * 8 * 3)(*numbers), ctypes.c_int64(0), ctypes.c_int64(0))
        self._port.plant_port_follow(ctypes.c_double(0.05))
        self._port.plant_port_script()
        known = [[getattr(axis, name) for axis in device.axes] for name in ("counts_per_unit", "motor_limit")]
        self._port.port_begin_plant(int(datagram), *[(ctypes.c_double * 3)(*numbers) for numbers in known])
        self.due = BEGAN

    def _own(self, now):
        return ctypes.c_int64(self.ahead + round((now - BEGAN) * (1.0 + self.skew)))

    def hold(self, goal):
        """The hand pulls the handle to this x [m]."""
        self._port.plant_port_goal((ctypes.c_double * 3)(goal))

    def input(self, bits):
        self._port.port_inputs(bits, -32768)

    def serve(self, data, now):
        self._port.port_set(ctypes.c_int64(self.ahead))
        self._port.port_time(self._own(now))
        if data:
            self._port.port_receive(data, len(data))
        self._port.port_advance()
        self.due = now + max(1, round((self._port.port_due() - self._own(now).value) / (1.0 + self.skew)))
        buffer = (ctypes.c_uint8 * 65536)()
        sent, frames = bytes(buffer[: self._port.port_sent(buffer, len(buffer))]), []
        while sent:
            end = 2 + int.from_bytes(sent[:2], "little")
            frames, sent = [*frames, sent[2:end]], sent[end:]
        return frames

    def _state(self):
        state = (ctypes.c_double * 22)()
        self._port.plant_port_state(state)
        return state

    force = property(lambda self: self._state()[6])
    speed = property(lambda self: self._state()[3])
    given = property(lambda self: self._state()[21])


class Link:
    """A servo with these parameters, a bridge and a mechanism; `run` goes on with them.

    gaps: (who, from, to) [ns after the beginning], in which servo, bridge or device sleeps; late: how late forces are
    taken to act [s], as the driver measures it of the link. Raises ValueError for gains that the driver would refuse.
    """

    def __init__(self, mechanism, seed=0, way=AT_ONCE, back=None, gaps=(), late=0.0, motor_watchdog=15 * MS, **driver):
        self.mechanism, self.codec, self.ways = mechanism, mechanism.codec, (way, back or way)
        self._random = np.random.default_rng(seed)
        given = values("haptic_driver", **driver)
        self.settings = controller_config.settings_from(mechanism.description, given)
        self.memory, self._late = np.zeros(1, records.STATE), late
        if refused := gain_check.refusal(self.settings[0], late):
            raise ValueError(refused)
        self.period, self.command = round(SECOND / given["servo.rate"]), 0
        self.words, self.control = np.zeros(shared_memory.WORDS, np.int64), np.zeros(bridge_loop.CONTROLS, np.int64)
        self.words[hardware_interface.SESSION] = 1
        kind = socket.SOCK_DGRAM if mechanism.datagram else socket.SOCK_STREAM
        self._host_end, self._far_end = socket.socketpair(socket.AF_UNIX, kind)
        for end in (self._host_end, self._far_end):
            end.setblocking(False)
        self.control[bridge_loop.WATCHDOG], self.control[bridge_loop.FD] = motor_watchdog, self._host_end.fileno()
        self.control[bridge_loop.ASKS], self.control[bridge_loop.DATAGRAM] = self.codec.asks, self.codec.datagram
        self._read, self._write = hardware_interface.compiled()
        self._step, listed = _compiled()
        self._functions = listed(self.codec.encode, self.codec.decode)
        self._mails, self._bridge_memory = (np.zeros(64, np.int64), np.zeros(64, np.int64)), _new_memory()
        self._sample = np.zeros(hardware_interface.SAMPLE)
        self.now, self._events, self._count, self._ends = BEGAN, [], itertools.count(), [0, 0]
        self.gaps = [(who, BEGAN + begin, BEGAN + end) for who, begin, end in gaps]
        self.rows, self.most_given, self.passing, self._served, self._ended = [], 0.0, True, False, False
        self._tick, self._lively, self._waits, self.missed, self._row = 0, True, None, 0, np.zeros(1, records.TRACE_ROW)
        self._turns = {BRIDGE: 0, DEVICE: 0}
        self._loop(BEGIN)
        self._at(self.now, self._look)
        self._at(self.now, self._device)

    def close(self):
        self._host_end.close()
        self._far_end.close()

    # ---- time ----

    def run(self, seconds):
        """Everything up to so many seconds from now."""
        end = self.now + round(seconds * SECOND)
        while self._events[0][0] <= end:
            self.now, _, what, *given = heapq.heappop(self._events)
            what(*given)
        self.now = end

    def trace(self, first=0):
        """The rows of the ticks so far, from this one on."""
        return np.frombuffer(b"".join(self.rows[first:]), records.TRACE_ROW).view(np.recarray)

    def until(self, condition, seconds=2.0):
        """Goes on until it is so, which it is to be within this time."""
        for _ in range(round(seconds * 1000)):
            if condition():
                return
            self.run(1e-3)
        raise AssertionError(f"not within {seconds} s")

    def _at(self, when, what, *given):
        heapq.heappush(self._events, (when, next(self._count), what, *given))

    def sleep(self, who, seconds=NEVER / SECOND):
        """From now on, as a process that is stopped; `wake` ends it."""
        self.gaps.append((who, self.now, self.now + round(seconds * SECOND)))

    def _postponed(self, who, what, *given):
        """Whether it sleeps now; then it does this when it wakes."""
        end = max((end for name, begin, end in self.gaps if name == who and begin <= self.now < end), default=0)
        if 0 < end < BEGAN + NEVER // 2:
            self._at(end, what, *given)
        return end > 0

    # ---- the line ----

    def _fly(self, far, data, what):
        """Puts bytes on their way; of a stream none overtakes another."""
        way = self.ways[far]
        if not self.passing or self._random.random() < way.loss:
            return
        took = min(way.longest, way.shortest + int(self._random.exponential(way.tail)) if way.tail else way.shortest)
        arrival = self.now + took
        if not self.mechanism.datagram:
            arrival = self._ends[far] = max(arrival, self._ends[far])
        self._at(arrival, what, data)

    def _arrive(self, data):
        if self.passing:
            with contextlib.suppress(BlockingIOError):  # what a sleeper does not read is lost when there is no room
                self._far_end.send(data)
            self._look()

    # ---- the bridge ----

    def _loop(self, what):
        return self._step(
            what,
            *self._functions,
            self.codec.state,
            self.words,
            self.control,
            *self._mails,
            1,
            self.now,
            *self._bridge_memory,
        )

    def _look(self, turn=None, what=TURN):
        """A turn of the bridge; one that was planned before the last is none."""
        if turn not in (None, self._turns[BRIDGE]) or self._postponed(BRIDGE, self._look):
            return
        if self._ended and what == TURN:
            return
        self._turns[BRIDGE] += 1
        again = self._loop(what)
        while data := self._sent():
            self._fly(0, data, self._device)
        self._at(max(again, self.now + LOOK), self._look, self._turns[BRIDGE])
        if not self._served and self.control[bridge_loop.PASSED]:  # a driver waits for a device
            self._served = True
            self._delay = 0.0
            self._follow()
            self._at(self.now + self.period, self._wake, self.now + self.period)
        if self._waits is not None:
            self._try(self._waits)

    def _sent(self):
        try:
            return self._far_end.recv(4096)
        except BlockingIOError:
            return b""

    def end_bridge(self, well=True):
        """The bridge ends, by a signal that it heeds or by one that it cannot."""
        self._ended = True
        for _ in range(bridge_loop.LAST_WORDS if well else 0):
            self._look(what=LAST_WORD)
            self.run(bridge_loop.LAST_STEP / SECOND)

    # ---- the device ----

    def _device(self, data=b"", turn=None):
        if turn not in (None, self._turns[DEVICE]) or self._postponed(DEVICE, self._device, data):
            return
        self._turns[DEVICE] += 1
        for frame in self.mechanism.serve(data, self.now):
            self._fly(1, frame, self._arrive)
        self.most_given = max(self.most_given, self.mechanism.given)
        self._at(max(self.mechanism.due, self.now + 1), self._device, b"", self._turns[DEVICE])

    # ---- the servo, as realtime/servo_loop has it, and its delay as nodes/driver follows it ----

    def _follow(self):
        """The link's delay counts as it is measured, with how late most writes are."""
        delay = float(self.words[shared_memory.DEVICE_FIRST + 10]) * 1e-9
        if abs(delay - self._delay) > 0.05 * self._delay + 2e-5:
            self._delay = delay
            self.settings["hardware"]["delay"] = delay
            self.settings["version"] += 1
        gain_check.counted(self.settings, self._delay + 0.0005)
        self._at(self.now + 50 * MS, self._follow)

    def _wake(self, deadline):
        if self._postponed(SERVO, self._wake, deadline):
            return
        late = (self.now - deadline) // self.period
        self.missed, deadline = self.missed + late, deadline + late * self.period
        self._woke, self._known = self.now, self._sample[hardware_interface.LATCHED]
        self._waits, self._give_up = deadline, deadline + self.period // (2 if self._lively else 16)
        self._try(deadline)
        if self._waits is not None:
            self._at(self._give_up, self._try, deadline)

    def _try(self, deadline):
        """The tick, if its sample is there or has been waited for long enough."""
        if self._waits != deadline or self._postponed(SERVO, self._try, deadline):
            return
        fresh = self._read(self.words, deadline, 0, self._sample)
        if not fresh and self.now < self._give_up:
            return
        self._waits, self._lively = None, fresh == 1 or self._sample[hardware_interface.LATCHED] > self._known
        self._work(deadline, fresh)
        written = self.now + COMPUTE
        self._at(written, self._written, written, deadline + self.period)
        self._row["write_delay"] = (written - deadline) * 1e-9
        self._at(deadline + self.period, self._wake, deadline + self.period)

    def _work(self, deadline, fresh):
        row, sample = self._row, self._sample
        row["tick"], row["deadline"], row["missed"], row["command"] = self._tick, deadline, self.missed, self.command
        row["lateness"], row["latched"] = (self._woke - deadline) * 1e-9, sample[hardware_interface.LATCHED]
        row["stamp_error"] = sample[hardware_interface.STAMP_ERROR]
        row["counts"] = sample[hardware_interface.COUNTS : hardware_interface.COUNTS + 3]
        row["device_status"] = int(sample[hardware_interface.STATUS]) | fresh
        tick(self.settings, self.memory, row)
        self._tick += 1
        self.rows.append(row.tobytes())

    def _written(self, written, deadline):
        engaged = int(self.state == enable_state.ENGAGED)
        self._write(self.words, written, deadline, self.period, engaged, self._row["motor"][0].copy())
        self._look()

    def end_servo(self, well=True):
        """The driver ends; well: its last write is zero."""
        if well:
            self._write(self.words, self.now, self.now + self.period, self.period, 0, np.zeros(3))
            self._look()
        self.sleep(SERVO)

    # ---- what a person does ----

    def enable(self):
        """Forces may act, once the device answers."""
        self.until(lambda: self.rows)
        self.command |= enable_state.ENABLE
        self.until(lambda: self.state in (enable_state.ENGAGED, enable_state.FAULT))

    def reset(self):
        self.command += enable_state.RESET

    state = property(lambda self: int(self._row["state"][0]))

    fault = property(lambda self: int(self._row["fault"][0]))
