# SPDX-License-Identifier: Apache-2.0
"""A reference device and the bridge's loop on a line, and a page that is read as the servo reads it."""

import contextlib
import os
import subprocess
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

from haptic_device import jit
from haptic_device.device.simulated_device import TRUTH
from haptic_device.link import bridge_loop, clock_fit, codec, line, open_serial, open_state, open_udp
from haptic_device.os_errors import in_words
from haptic_device.process import ending_with_us
from haptic_device.realtime import atomic, clock, scheduling, shared_memory
from haptic_device.realtime.hardware_interface import SharedMemoryInterface
from haptic_device.realtime.seqlock import SeqLock
from haptic_display.run import reference_device

BRIDGE, SERVO = 85, 80  # priorities, those of haptic_bridge and haptic_driver
WATCHDOG = 15_000_000  # [ns]
PATIENCE = 10.0  # [s]
LONGEST = 60.0  # [s] that a servo is driven
LOOK = 0.001  # [s]


class Rig:
    """The line; with options of the reference device. Raises ValueError where no device answers."""

    def __init__(self, transport: str, *options: str):
        with contextlib.ExitStack() as self._open:  # closes what is open, should the rest fail
            self._begin(transport, options)
            self._open = self._open.pop_all()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._open.close()

    def _begin(self, transport, options):
        jit.ensure_compiled("bridge")
        folder = Path(self._open.enter_context(tempfile.TemporaryDirectory(prefix="haptic_")))
        link = ("--udp", "0") if transport == "udp" else ("--pty", str(folder / "line"))
        where = self._start_device((*link, *options))
        if transport == "udp":
            own = open_udp.Options(port=int(where))
            self._codec, self._file = open_udp.codec(own, None), line.open_udp(own)
        else:
            own = open_serial.Options(port=where)
            self._codec, self._file = open_serial.codec(own, None), line.open_serial(own)
        self._open.callback(os.close, self._file)
        self._page(f"haptic_display.bench_{os.getpid()}")
        self._start_bridge()
        self._until_ready()

    def _start_device(self, words):
        """Starts it; returns where it is, and notes when its clock began, between two looks at ours."""
        command = ending_with_us([str(reference_device.compiled()), *words])
        before = time.monotonic_ns()
        device = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self._open.callback(device.communicate)
        self._open.callback(device.terminate)
        told = device.stdout.readline().split()
        if not told:
            raise ValueError("the reference device ended at once")
        self.began = (before + time.monotonic_ns()) // 2
        return told[1]

    def _page(self, name):
        page = shared_memory.SharedMemory(name, shared_memory.DEVICE)
        self._open.callback(page.close)
        self._words = page.words
        self._servo = SharedMemoryInterface(name, 1)
        self._open.callback(self._servo.close)
        self._open.callback(self._drop)

    def _drop(self):
        self._words = None  # a view that is left would keep the mapping

    def _start_bridge(self):
        self._control = np.zeros(bridge_loop.CONTROLS, np.int64)
        self._control[bridge_loop.WATCHDOG] = WATCHDOG
        self._control[bridge_loop.FD], self._control[bridge_loop.DATAGRAM] = self._file, self._codec.datagram
        thread = threading.Thread(target=self._serve, args=(bridge_loop.compiled(),))
        thread.start()
        self._open.callback(thread.join)
        self._open.callback(self._control.__setitem__, bridge_loop.STOP, 1)

    def _serve(self, loop):
        scheduling.go_realtime("prefer", BRIDGE)
        target = SeqLock(np.dtype([("place", "f8", (3,))]))
        said = self._codec
        loop(said.encode, said.decode, said.state, self._words, self._control, SeqLock(TRUTH).words, target.words, 1)

    def _until_ready(self):
        end = time.monotonic() + PATIENCE
        while not (self._codec.state[codec.READY] and self._servo.present()):
            if time.monotonic() > end:
                raise ValueError(f"the reference device did not answer within {PATIENCE:g} s")
            time.sleep(LOOK)

    def waits(self, rate: float, count: int) -> np.ndarray:
        """For each of `count` deadlines how long after it the sample was in hand [ns], −1: not within half a period."""
        found = np.zeros(count, np.int64)
        self._start_servo(rate, found, np.zeros(1, np.int64)).join()
        return found

    @contextlib.contextmanager
    def driven(self, rate: float):
        """Meanwhile a servo of this rate runs."""
        ending = np.zeros(1, np.int64)
        thread = self._start_servo(rate, np.zeros(int(LONGEST * rate), np.int64), ending)
        try:
            yield
        finally:
            ending[0] = 1
            thread.join()

    def _start_servo(self, rate, found, ending):
        servo, period = self._servo, round(1e9 / rate)

        def serve():
            scheduling.go_realtime("prefer", SERVO)
            _take(servo.read, servo.write, servo.memory, found, period, ending)

        _take(servo.read, servo.write, servo.memory, np.zeros(2, np.int64), period, ending)  # compiles it
        thread = threading.Thread(target=serve)
        thread.start()
        return thread

    def clock(self) -> tuple[int, int, int]:
        """A time [ns], the device's time then as it is estimated, and how many steps of its clock were found."""
        state = self._codec.state
        while True:  # the loop may be writing
            now, seen = time.monotonic_ns(), state.copy()
            if np.array_equal(seen[open_state.FIT : open_state.ROUNDS], state[open_state.FIT : open_state.ROUNDS]):
                break
        fit = seen[open_state.FIT : open_state.ROUNDS]
        return now, int(clock_fit.to_device(fit, now)), int(fit[clock_fit.STEPS])


@jit.kernel
def _take(read, write, memory, found, period, ending):
    """The servo's way, until ending[0]: sleeps to the deadline, reads, writes; found: see `Rig.waits`."""
    scratch, sample, motor = np.zeros(2, np.int64), np.zeros(8), np.zeros(3)
    deadline = clock.now_ns(scratch) + period
    write(memory, deadline - period, deadline, period, 0, motor)
    for k in range(found.size):
        if atomic.load(ending, 0) != 0:
            break
        clock.sleep_until(deadline, scratch)
        fresh = read(memory, deadline, deadline + period // 2, sample)
        now = clock.now_ns(scratch)
        found[k] = now - deadline if fresh > 0 else -1
        deadline += period * ((now - deadline) // period + 1)
        write(memory, now, deadline, period, 0, motor)


class Pair:
    """The two of link_pair.c, compiled for as long as this is open. Raises ValueError if there is no compiler."""

    def __init__(self):
        self._folder = tempfile.TemporaryDirectory(prefix="haptic_")
        self._program = Path(self._folder.name) / "link_pair"
        sources = reference_device.sources()
        files = (Path(__file__).with_name("link_pair.c"), sources / "haptic_frame.c")
        command = ["cc", "-std=c99", "-O2", f"-I{sources}", "-o", self._program, *files]
        try:
            subprocess.run(list(map(str, command)), check=True)
        except (OSError, subprocess.SubprocessError) as error:
            self._folder.cleanup()
            raise ValueError(f"link_pair.c cannot be compiled: {in_words(error)}") from None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._folder.cleanup()

    def waits(self, transport: str, rate: float, count: int) -> np.ndarray:
        """As `Rig.waits`."""
        command = [self._program, transport, f"{rate:g}", count]
        said = subprocess.run(ending_with_us(command), check=True, stdout=subprocess.PIPE, text=True)
        return np.array(said.stdout.split(), np.int64)
