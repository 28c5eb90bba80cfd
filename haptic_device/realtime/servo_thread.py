# SPDX-License-Identifier: Apache-2.0
"""The servo in its thread, and the memory through which everybody else meets it."""

import threading
import time

import numpy as np

from haptic_device.control import contact_model, enable_state, faults
from haptic_device.control.exchange_samples import COUPLING_GAINS
from haptic_device.control.records import AXES, SETTINGS, STATE, TICK, TRACE_ROW
from haptic_device.realtime import clock, hardware_interface, scheduling, servo_loop, tick_replay
from haptic_device.realtime.seqlock import Ring, SeqLock

PRIORITY = 80
RING_ROWS = 16384  # 1.6 s at 10 kHz
LOOK_UP = 0.01  # [s] between looks for the device
SECOND = 1_000_000_000
SNAPSHOT_ATTEMPTS = 10


class ServoThread:
    """Runs the servo against a link from start() to stop(), which returns with the motor at zero.

    settings: SETTINGS record to begin with. The device's counts at the start are taken as `home`, of each drive [m |
    rad], where that is given. kept: what an earlier one left behind; its fault stays latched, and its motors warm.

    set(), order() and reset() may be called by any thread.
    """

    def __init__(self, device_link, settings, home=None, realtime="prefer", kept=None):
        self.link, self._home, self._wish = device_link, home, realtime
        self.settings, self.gains = SeqLock(SETTINGS), SeqLock(COUPLING_GAINS)
        self.tool, self.row, self.ring = SeqLock(servo_loop.TOOL), SeqLock(TRACE_ROW), Ring(TRACE_ROW, RING_ROWS)
        self.near = SeqLock(contact_model.SET)
        self.control = np.zeros(servo_loop.CONTROLS, np.int64)
        self._state = np.zeros(1, STATE)
        for name, value in (kept or {}).items():
            self._state["fault"][name] = value
        self.realtime, self._refused, self._ready = "", None, threading.Event()
        self._writing = threading.Lock()  # one writer at a time; ticks take no lock
        self._resets, self._zero = 0, settings["hardware"]["zero"].copy()
        self.set(settings)
        self.snapshot()  # what it calls is compiled now: that holds the interpreter, and would disturb an exchange
        # compiling takes seconds and a core
        self._run_ticks = servo_loop.realtime()  # and not by the thread, which is urgent
        self._thread = threading.Thread(target=self._run, name="servo")

    def start(self):
        """Starts it; whatever keeps it from beginning is raised here, PermissionError if `require` cannot be had."""
        self._thread.start()
        self._ready.wait()
        if self._refused is not None:
            raise self._refused

    def stop(self):
        self.control[servo_loop.STOP] = 1
        if self._thread.is_alive():
            self._thread.join()

    def set(self, settings):
        """These settings from the next tick on."""
        with self._writing:
            settings["hardware"]["zero"] = self._zero
            self.settings.put(settings)

    @property
    def kept(self):
        """Latched fault and thermal load of the motors when it has stopped; an e-stop that no tick has taken is one."""
        asked = faults.ESTOP if self.command & enable_state.ESTOP else faults.NONE
        latched = int(self._state["fault"]["code"][0]) or asked
        return {"code": latched, "thermal_load": self._state["fault"]["thermal_load"][0].copy()}

    @property
    def running(self):
        return bool(self.control[servo_loop.RUNNING])

    @property
    def command(self):
        return int(self.control[servo_loop.COMMAND])

    def order(self, set_flags=0, clear_flags=0):
        """Changes flags of the command word (control/enable_state); returns the word. Who enables is there."""
        if set_flags & enable_state.ENABLE:
            self.attend()
        with self._writing:
            self.control[servo_loop.COMMAND] = (self.command | set_flags) & ~clear_flags
            return self.command

    def attend(self):
        """Says that the node is served and hears an e-stop: the servo goes on alone for fault.unattended only."""
        self.control[servo_loop.ATTENDED] = time.monotonic_ns()

    def reset(self):
        """Clears the latched fault, and what commands the handle: a new enable is needed."""
        with self._writing:
            self._resets += 1
            self.control[servo_loop.COMMAND] = self._resets * enable_state.RESET + (self.command & enable_state.CLUTCH)

    def snapshot(self):
        """SNAPSHOT record of a tick just done, while the servo runs on; None if none could be had between two.

        The servo touches its memory from a deadline on until it has published that tick's row, and not before the next
        deadline: nothing is asked of the servo, and it never waits.
        """
        row, state = np.zeros(1, TRACE_ROW), np.zeros(1, STATE)
        for _ in range(SNAPSHOT_ATTEMPTS):
            settings = self.settings.get()[0]
            self.row.read(row)
            state.view(np.int64)[:] = self._state.view(np.int64)  # field by field it would take longer than a tick
            # else the servo may have begun the next tick while it was copied
            whole = time.monotonic_ns() < int(row["deadline"][0]) + round(settings.period * SECOND)
            if whole and row["parameter_version"][0] == settings.version:
                return tick_replay.snapshot_of(row["tick"][0], settings, state[0])
        return None

    def _run(self):
        try:
            self.realtime = scheduling.go_realtime(self._wish, PRIORITY)
        except Exception as error:
            self._refused = error
            return
        finally:
            self._ready.set()
        # without a device there is nothing to hold, and no deadline
        while not (self.link.present() and self._take_home()):
            if self.control[servo_loop.STOP]:
                return
            threading.Event().wait(LOOK_UP)
        settings = self.settings.get().view(np.ndarray).view(SETTINGS)
        link = self.link.memory, self.link.read, self.link.write
        mails = servo_loop.Mails(self.settings.words, self.tool.words, self.near.words, self.row.words)
        tick, tool, near = (np.zeros(1, kind) for kind in (TICK, servo_loop.TOOL, contact_model.SET))
        records = servo_loop.Records(settings, self._state, tick, self.ring.rows, tool, near)
        self._run_ticks(link, self.control, self.ring.words, mails, records)

    def _take_home(self):
        """Makes the present position the home position; False where the device has no sample that says what it is."""
        if self._home is None:
            return True
        sample, scratch = np.zeros(hardware_interface.SAMPLE), clock.scratch()
        if not self.link.read(self.link.memory, 0, clock.now_ns(scratch) + SECOND // 10, sample):
            return False
        with self._writing:
            settings = self.settings.get().view(np.ndarray).view(SETTINGS)
            counts = sample[hardware_interface.COUNTS : hardware_interface.COUNTS + AXES]
            self._zero = counts * settings["hardware"]["position_per_count"] - np.array(self._home)
            settings["hardware"]["zero"] = self._zero
            self.settings.put(settings)
        return True
