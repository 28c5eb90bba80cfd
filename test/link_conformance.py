# SPDX-License-Identifier: Apache-2.0
"""What every link owes the servo (runtime/link); a test module of a link gives `check` a link and a device behind it.

The device may be a model or hardware with its motor's force going nowhere: it is given small motor values only.
"""

import time

import numba
import numpy as np

from haptic_device.runtime import clock, link

PERIOD = 1_000_000  # [ns]
PATIENCE = 5.0  # [s] for the device to answer at all
SMALL = 0.01  # motor units
SLACK = 50_000_000  # [ns] by which this test's own process may be held up


def check(device_link):
    """Raises AssertionError with what a link does otherwise than runtime/link says; the link is closed afterwards."""
    checks = has_its_signatures, answers, latches_at_deadlines, gives_up_in_time, counts_whole_steps, cuts_the_motor
    for one in checks:
        one(device_link)
    device_link.close()


def has_its_signatures(device_link):
    assert isinstance(device_link.memory, np.ndarray) and device_link.memory.dtype == np.int64
    for function, signature in ((device_link.read, link.READ), (device_link.write, link.WRITE)):
        assert tuple(signature.args) in function.signatures, "not compiled with the signature of runtime/link"
        assert isinstance(function, numba.core.dispatcher.Dispatcher)


def answers(device_link):
    end = time.monotonic() + PATIENCE
    while not device_link.present():
        assert time.monotonic() < end, "the device is not present"
        time.sleep(0.01)


def drive(device_link, ticks, motor=0.0):
    """Runs ticks as the servo would; returns [(deadline, fresh, sample)]."""
    scratch, seen = clock.scratch(), []
    deadline = int(clock.now_ns(scratch)) + PERIOD
    device_link.write(device_link.memory, deadline - PERIOD, deadline, PERIOD, 0, np.zeros(3))
    for _ in range(ticks):
        clock.sleep_until(deadline, scratch)
        sample = np.zeros(link.SAMPLE)
        fresh = device_link.read(device_link.memory, deadline, deadline + SLACK, sample)
        seen.append((deadline, fresh, sample))
        now = int(clock.now_ns(scratch))
        deadline = max(deadline + PERIOD, now + PERIOD)
        device_link.write(device_link.memory, now, deadline, PERIOD, 1, np.array([motor, 0.0, 0.0]))
    return seen


def latches_at_deadlines(device_link):
    seen = drive(device_link, 50, SMALL)
    for deadline, fresh, sample in seen:
        assert np.isfinite(sample).all()
        assert (sample[link.LATCHED] >= deadline) == bool(fresh)
    late = sum(not fresh for _, fresh, _ in seen)
    assert late < len(seen) / 2, f"{late} of {len(seen)} samples were old"
    latched = [sample[link.LATCHED] for _, _, sample in seen]
    assert np.all(np.diff(latched[2:]) >= 0.0), "time ran backwards"
    written_on_time = np.diff([deadline for deadline, _, _ in seen]).max() < 10 * PERIOD
    cut = any(int(sample[link.STATUS]) & 2 for _, fresh, sample in seen[5:] if fresh)
    assert not (cut and written_on_time), "the motor was cut though writes came in time"


def gives_up_in_time(device_link):
    scratch, sample = clock.scratch(), np.zeros(link.SAMPLE)
    far = int(clock.now_ns(scratch)) + 3600 * 1_000_000_000
    waits = []
    for patience in (0, 2 * PERIOD):
        began = int(clock.now_ns(scratch))
        assert device_link.read(device_link.memory, far, began + patience, sample) == 0
        waits.append(int(clock.now_ns(scratch)) - began)
    assert sample[link.LATCHED] < far
    assert waits[0] < SLACK and waits[1] < 2 * PERIOD + SLACK, f"waited {waits} ns"


def counts_whole_steps(device_link):
    _, _, sample = drive(device_link, 5)[-1]
    counts = sample[link.COUNTS : link.COUNTS + 3]
    assert np.array_equal(counts, np.round(counts))


def cuts_the_motor(device_link):
    """Silent for longer than the device's watchdog, the servo is told that the motor was cut; by writing it returns."""
    drive(device_link, 5, SMALL)
    sample, end = np.zeros(link.SAMPLE), time.monotonic() + PATIENCE
    while not int(sample[link.STATUS]) & 2:
        assert time.monotonic() < end, "the device never cut the motor of a silent servo"
        time.sleep(0.002)
        device_link.read(device_link.memory, 0, 0, sample)
    assert not int(drive(device_link, 20)[-1][2][link.STATUS]) & 2, "the device did not take the servo back"
