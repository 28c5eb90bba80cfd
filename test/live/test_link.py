# SPDX-License-Identifier: Apache-2.0
"""The page as a link, with a plant behind it in a thread of its own; and the loopback's motor watchdog."""

import signal
import threading
import time
import uuid

import numpy as np
import pytest
from waiting import until

from haptic_device.control import enable_state, faults, records
from haptic_device.description import load_device
from haptic_device.device import loopback_config, operator_hand, plant, simulated_device
from haptic_device.jit import kernel
from haptic_device.realtime import clock, hardware_interface, scheduling, servo_loop, shared_memory
from haptic_device.realtime.hardware_interface import SharedMemoryInterface
from haptic_device.realtime.null_device import NullDevice
from haptic_device.realtime.seqlock import SeqLock
from haptic_device.realtime.servo_thread import ServoThread
from haptic_sim.supervision import conformance, lateness

WATCHDOG = 15_000_000  # ns


class Served:
    """A plant behind a page, as haptic_loopback runs it; the hand holds on with nothing."""

    def __init__(self, name, position=(0.01, 0.0, 0.0)):
        self.page, self.truth = shared_memory.SharedMemory(name, shared_memory.DEVICE), SeqLock(simulated_device.TRUTH)
        self.control, self.plant = (
            np.zeros(simulated_device.CONTROLS, np.int64),
            loopback_config.plant_of(load_device("desktop")),
        )
        self.control[simulated_device.WATCHDOG] = WATCHDOG
        self.memory, self.motion = np.zeros(1, plant.PLANT_MEMORY), np.zeros(1, operator_hand.MOTION)
        self.memory["position"] = self.memory["target"] = position
        self.motion["count"], self.motion["duration"] = 1, 1.0
        self.thread = threading.Thread(target=self._serve)
        self.thread.start()

    def _serve(self):
        truth = np.zeros(1, simulated_device.TRUTH)
        words, mail = self.page.words, self.truth.words
        simulated_device.serve(words, self.control, mail, 42, self.plant, self.memory, self.motion, truth)

    def close(self):
        self.stop()
        self.page.close()

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
    served.close()


@pytest.fixture
def device(name):
    """The page's other side, with nothing behind it."""
    device = shared_memory.SharedMemory(name, shared_memory.DEVICE)
    yield device
    device.close()


@pytest.fixture
def device_link(name):
    device_link = SharedMemoryInterface(name, 7)
    yield device_link
    device_link.close()


@pytest.fixture
def servo_thread(device_link):
    """servo_thread(**how) makes a servo on the page or another link, which has ended after the test."""
    made = []

    def make(at=device_link, record=None, **how):
        begin = settings() if record is None else record
        made.append(ServoThread(at, begin, **{"realtime": "off", **how}))
        return made[-1]

    yield make
    for thread in made:
        thread.stop()


def test_the_page_keeps_every_promise_of_a_link(served, device_link):
    results = conformance.check_all(device_link)
    assert [result.name for result in results] == list(conformance.CHECKS)
    kept = [result for result in results if result.name != conformance.IN_TIME]  # that one judges this machine too
    assert [result.sentence for result in kept if not result.passed] == []


def test_a_link_whose_counts_run_ahead_of_their_time_does_not_conform(served, device_link):
    conformance.answers(device_link)
    conformance.changes_counts_with_their_time_only(device_link)
    read, turn = device_link.read, 0.0

    def restless(memory, deadline, give_up, sample):
        nonlocal turn
        turn += 1.0
        fresh = read(memory, deadline, give_up, sample)
        sample[hardware_interface.COUNTS] += turn
        return fresh

    device_link.read = restless
    with pytest.raises(conformance.Violation, match="counts changed and the time they were latched at did not"):
        conformance.changes_counts_with_their_time_only(device_link)


def test_without_a_device_there_is_nobody_and_reading_gives_up(device_link):
    assert not device_link.present()
    sample, scratch = np.zeros(hardware_interface.SAMPLE), clock.scratch()
    assert device_link.read(device_link.memory, 1, int(clock.now_ns(scratch)) + 100_000, sample) == 0


