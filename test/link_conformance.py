# SPDX-License-Identifier: Apache-2.0
"""What every link owes the servo (realtime/hardware_interface).

A test module of a link gives `check` a link and a device behind it.

The device may be a model or hardware with its motor's force going nowhere: it is given small motor values only.
"""

import numba
import numpy as np
from waiting import until

from haptic_device.realtime import clock, hardware_interface

PERIOD = 1_000_000  # [ns]
LIMIT = 60_000_000_000  # [ns] for whatever is waited for; the kernels may have to be compiled first
SHORTEST = 10 * PERIOD  # no watchdog of a device may be shorter
SMALL = 0.01  # motor units


def check(device_link):
    """Raises AssertionError with what a link does otherwise than it should; the link is closed afterwards."""
    try:
        for one in (
            *(has_its_signatures, answers, latches_at_deadlines, gives_up, counts_whole_steps),
            *(changes_counts_with_their_time_only, cuts_the_motor),
        ):
            one(device_link)
    finally:
        device_link.close()


def has_its_signatures(device_link):
    assert isinstance(device_link.memory, np.ndarray) and device_link.memory.dtype == np.int64
    for function, signature in (
        (device_link.read, hardware_interface.READ),
        (device_link.write, hardware_interface.WRITE),
    ):
        assert tuple(signature.args) in function.signatures, (
            "not compiled with the signature of realtime/hardware_interface"
        )
        assert isinstance(function, numba.core.dispatcher.Dispatcher)


def answers(device_link):
    until(device_link.present, "the device is present")


def drive(device_link, ticks, motor=0.0):
    """Runs ticks as the servo would, but patiently; returns [(deadline, fresh, sample, time of the write before)]."""
    scratch, seen = clock.scratch(), []
    written = int(clock.now_ns(scratch))
    deadline = written + PERIOD
    device_link.write(device_link.memory, written, deadline, PERIOD, 0, np.zeros(3))
    for _ in range(ticks):
        clock.sleep_until(deadline, scratch)
        sample = np.zeros(hardware_interface.SAMPLE)
        fresh = device_link.read(device_link.memory, deadline, deadline + LIMIT, sample)
        seen.append((deadline, fresh, sample, written))
        written = int(clock.now_ns(scratch))
        deadline = max(deadline + PERIOD, written + PERIOD)
        device_link.write(device_link.memory, written, deadline, PERIOD, 1, np.array([motor, 0.0, 0.0]))
    return seen


def is_cut(sample):
    return bool(int(sample[hardware_interface.STATUS]) & 2)


def latches_at_deadlines(device_link):
    """Whoever waits gets the sample of his deadline; a motor is cut by silence only, judged by the latched times."""
    driven, latest = False, 0.0
    for deadline, fresh, sample, written in drive(device_link, 50, SMALL):
        assert fresh == 1, "no sample of a deadline that had passed"
        assert np.isfinite(sample).all()
        assert sample[hardware_interface.LATCHED] >= deadline, "an old sample was called fresh"
        assert sample[hardware_interface.LATCHED] >= latest, "time ran backwards"
        silent = sample[hardware_interface.LATCHED] - written
        assert not (driven and is_cut(sample)) or silent > SHORTEST, f"cut {silent} ns after a write"
        driven, latest = driven or not is_cut(sample), sample[hardware_interface.LATCHED]
    assert driven, "the motor stayed cut though the servo wrote"


def gives_up(device_link):
    """A deadline that is an hour ahead is not waited for."""
    scratch, sample = clock.scratch(), np.zeros(hardware_interface.SAMPLE)
    far = int(clock.now_ns(scratch)) + 3600 * 1_000_000_000
    for patience in (0, 2 * PERIOD):
        give_up = int(clock.now_ns(scratch)) + patience
        assert device_link.read(device_link.memory, far, give_up, sample) == 0
        assert int(clock.now_ns(scratch)) < far, "waited for the deadline"
        assert sample[hardware_interface.LATCHED] < far


def counts_whole_steps(device_link):
    sample = drive(device_link, 5)[-1][2]
    counts = sample[hardware_interface.COUNTS : hardware_interface.COUNTS + 3]
    assert np.array_equal(counts, np.round(counts))


def changes_counts_with_their_time_only(device_link):
    """However often it is read: a way without a time could be booked nowhere."""
    before, sample = drive(device_link, 5, SMALL)[-1][2], np.zeros(hardware_interface.SAMPLE)
    counts = slice(hardware_interface.COUNTS, hardware_interface.COUNTS + 3)

    def newer():
        nonlocal before
        device_link.read(device_link.memory, 0, 0, sample)
        earlier, before = before, sample.copy()
        if sample[hardware_interface.LATCHED] != earlier[hardware_interface.LATCHED]:
            return True
        assert np.array_equal(sample[counts], earlier[counts]), (
            "counts changed and the time they were latched at did not"
        )
        return False

    for _ in range(10):
        until(newer, "a newer sample", look=lambda: None)


def cuts_the_motor(device_link):
    """Silent for longer than the device's watchdog, the servo is told that the motor was cut; by writing it returns."""
    drive(device_link, 5, SMALL)
    sample = np.zeros(hardware_interface.SAMPLE)

    def cut():
        device_link.read(device_link.memory, 0, 0, sample)
        return is_cut(sample)

    until(cut, "the device cuts the motor of a silent servo")
    assert not all(is_cut(sample) for _, _, sample, _ in drive(device_link, 20)), "the servo was not taken back"
