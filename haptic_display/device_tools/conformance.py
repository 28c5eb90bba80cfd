# SPDX-License-Identifier: Apache-2.0
"""What every hardware interface owes the servo (realtime/hardware_interface), tried on one with a device behind it.

The device may be a model or hardware with nobody at its handle: its motors are given `motor` units and no more. A check
is a function of (interface, motor) that returns what it measured, as text, or raises Violation, one sentence.
"""

import time
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numba
import numpy as np

from haptic_device.realtime import clock, hardware_interface
from haptic_device.realtime.hardware_interface import COUNTS, LATCHED, SAMPLE, STAMP_ERROR, STATUS
from haptic_device.realtime.shared_memory import WATCHDOG

PERIOD = 1_000_000  # [ns]
LIMIT = 60_000_000_000  # [ns] for whatever is waited for; the kernels may have to be compiled first
SHORTEST = 10 * PERIOD  # no watchdog of a device may be shorter
SMALL = 0.01  # motor units
TICKS = 1000  # deadlines that the share of samples is counted over
SHARE = 0.99  # of deadlines whose samples have to come within half a period
NEWER = 10  # samples whose counts are looked at
IN_TIME = "samples at the deadlines, at 1 kHz"
LOOK = 0.0002  # [s] between two looks for what is waited for


class Violation(ValueError):
    """A promise that an interface does not keep, in one sentence."""


class Result(NamedTuple):
    """Of one check: what is promised, whether it is kept, what was measured ("" if nothing), why not ("" if kept)."""

    name: str
    passed: bool
    figure: str
    sentence: str


class Tick(NamedTuple):
    """deadline, when the write before it came, when reading ended [ns of CLOCK_MONOTONIC]; what reading gave."""

    deadline: int
    written: int
    ended: int
    fresh: int
    sample: np.ndarray


class Interface(Protocol):
    """What of a hardware interface is tried."""

    memory: np.ndarray
    read: Any
    write: Any

    def present(self) -> bool:
        """Whether the device answers."""


def check_all(
    interface: Interface, progress: Callable[[str], None] = lambda name: None, motor: float = SMALL
) -> list[Result]:
    """Results of all checks in their order; progress is told the name of each before it begins.

    motor: largest motor value [motor units]; it is 0 when this ends. Where no device answers nothing further is tried.
    """
    results: list[Result] = []
    try:
        for name, check in CHECKS.items():
            progress(name)
            results.append(_result(name, check, interface, motor))
            if check is answers and not results[-1].passed:
                break
    finally:
        release(interface)
    return results


def _result(name: str, check: Callable[[Interface, float], str], interface: Interface, motor: float) -> Result:
    try:
        return Result(name, True, check(interface, motor), "")
    except Violation as violation:
        return Result(name, False, "", str(violation))


def release(interface: Interface) -> None:
    """Tells the device that the display is not engaged and its motors are zero."""
    now = time.monotonic_ns()
    interface.write(interface.memory, now, now + PERIOD, PERIOD, 0, np.zeros(3))


def has_its_signatures(interface: Interface, motor: float = SMALL) -> str:
    """read and write are compiled for the servo, memory is an int64 array."""
    if not (isinstance(interface.memory, np.ndarray) and interface.memory.dtype == np.int64):
        raise Violation("memory is no int64 array")
    signatures = {"read": hardware_interface.READ, "write": hardware_interface.WRITE}
    for name, signature in signatures.items():
        function = getattr(interface, name)
        compiled = isinstance(function, numba.core.dispatcher.Dispatcher)
        if not (compiled and tuple(signature.args) in function.signatures):
            raise Violation(f"{name} is not compiled with the signature of realtime/hardware_interface")
    return ""


def answers(interface: Interface, motor: float = SMALL) -> str:
    """The device is present."""
    _until(interface.present, "the device does not answer")
    return ""


def drive(interface: Interface, ticks: int, motor: float = 0.0, patience: int = LIMIT) -> list[Tick]:
    """Runs ticks as the servo would, each waiting for its sample up to `patience` [ns]; the first write is a release.

    motor: of x [motor units], held from the first tick on.
    """
    scratch, seen, push = clock.scratch(), list[Tick](), np.array([motor, 0.0, 0.0])
    written = time.monotonic_ns()
    deadline = written + PERIOD
    interface.write(interface.memory, written, deadline, PERIOD, 0, np.zeros(3))
    for _ in range(ticks):
        clock.sleep_until(deadline, scratch)
        sample, woken = np.zeros(SAMPLE), time.monotonic_ns()
        fresh = interface.read(interface.memory, deadline, max(deadline, woken) + patience, sample)
        seen.append(Tick(deadline, written, time.monotonic_ns(), int(fresh), sample))
        if not fresh and patience == LIMIT:  # it is silent: the rest would be waited for in vain
            break
        written = time.monotonic_ns()
        deadline = max(deadline + PERIOD, written + PERIOD)
        interface.write(interface.memory, written, deadline, PERIOD, 1, push)
    return seen


def is_cut(sample: np.ndarray) -> bool:
    """Whether the device says that its watchdog has cut the motors."""
    return bool(int(sample[STATUS]) & WATCHDOG)


def latches_at_deadlines(interface: Interface, motor: float = SMALL) -> str:
    """Whoever waits gets the sample of his deadline, latched then or later, and of finite numbers."""
    late, error = [], 0.0
    for tick in drive(interface, 50, motor):
        if tick.fresh != 1:
            raise Violation("no sample of a deadline that had passed")
        if not np.isfinite(tick.sample).all():
            raise Violation(f"a sample has values that are not finite: {tick.sample.tolist()}")
        late.append(tick.sample[LATCHED] - tick.deadline)
        error = max(error, tick.sample[STAMP_ERROR])
        if late[-1] < 0:
            raise Violation(f"an old sample, latched {-late[-1] / 1e3:.1f} us before its deadline, was called fresh")
    return f"latched {np.median(late) / 1e3:.1f} us after the deadline (p50), known to {error / 1e3:.3g} us"