def test_a_device_that_died_in_the_middle_of_a_write_leaves_the_last_sample_as_it_was(device, device_link):
    block = np.zeros(shared_memory.DEVICE_WORDS, np.int64)
    shared_memory.write_device(
        device.words, block, 1, 1000, 0, 1000, np.array([11.0, -12.0, 13.0]), np.array([0.5, 0.25, 0.0]), 0
    )
    sample = np.zeros(hardware_interface.SAMPLE)
    assert device_link.read(device_link.memory, 1000, 0, sample) == 1
    kept = sample.copy()
    assert kept.tolist() == [1000.0, 0.0, 11.0, -12.0, 13.0, 0.5, 0.25, 0.0]
    device.words[shared_memory.DEVICE_LOCK] |= 1
    device.words[shared_memory.DEVICE_FIRST : shared_memory.DEVICE_FIRST + shared_memory.DEVICE_WORDS] = 2**60
    assert device_link.read(device_link.memory, 2000, 0, sample) == 0
    assert sample.tolist() == kept.tolist()


def test_a_sample_from_the_future_is_not_believed(device, device_link):
    block, sample, scratch = (
        np.zeros(shared_memory.DEVICE_WORDS, np.int64),
        np.zeros(hardware_interface.SAMPLE),
        clock.scratch(),
    )
    for ahead, believed in ((hardware_interface.AHEAD, 1), (hardware_interface.AHEAD + 60_000_000_000, 0), (2**62, 0)):
        now = int(clock.now_ns(scratch))
        counts = np.array([float(believed), 0.0, 0.0])
        shared_memory.write_device(device.words, block, 1, now + ahead, 0, 1000, counts, np.zeros(3), 0)
        assert device_link.read(device_link.memory, now, now, sample) == believed
        assert sample[hardware_interface.COUNTS] == 1.0


NONSENSE = [
    (2**62, 0, 1_000_000, 0.0),
    (0, 2**62, 1_000_000, 0.0),
    (0, 60_000_000_000, 1_000_000, 0.5),  # the motor would be held for a minute, and no watchdog heard
    (-(2**62), 0, 1_000_000, 0.0),
    (0, 0, 0, 0.0),
    (0, 0, 2**62, 0.0),
    (0, 0, 1_000_000, np.nan),
]


@pytest.mark.parametrize("written, deadline, period, motor", NONSENSE)
def test_a_write_of_nonsense_moves_neither_the_plant_nor_its_clock(
    served, device_link, written, deadline, period, motor
):
    scratch = clock.scratch()
    until(device_link.present, "the device is present")
    now = int(clock.now_ns(scratch))
    device_link.write(device_link.memory, now + written, now + deadline, period, 1, np.array([motor, 0.5, 0.0]))
    until(lambda: served.control[simulated_device.REFUSED] == 1, "the write is refused")
    before = float(served.truth.get()[0].time)
    until(lambda: served.truth.get()[0].time > before + 0.02, "20 ms of the plant")
    truth = served.truth.get()[0]
    assert truth.time <= clock.now_ns(scratch) * 1e-9
    assert truth.motor_force.tolist() == [0.0, 0.0, 0.0] and np.isfinite(truth.position).all()


def test_what_the_servo_writes_reaches_the_device_word_by_word(device, device_link):
    device_link.write(device_link.memory, 1000, 2000, 250, 1, np.array([0.5, -1.5, 0.25]))
    block = np.zeros(shared_memory.SERVO_WORDS, np.int64)
    assert shared_memory.read_servo(device.words, block) > 0
    assert block[:5].tolist() == [7, 1000, 2000, 250, 1]
    assert block[5:].view(np.float64).tolist() == [0.5, -1.5, 0.25]


def press(device_link, served):
    """Writes until the plant's motor pushes; time of the last write and the deadline it announced [ns]."""
    scratch, last = clock.scratch(), []

    def pushed():
        written = int(clock.now_ns(scratch))
        last[:] = written, written + 1_000_000
        device_link.write(device_link.memory, *last, 1_000_000, 1, np.array([0.5, 0.0, 0.0]))
        return served.truth.get()[0].motor_force[0] != 0.0

    until(device_link.present, "the device is present")
    until(pushed, "the motor pushes")
    return last


