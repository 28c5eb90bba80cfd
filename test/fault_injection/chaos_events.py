# SPDX-License-Identifier: Apache-2.0
"""The events of chaos: each takes the running demo, does something to it, and says what came of it."""

import itertools
import math
import random
import statistics
import time
from collections.abc import Callable
from typing import NamedTuple

from fault_injection import chaos_figures as figures
from fault_injection import chaos_loads as loads
from fault_injection.fault_injector import NODES, PATIENCE, FaultInjector
from haptic_device.control import enable_state

FROZEN = 0.4  # s
HEARD = 0.2  # [s] until everything that happened has been heard of
ESTOPS = 7
STOPPED = 2  # ticks with the e-stop until the motor must be at zero


class Event(NamedTuple):
    """run: (injector) → Figures; safe: bound of its time to safety [ms]; faults: that it may latch."""

    name: str
    run: Callable[[FaultInjector], figures.Figures]
    safe: float | None = None
    faults: tuple[str, ...] = ()


def kill_driver(injector: FaultInjector) -> figures.Figures:
    """kill -9 of the driver while the wall is pressed."""
    injector.press()
    injector.kill("haptic_driver")
    last = injector.heartbeat()
    injector.wait(HEARD)
    safe = figures.motor_off(injector.listener.heard().truths, last)
    injector.release()
    return _restarted(injector, "haptic_driver", safe)


def stop_driver(injector: FaultInjector) -> figures.Figures:
    """SIGSTOP of the driver while the wall is pressed, then SIGCONT."""
    injector.press()
    injector.freeze("haptic_driver")
    last = injector.heartbeat()
    injector.wait(FROZEN)
    safe = figures.motor_off(injector.listener.heard().truths, last)
    injector.release()
    injector.thaw("haptic_driver")
    return _enabled(injector, safe)


def kill_simulation(injector: FaultInjector) -> figures.Figures:
    """kill -9 of the simulation; a new one joins while the hand still presses."""
    injector.press()
    injector.kill("haptic_simulation")
    injector.wait(FROZEN)
    began = time.monotonic()
    injector.start("haptic_simulation")
    recovered = _rejoined(injector, began)
    return _coupled(injector, recovered)


def stop_simulation(injector: FaultInjector) -> figures.Figures:
    """SIGSTOP of the simulation, then SIGCONT, while the hand presses."""
    injector.press()
    injector.freeze("haptic_simulation")
    injector.wait(FROZEN)
    began = time.monotonic()
    injector.thaw("haptic_simulation")
    return _coupled(injector, _rejoined(injector, began))


def kill_loopback(injector: FaultInjector) -> figures.Figures:
    """kill -9 of the device."""
    injector.press()
    injector.kill("haptic_loopback")
    injector.wait(HEARD)
    safe = figures.found_silent(injector.listener.heard().rows)
    injector.release()
    return _restarted(injector, "haptic_loopback", safe)


def stop_loopback(injector: FaultInjector) -> figures.Figures:
    """SIGSTOP of the device, then SIGCONT."""
    injector.press()
    injector.freeze("haptic_loopback")
    injector.wait(FROZEN)
    safe = figures.found_silent(injector.listener.heard().rows)
    injector.release()
    injector.thaw("haptic_loopback")
    return _enabled(injector, safe)


def kill_recorder(injector: FaultInjector) -> figures.Figures:
    """kill -9 of the recorder: nothing of it is felt."""
    injector.press()
    injector.kill("haptic_recorder")
    injector.wait(FROZEN)
    began = time.monotonic()
    injector.start("haptic_recorder")
    injector.until(lambda: "haptic_recorder" in injector.listener.statuses, PATIENCE, "the recorder")
    return figures.figures(injector.listener.heard(), recovered=time.monotonic() - began)


def estop(injector: FaultInjector) -> figures.Figures:
    """~/estop while the wall is pressed, several times; safe is the median from the call to the motor at zero."""
    times, heards, ticks = [], [], 0
    for _ in range(ESTOPS):
        injector.begin()
        injector.press()
        called = time.monotonic()
        injector.listener.call("estop")
        injector.wait(HEARD)
        heards.append(injector.listener.heard())
        told = figures.told_to_zero(heards[-1].rows, called, enable_state.ESTOP)
        times.append(max(told or math.inf, figures.motor_off(heards[-1].truths, called)))
        ticks = max(ticks, figures.ticks_to_zero(heards[-1].rows, enable_state.ESTOP))
        injector.release()
    note = f"{ticks} tick after the driver has it; worst {max(times):.1f} ms"
    found = figures.worst([figures.figures(heard) for heard in heards])
    wrong = ("ticks",) if ticks > STOPPED else ()
    return found._replace(safe=statistics.median(times), recovered=injector.enable(), note=note, wrong=wrong)


def in_order(order: tuple[str, ...]) -> Callable[[FaultInjector], figures.Figures]:
    """All three nodes killed, and started again in this order; recovered counts from the last start."""

    def run(injector):
        injector.press()
        for name in random.sample(NODES, len(NODES)):
            injector.kill(name)
        injector.release()
        injector.wait(HEARD)  # or the last ticks of the killed driver are taken for those of the new one
        for name in order:
            injector.start(name)
        injector.listener.mark_session()
        return _enabled(injector)

    return run


def _restarted(injector, name, safe):
    began = time.monotonic()
    injector.start(name)
    injector.listener.mark_session()
    return _enabled(injector, safe, began)


def _enabled(injector, safe=None, began=None):
    """Enables it again, and hears how the forces rise; recovered counts from `began` [s of the clock], or from now."""
    began = began or time.monotonic()
    injector.enable()
    recovered = time.monotonic() - began
    injector.wait(figures.AFTER)
    return figures.figures(injector.listener.heard(), safe, recovered)


def _rejoined(injector, began):
    injector.until(lambda: injector.engaged or injector.faulty, PATIENCE, "the simulation")
    if injector.faulty:
        injector.release()
        injector.enable()
    recovered = time.monotonic() - began
    injector.wait(FROZEN)
    injector.release()
    return recovered


def _coupled(injector, recovered):
    heard = injector.listener.heard()
    return figures.figures(heard, figures.coupling_off(heard.rows), recovered)


_DRIVER, _DEVICE = ("device_watchdog",), ("device_silent",)
EVENTS = (
    Event("kill -9 driver", kill_driver, 20.0, _DRIVER),
    Event("SIGSTOP driver", stop_driver, 20.0, (*_DRIVER, *_DEVICE)),
    Event("kill -9 simulation", kill_simulation, 201.0),
    Event("SIGSTOP simulation", stop_simulation, 201.0),
    Event("kill -9 loopback", kill_loopback, 22.0, _DEVICE),
    Event("SIGSTOP loopback", stop_loopback, 22.0, (*_DEVICE, *_DRIVER)),
    Event("kill -9 recorder", kill_recorder),
    Event("e-stop", estop, 20.0, ("estop",)),
    Event("CPU hogs", loads.hogs),
    Event("DDS flood", loads.flood),
    *(
        Event("start " + ", ".join(name.removeprefix("haptic_") for name in order), in_order(order), None, _DEVICE)
        for order in itertools.permutations(NODES)
    ),
)
CLOCK = Event("wall clock stepped", loads.step_clock)