def keeps_time(interface: Interface, motor: float = SMALL) -> str:
    """Samples are of times that never run backwards."""
    latched = [tick.sample[LATCHED] for tick in drive(interface, 50, motor)]
    for before, after in zip(latched, latched[1:], strict=False):
        if after < before:
            raise Violation(f"time ran backwards by {(before - after) / 1e3:.1f} us from one sample to the next")
    return ""


def meets_deadlines(interface: Interface, motor: float = SMALL, ticks: int = TICKS) -> str:
    """Of nearly all deadlines there is a sample as soon as the servo needs it: it waits for half a period."""
    seen = drive(interface, ticks, motor, PERIOD // 2)
    share = sum(tick.fresh == 1 for tick in seen) / ticks
    if share < SHARE:
        wanted = f"within {PERIOD / 2e3:g} us; at least {100 * SHARE:g} % are needed"
        raise Violation(f"samples of {100 * share:.1f} % of {ticks} deadlines came {wanted}")
    p50, p99 = np.percentile([tick.ended - tick.deadline for tick in seen if tick.fresh == 1], [50, 99]) / 1e3
    return f"{100 * share:.1f} % of {ticks}; deadline to sample {p50:.0f} us (p50), {p99:.0f} us (p99)"


def pushes_while_written(interface: Interface, motor: float = SMALL) -> str:
    """A motor is cut by silence only, judged by the latched times."""
    driven = False
    for tick in drive(interface, 50, motor):
        silent, cut = tick.sample[LATCHED] - tick.written, is_cut(tick.sample)
        if driven and cut and silent <= SHORTEST:
            raise Violation(f"the motor was cut {silent / 1e6:.3f} ms after a write")
        driven = driven or not cut
    if not driven:
        raise Violation("the motor stayed cut though the servo wrote")
    return ""


def gives_up(interface: Interface, motor: float = SMALL) -> str:
    """A deadline that is an hour ahead is not waited for."""
    sample, longest = np.zeros(SAMPLE), 0
    far = time.monotonic_ns() + 3600 * 1_000_000_000
    for patience in (0, 2 * PERIOD):
        give_up = time.monotonic_ns() + patience
        fresh = interface.read(interface.memory, far, give_up, sample)
        longest = max(longest, time.monotonic_ns() - give_up)
        if time.monotonic_ns() >= far:
            raise Violation("reading waited for a deadline that was an hour ahead")
        if fresh != 0 or sample[LATCHED] >= far:
            raise Violation("a sample of a deadline that is an hour ahead was called fresh")
    return f"returned within {longest / 1e3:.0f} us of the time to give up"


def counts_whole_steps(interface: Interface, motor: float = SMALL) -> str:
    """Counts of encoders are whole numbers."""
    for tick in drive(interface, 5):
        counts = tick.sample[COUNTS : COUNTS + 3]
        if not np.array_equal(counts, np.round(counts)):
            raise Violation(f"counts are {counts.tolist()}; they have to be whole numbers")
    return ", ".join(f"{count:.0f}" for count in counts)


def changes_counts_with_their_time_only(interface: Interface, motor: float = SMALL) -> str:
    """However often it is read: a way without a time could be booked nowhere."""
    before, sample, counts = drive(interface, 5, motor)[-1].sample, np.zeros(SAMPLE), slice(COUNTS, COUNTS + 3)
    for _ in range(NEWER):
        end = time.monotonic_ns() + LIMIT
        while True:
            interface.read(interface.memory, 0, 0, sample)
            earlier, before = before, sample.copy()
            if sample[LATCHED] != earlier[LATCHED]:
                break
            if not np.array_equal(sample[counts], earlier[counts]):
                raise Violation("counts changed and the time they were latched at did not")
            if time.monotonic_ns() > end:
                raise Violation(f"no newer sample came within {LIMIT / 1e9:g} s")
    return ""


def cuts_the_motor(interface: Interface, motor: float = SMALL) -> str:
    """Silent for longer than the device's watchdog, the servo is told that the motor was cut; by writing it returns."""
    last, sample = drive(interface, 5, motor)[-1], np.zeros(SAMPLE)

    def cut() -> bool:
        interface.read(interface.memory, 0, 0, sample)
        return is_cut(sample)

    _until(cut, "the device does not cut the motor of a silent servo")
    silent = sample[LATCHED] - last.ended
    if all(is_cut(tick.sample) for tick in drive(interface, 20)):
        raise Violation("the motor stayed cut though the servo wrote again")
    return f"told {silent / 1e6:.1f} ms after the last write"


def _until(condition: Callable[[], bool], otherwise: str) -> None:
    end = time.monotonic_ns() + LIMIT
    while not condition():
        if time.monotonic_ns() > end:
            raise Violation(f"{otherwise} within {LIMIT / 1e9:g} s")
        time.sleep(LOOK)


CHECKS = {
    "compiled with its signatures": has_its_signatures,
    "the device answers": answers,
    "a sample of each deadline, not before it": latches_at_deadlines,
    "time never runs backwards": keeps_time,
    IN_TIME: meets_deadlines,
    "no cut while the servo writes": pushes_while_written,
    "reading gives up in time": gives_up,
    "counts are whole": counts_whole_steps,
    "counts change with their time only": changes_counts_with_their_time_only,
    "watchdog cuts, and lets return": cuts_the_motor,
}
"""What is promised, and the function that tries it."""