def test_a_silent_servos_motor_is_cut_when_the_watchdog_is_over_by_the_plants_own_time(served, device_link):
    seen = []
    written, _ = press(device_link, served)
    cut = (written + WATCHDOG) * 1e-9

    def past():
        seen.append(served.truth.get()[0].copy())
        return seen[-1].time > cut

    until(past, "the plant is past the cut")
    for truth in seen:
        pushes = truth.motor_force[0] != 0.0
        assert pushes == (truth.time <= cut) or truth.time <= written * 1e-9
    assert not served.truth.get()[0].driven and served.control[simulated_device.TRIPS] >= 1


def test_a_plant_that_stops_serving_has_its_motor_at_zero_and_says_so(served, device_link):
    press(device_link, served)
    served.stop()
    truth = served.truth.get()[0]
    assert truth.motor_force.tolist() == [0.0, 0.0, 0.0] and not truth.driven
    assert served.memory["motor_force"].tolist() == [[0.0, 0.0, 0.0]]


def test_a_device_that_returns_where_its_predecessor_died_takes_up_an_odd_lock(name):
    words = np.zeros(shared_memory.WORDS, np.int64)
    words[shared_memory.DEVICE_LOCK] = 5
    shared_memory.write_device(
        words, np.zeros(shared_memory.DEVICE_WORDS, np.int64), 1, 9, 0, 9, np.zeros(3), np.zeros(3), 0
    )
    assert words[shared_memory.DEVICE_LOCK] == 6


def settings():
    record = np.zeros(1, records.SETTINGS)
    record["period"], record["axes"], record["hardware"]["scale"], record["hardware"]["position_per_count"] = (
        0.001,
        3,
        1.0,
        5e-6,
    )
    record["hardware"]["motor_per_force"], record["hardware"]["motor_limit"], record["force"]["limit"] = 1.0, 10.0, 10.0
    record["hardware"]["position_low"], record["hardware"]["position_high"], record["hardware"]["velocity_limit"] = (
        -1.0,
        1.0,
        100.0,
    )
    record["cancellation"]["band"] = record["cancellation"]["stretch"] = record["passivity"]["cross"] = 1.0
    record["engage"]["time"], record["engage"]["force"], record["fault"]["silence"], record["fault"]["saturation"] = (
        0.1,
        1.0,
        5.0,
        1.0,
    )
    record["exchange"]["fade"] = 0.1
    return record


def test_the_servo_runs_on_the_page_takes_its_home_and_leaves_the_motor_at_zero(served, servo_thread):
    thread = servo_thread(home=(0.25, 0.5, 0.75))
    thread.start()
    until(lambda: thread.row.get()[0].tick > 20, "20 ticks")
    assert thread.running
    assert thread.row.get()[0].position.tolist() == pytest.approx([0.25, 0.5, 0.75], abs=2e-5)
    rows = thread.ring.take(1000)
    assert np.diff(rows["tick"]).tolist() == [1.0] * (len(rows) - 1)
    thread.stop()
    block = np.zeros(shared_memory.SERVO_WORDS, np.int64)
    shared_memory.read_servo(served.page.words, block)
    assert not thread.running and block[4:].tolist() == [0, 0, 0, 0]
    thread.link.close()
    until(lambda: not served.truth.get()[0].driven, "the plant is free")
    assert served.control[simulated_device.TRIPS] == 0


HOME = (0.25, 0.5, 0.75)


@kernel(hardware_interface.READ)
def read_later(memory, deadline, give_up, sample):
    if memory[0] > 0:
        memory[0] -= 1
        return 0
    sample[:] = 0.0
    sample[hardware_interface.LATCHED], sample[hardware_interface.COUNTS] = deadline, 6000.0
    return 1


class LateLink(NullDevice):
    """Always there, at 6000 counts of x, but without a sample in so many reads."""

    def __init__(self, without):
        super().__init__()
        self.memory[0], self.read = without, read_later


