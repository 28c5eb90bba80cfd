# SPDX-License-Identifier: Apache-2.0
"""The servo in its thread, on a page with a plant behind it, and on a device that says nothing."""

import signal
import threading
import time
import uuid

import numpy as np
import pytest
from waiting import until

from haptic_device.config.description import load_device
from haptic_device.config.drives import drives_at
from haptic_device.config.parameter_types import defaults
from haptic_device.config.parameters import DRIVER
from haptic_device.control import controller_config, enable_state, faults
from haptic_device.device import loopback_config, operator_hand, plant, simulated_device
from haptic_device.jit import kernel
from haptic_device.realtime import clock, hardware_interface, scheduling, servo_loop, shared_memory
from haptic_device.realtime.hardware_interface import SharedMemoryInterface
from haptic_device.realtime.null_device import NullDevice
from haptic_device.realtime.seqlock import SeqLock
from haptic_device.realtime.servo_thread import ServoThread

WATCHDOG = 15_000_000  # ns
HOME = (0.05, 0.05, 0.75)
NO_MOTOR = [0.0, 0.0, 0.0]


def settings(device="desktop", **given):
    """Of a servo at 1 kHz, which bears a thread that stands still."""
    patient = {"servo.rate": 1000.0, "fault.silence": 1.0}
    values = defaults(DRIVER) | patient | {name.replace("__", "."): value for name, value in given.items()}
    return controller_config.settings_from(load_device(device), values)


class Served:
    """A plant behind a page, as haptic_loopback runs it; the hand holds on with nothing."""

    def __init__(self, name):
        self.page, self.truth = shared_memory.SharedMemory(name, shared_memory.DEVICE), SeqLock(simulated_device.TRUTH)
        self.control = np.zeros(simulated_device.CONTROLS, np.int64)
        self.plant = loopback_config.plant_of(load_device("desktop"))
        self.control[simulated_device.WATCHDOG] = WATCHDOG
        self.memory, self.motion = np.zeros(1, plant.PLANT_MEMORY), np.zeros(1, operator_hand.MOTION)
        self.memory["position"] = self.memory["target"] = (0.01, 0.0, 0.0)
        self.motion["count"], self.motion["duration"] = 1, 1.0
        self.thread = threading.Thread(target=self._serve)
        self.thread.start()

    def _serve(self):
        truth = np.zeros(1, simulated_device.TRUTH)
        words, mail = self.page.words, self.truth.words
        simulated_device.serve(words, self.control, mail, 42, self.plant, self.memory, self.motion, truth)

    now = property(lambda self: self.truth.get()[0])  # the newest truth

    def stop(self):
        """Ends the plant's thread."""
        self.control[simulated_device.STOP] = 1
        self.thread.join(60.0)
        assert not self.thread.is_alive(), "the plant still serves"


@pytest.fixture
def name():
    name = f"haptic_display.test.{uuid.uuid4().hex}"
    yield name
    left = (shared_memory.FOLDER / name).exists()
    (shared_memory.FOLDER / name).unlink(missing_ok=True)
    assert not left


@pytest.fixture
def served(name):
    served = Served(name)
    yield served
    served.stop()
    served.page.close()


@pytest.fixture
def link(name):
    link = SharedMemoryInterface(name, 7)
    yield link
    link.close()


@pytest.fixture
def servo(link):
    """servo(link, settings, **how) makes one that has ended after the test."""
    made = []

    def make(at=link, record=None, **how):
        made.append(ServoThread(at, settings() if record is None else record, **{"realtime": "off", **how}))
        return made[-1]

    yield make
    for thread in made:
        thread.stop()


def ticks(thread, count):
    until(lambda: thread.row.get()[0].tick > count, f"{count} ticks")
    return thread.row.get()[0]


NONSENSE = [  # when it was written and its deadline, from now [ns]; period [ns]; motor
    (2**62, 0, 1_000_000, 0.0),
    (0, 60_000_000_000, 1_000_000, 0.5),  # the motor would be held for a minute, and no watchdog heard
    (-(2**62), 0, 1_000_000, 0.0),
    (0, 0, 0, 0.0),
    (0, 0, 1_000_000, np.nan),
]


def test_a_write_of_nonsense_moves_neither_the_plant_nor_its_clock(served, link):
    scratch = clock.scratch()
    until(link.present, "the device is present")
    for count, (written, deadline, period, motor) in enumerate(NONSENSE, 1):
        now = int(clock.now_ns(scratch))
        link.write(link.memory, now + written, now + deadline, period, 1, np.array([motor, 0.5, 0.0]))
        until(lambda count=count: served.control[simulated_device.REFUSED] == count, "the write is refused")
    before = float(served.now.time)
    until(lambda: served.now.time > before + 0.02, "20 ms of the plant")
    truth = served.now
    assert truth.time <= clock.now_ns(scratch) * 1e-9
    assert truth.motor_force.tolist() == NO_MOTOR and np.isfinite(truth.position).all()