def test_a_device_that_has_no_sample_at_first_is_at_home_where_its_first_sample_is(servo_thread):
    thread = servo_thread(LateLink(without=3), home=HOME)
    thread.start()
    until(lambda: thread.row.get()[0].tick > 5, "5 ticks")
    assert thread.row.get()[0].counts.tolist() == [6000.0, 0.0, 0.0]
    assert thread.row.get()[0].position.tolist() == pytest.approx(HOME)


def test_without_a_sample_there_is_no_home_and_no_tick_and_the_servo_can_be_stopped(servo_thread):
    silent = LateLink(without=2**62)
    thread = servo_thread(silent, home=HOME)
    thread.start()
    until(lambda: silent.memory[0] <= 2**62 - 10, "10 reads")
    assert not thread.running
    thread.stop()
    assert thread.row.get()[0].tick == 0 and thread.row.get()[0].deadline == 0.0


def test_settings_that_are_put_while_the_home_is_taken_are_not_lost(servo_thread, monkeypatch):
    thread, newer, others = servo_thread(NullDevice(), home=HOME), settings(), []
    newer["version"], get = 7, thread.settings.get

    def put_meanwhile():
        known = get()
        if threading.current_thread().name == "servo" and not others:
            others.append(threading.Thread(target=thread.set, args=(newer,)))
            others[0].start()
            others[0].join(0.05)  # or longer: it may have to wait until the home is taken
        return known

    monkeypatch.setattr(thread.settings, "get", put_meanwhile)
    thread.start()
    until(lambda: thread.row.get()[0].deadline > 0, "a tick")
    others[0].join()
    until(lambda: thread.row.get()[0].parameter_version == 7, "the newer settings")
    assert thread.row.get()[0].position.tolist() == pytest.approx(HOME)


@pytest.mark.parametrize(("word", "bits"), [(-1, 190), (2**60 + 1, 0), (2**60 + 2, 2), (1, 0), (128, 128)])
def test_of_a_status_word_on_the_page_the_servo_takes_the_known_bits_beside_its_own(device, servo_thread, word, bits):
    block, scratch = np.zeros(shared_memory.DEVICE_WORDS, np.int64), clock.scratch()
    record, seen = settings(), set()
    record["fault"]["silence"] = 0.02
    thread = servo_thread(record=record)

    def write():
        latched = int(clock.now_ns(scratch)) + 10_000_000  # the servo's next ticks are of it
        shared_memory.write_device(device.words, block, 1, latched, word, latched, np.zeros(3), np.zeros(3), 0)

    def take():
        seen.update(thread.ring.take(1000)["device_status"].tolist())

    write()
    thread.start()
    until(lambda: take() or bits + faults.FRESH in seen, "a sample of its deadline", write)
    until(lambda: take() or bits in seen, "an older sample")
    assert seen == {bits, bits + faults.FRESH}
    until(lambda: thread.row.get()[0].fault, "a fault")
    assert faults.name_of(thread.row.get()[0].fault) == ("device_estop" if bits & faults.BUTTON else "device_silent")


def test_signals_neither_repeat_a_tick_nor_take_missed_ones_back(servo_thread):
    before = signal.signal(signal.SIGUSR1, lambda number, frame: None)
    try:
        thread, rows = servo_thread(NullDevice()), []
        thread.start()
        [servo] = [one for one in threading.enumerate() if one.name == "servo"]

        def disturb():
            signal.pthread_kill(servo.ident, signal.SIGUSR1)
            time.sleep(0.0003)
            rows.append(thread.ring.take(1000))

        until(lambda: sum(map(len, rows)) >= 500, "500 ticks", disturb)
    finally:
        signal.signal(signal.SIGUSR1, before)
    rows = np.concatenate(rows)
    assert np.diff(rows["deadline"]).min() > 0 and np.diff(rows["missed"]).min() >= 0


def test_snapshots_are_had_between_ticks_at_the_highest_rate_too(servo_thread):
    fast = settings()
    fast["period"] = 1e-4
    thread = servo_thread(NullDevice(), fast)
    thread.start()
    until(lambda: thread.row.get()[0].tick > 0, "a tick")
    found = []

    def look():
        if (snapshot := thread.snapshot()) is not None:
            found.append(snapshot["tick"][0])

    until(lambda: len(found) >= 50, "50 snapshots between ticks", look)
    assert np.all(np.diff(found) >= 0)