def test_a_silent_servos_motor_is_cut_when_the_watchdog_is_over_by_the_plants_own_time(served, link):
    scratch, last, seen = clock.scratch(), [0], []

    def pushes():
        last[0] = int(clock.now_ns(scratch))
        link.write(link.memory, last[0], last[0] + 1_000_000, 1_000_000, 1, np.array([0.5, 0.0, 0.0]))
        return served.now.motor_force[0] != 0.0

    until(link.present, "the device is present")
    until(pushes, "the motor pushes")
    cut = (last[0] + WATCHDOG) * 1e-9

    def past():
        seen.append(served.now.copy())
        return seen[-1].time > cut

    until(past, "the plant is past the cut")
    for truth in seen:
        assert (truth.motor_force[0] != 0.0) == (truth.time <= cut) or truth.time <= last[0] * 1e-9
    assert not served.now.driven and served.control[simulated_device.TRIPS] >= 1
    until(pushes, "the motor pushes again")
    served.stop()
    truth = served.now
    assert truth.motor_force.tolist() == NO_MOTOR and not truth.driven
    assert served.memory["motor_force"].tolist() == [NO_MOTOR]


def test_the_servo_runs_on_the_page_takes_its_home_and_leaves_the_motor_at_zero(served, servo):
    thread = servo(home=HOME)
    thread.start()
    assert ticks(thread, 20).position.tolist() == pytest.approx(HOME, abs=2e-5) and thread.running
    rows = thread.ring.take(1000)
    assert np.diff(rows["tick"]).tolist() == [1.0] * (len(rows) - 1)
    thread.stop()
    block = np.zeros(shared_memory.SERVO_WORDS, np.int64)
    shared_memory.read_servo(served.page.words, block)
    assert not thread.running and block[4:].tolist() == [0, 0, 0, 0]
    thread.link.close()
    until(lambda: not served.now.driven, "the plant is free")


@pytest.mark.parametrize("device", ["haply_2diy_gen2", "serial_2r", "hapkit"])
def test_a_linkage_that_starts_has_its_handle_at_home_whatever_its_encoders_count(served, servo, device):
    """The counts are those of another plant, which stands still."""
    described = load_device(device)
    home = [0.02, 0.06 * (len(described.joints) - 1), 0.0]
    thread = servo(record=settings(device), home=drives_at(described, home))
    thread.start()
    row = ticks(thread, 20)
    assert row.counts[0] != 0.0 and row.position.tolist() == pytest.approx(home, abs=1e-9)
    assert row.joint.tolist() == pytest.approx([*drives_at(described, home)[:2], 0.0], abs=1e-9)


@kernel(hardware_interface.READ)
def read_nothing(memory, deadline, give_up, sample):
    memory[0] += 1
    return 0


def test_before_the_first_sample_there_is_no_tick_and_the_servo_can_be_stopped(servo):
    silent = NullDevice()
    silent.read = read_nothing
    thread = servo(silent, home=HOME)
    thread.start()
    until(lambda: silent.memory[0] >= 10, "10 reads")
    assert not thread.running
    thread.stop()
    assert thread.row.get()[0].tick == 0 and thread.row.get()[0].deadline == 0.0


def test_signals_neither_repeat_a_tick_nor_take_missed_ones_back(servo):
    before = signal.signal(signal.SIGUSR1, lambda number, frame: None)
    try:
        thread, rows = servo(NullDevice()), []
        thread.start()
        [running] = [one for one in threading.enumerate() if one.name == "servo"]

        def disturb():
            signal.pthread_kill(running.ident, signal.SIGUSR1)
            time.sleep(0.0003)
            rows.append(thread.ring.take(1000))

        until(lambda: sum(map(len, rows)) >= 500, "500 ticks", disturb)
    finally:
        signal.signal(signal.SIGUSR1, before)
    rows = np.concatenate(rows)
    assert np.diff(rows["deadline"]).min() > 0 and np.diff(rows["missed"]).min() >= 0


def test_only_who_attends_keeps_an_enabled_servo_from_being_unattended_and_a_servo_not_enabled_never_is(servo):
    thread = servo(NullDevice(), settings(fault__unattended=5.0))
    thread.control[servo_loop.ATTENDED] = 1  # long ago
    thread.start()
    ticks(thread, 5)
    command = thread.order(set_flags=enable_state.ENABLE)
    until(lambda: int(thread.row.get()[0].command) & enable_state.ENABLE, "a tick that is enabled")
    assert int(thread.row.get()[0].command) == command

    thread = servo(NullDevice(), settings(fault__unattended=0.2))
    thread.order(set_flags=enable_state.ENABLE)
    thread.start()

    def unattended():
        thread.order(clear_flags=enable_state.CLUTCH)  # as a change of parameters does, again and again
        return thread.row.get()[0].fault == faults.UNATTENDED

    until(unattended, "the fault unattended")


@pytest.mark.parametrize(
    ("function", "error", "sentence"),
    [
        ("go_realtime", MemoryError("no room for the servo's thread"), "no room for the servo's thread"),
        ("os.sched_setscheduler", PermissionError(), "realtime is require: no SCHED_FIFO 80: set `rtprio 98`"),
    ],
)
def test_a_servo_that_cannot_begin_says_why_and_is_not_waited_for(servo, monkeypatch, function, error, sentence):
    def fails(*arguments):
        raise error

    monkeypatch.setattr(f"{scheduling.__name__}.{function}", fails)
    thread = servo(realtime="require")
    with pytest.raises(type(error), match=sentence):
        thread.start()
    assert not thread.running


def test_a_reset_takes_the_wish_to_be_enabled_back(servo):
    thread = servo()
    thread.order(set_flags=enable_state.ENABLE | enable_state.ESTOP)
    thread.reset()
    assert thread.command == enable_state.RESET