def test_only_who_attends_keeps_an_enabled_servo_from_being_unattended(servo_thread):
    alone = settings()
    alone["fault"]["unattended"] = 0.2
    thread = servo_thread(NullDevice(), alone)
    thread.order(set_flags=enable_state.ENABLE)
    thread.start()

    def unattended():
        thread.order(clear_flags=enable_state.CLUTCH)  # as a change of parameters does, again and again
        return thread.row.get()[0].fault == faults.UNATTENDED

    until(unattended, "the fault unattended")


def test_a_servo_that_nobody_attended_before_it_was_enabled_is_not_unattended_by_that(servo_thread):
    alone = settings()
    alone["fault"]["unattended"] = 5.0
    thread = servo_thread(NullDevice(), alone)
    thread.control[servo_loop.ATTENDED] = 1  # long ago
    thread.start()
    until(lambda: thread.row.get()[0].tick > 5, "5 ticks")
    command = thread.order(set_flags=enable_state.ENABLE)
    until(lambda: int(thread.row.get()[0].command) & enable_state.ENABLE, "a tick that is enabled")
    assert int(thread.row.get()[0].command) == command


@pytest.mark.parametrize("mail", ["settings", "tool"])
def test_a_record_whose_writer_does_not_end_is_not_taken_and_counted(served, servo_thread, mail):
    thread = servo_thread()
    thread.start()
    until(lambda: thread.row.get()[0].tick > 5, "5 ticks")
    words = getattr(thread, mail).words
    words[8:] = np.float64(np.nan).view(np.int64)
    words[0] |= 1
    until(lambda: thread.control[servo_loop.TORN] > 5, "5 torn records")
    row = thread.row.get()[0]
    assert np.isfinite(row.position).all() and np.isfinite(row.tool_position).all() and row.fault == 0


def test_a_servo_is_compiled_by_whoever_makes_it_and_not_by_its_urgent_thread(servo_thread, monkeypatch):
    by, realtime = [], servo_loop.realtime
    monkeypatch.setattr(servo_loop, "realtime", lambda: by.append(threading.current_thread().name) or realtime())
    thread = servo_thread()
    thread.start()
    thread.stop()
    assert by == [threading.main_thread().name]


def test_a_servo_without_a_device_waits_and_can_be_stopped(servo_thread):
    thread = servo_thread()
    thread.start()
    time.sleep(0.05)
    assert not thread.running
    thread.stop()
    assert thread.row.get()[0].tick == 0 and not thread.running


def test_a_reset_takes_the_wish_to_be_enabled_back(servo_thread):
    thread = servo_thread()
    thread.order(set_flags=enable_state.ENABLE | enable_state.ESTOP)
    thread.reset()
    assert thread.command == enable_state.RESET


def test_a_servo_that_cannot_begin_says_why_and_is_not_waited_for(servo_thread, monkeypatch):
    def fails(*arguments):
        raise MemoryError("no room for the servo's thread")

    monkeypatch.setattr(scheduling, "go_realtime", fails)
    thread = servo_thread()
    with pytest.raises(MemoryError, match="no room for the servo's thread"):
        thread.start()
    assert not thread.running


def test_realtime_that_is_required_but_not_permitted_is_a_sentence_and_no_servo(servo_thread, monkeypatch):
    def forbidden(*arguments):
        raise PermissionError

    monkeypatch.setattr(scheduling.os, "sched_setscheduler", forbidden)
    thread = servo_thread(realtime="require")
    with pytest.raises(PermissionError, match="realtime is require: no SCHED_FIFO 80: set `rtprio 98`"):
        thread.start()
    assert not thread.running


def test_the_servo_alone_ticks_at_whole_periods_and_counts_what_it_missed():
    late, rows = lateness.alone(1000.0, 0.3, "off")
    steps = np.diff(rows["deadline"])
    assert np.all(steps % 1_000_000 == 0)
    assert late.missed == np.sum(steps // 1_000_000 - 1)
    assert len(late.sorted_us) == len(rows) > 0 and late.sorted_us[0] >= 0.0
