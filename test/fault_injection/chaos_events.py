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
from fault_injection.conductor import NODES, PATIENCE, Conductor
from haptic_device.control import enable_state

FROZEN = 0.4  # s
HEARD = 0.2  # [s] until everything that happened has been heard of
ESTOPS = 7
STOPPED = 2  # ticks with the e-stop until the motor must be at zero


class Event(NamedTuple):
    """run: (conductor) → Figures; safe: bound of its time to safety [ms]; faults: that it may latch."""

    name: str
    run: Callable[[Conductor], figures.Figures]
    safe: float | None = None
    faults: tuple[str, ...] = ()


def kill_driver(conductor: Conductor) -> figures.Figures:
    """kill -9 of the driver while the wall is pressed."""
    conductor.press()
    conductor.kill("haptic_driver")
    last = conductor.heartbeat()
    conductor.wait(HEARD)
    safe = figures.motor_off(conductor.witness.heard().truths, last)
    conductor.release()
    return _restarted(conductor, "haptic_driver", safe)


def stop_driver(conductor: Conductor) -> figures.Figures:
    """SIGSTOP of the driver while the wall is pressed, then SIGCONT."""
    conductor.press()
    conductor.freeze("haptic_driver")
    last = conductor.heartbeat()
    conductor.wait(FROZEN)
    safe = figures.motor_off(conductor.witness.heard().truths, last)
    conductor.release()
    conductor.thaw("haptic_driver")
    return _enabled(conductor, safe)


def kill_simulation(conductor: Conductor) -> figures.Figures:
    """kill -9 of the simulation; a new one joins while the hand still presses."""
    conductor.press()
    conductor.kill("haptic_simulation")
    conductor.wait(FROZEN)
    began = time.monotonic()
    conductor.start("haptic_simulation")
    recovered = _rejoined(conductor, began)
    return _coupled(conductor, recovered)


def stop_simulation(conductor: Conductor) -> figures.Figures:
    """SIGSTOP of the simulation, then SIGCONT, while the hand presses."""
    conductor.press()
    conductor.freeze("haptic_simulation")
    conductor.wait(FROZEN)
    began = time.monotonic()
    conductor.thaw("haptic_simulation")
    return _coupled(conductor, _rejoined(conductor, began))


def kill_loopback(conductor: Conductor) -> figures.Figures:
    """kill -9 of the device."""
    conductor.press()
    conductor.kill("haptic_loopback")
    conductor.wait(HEARD)
    safe = figures.found_silent(conductor.witness.heard().rows)
    conductor.release()
    return _restarted(conductor, "haptic_loopback", safe)


def stop_loopback(conductor: Conductor) -> figures.Figures:
    """SIGSTOP of the device, then SIGCONT."""
    conductor.press()
    conductor.freeze("haptic_loopback")
    conductor.wait(FROZEN)
    safe = figures.found_silent(conductor.witness.heard().rows)
    conductor.release()
    conductor.thaw("haptic_loopback")
    return _enabled(conductor, safe)


def kill_recorder(conductor: Conductor) -> figures.Figures:
    """kill -9 of the recorder: nothing of it is felt."""
    conductor.press()
    conductor.kill("haptic_recorder")
    conductor.wait(FROZEN)
    began = time.monotonic()
    conductor.start("haptic_recorder")
    conductor.until(lambda: "haptic_recorder" in conductor.witness.statuses, PATIENCE, "the recorder")
    return figures.figures(conductor.witness.heard(), recovered=time.monotonic() - began)


def estop(conductor: Conductor) -> figures.Figures:
    """~/estop while the wall is pressed, several times; safe is the median from the call to the motor at zero."""
    times, heards, ticks = [], [], 0
    for _ in range(ESTOPS):
        conductor.begin()
        conductor.press()
        called = time.monotonic()
        conductor.witness.commands.call("estop")
        conductor.wait(HEARD)
        heards.append(conductor.witness.heard())
        told = figures.told_to_zero(heards[-1].rows, called, enable_state.ESTOP)
        times.append(max(told or math.inf, figures.motor_off(heards[-1].truths, called)))
        ticks = max(ticks, figures.ticks_to_zero(heards[-1].rows, enable_state.ESTOP))
        conductor.release()
    note = f"{ticks} tick after the driver has it; worst {max(times):.1f} ms"
    found = figures.worst([figures.figures(heard) for heard in heards])
    wrong = ("ticks",) if ticks > STOPPED else ()
    return found._replace(safe=statistics.median(times), recovered=conductor.enable(), note=note, wrong=wrong)


def in_order(order: tuple[str, ...]) -> Callable[[Conductor], figures.Figures]:
    """All three nodes killed, and started again in this order; recovered counts from the last start."""

    def run(conductor):
        conductor.press()
        for name in random.sample(NODES, len(NODES)):
            conductor.kill(name)
        conductor.release()
        conductor.wait(HEARD)  # or the last ticks of the killed driver are taken for those of the new one
        for name in order:
            conductor.start(name)
        conductor.witness.mark_session()
        return _enabled(conductor)

    return run


def _restarted(conductor, name, safe):
    began = time.monotonic()
    conductor.start(name)
    conductor.witness.mark_session()
    return _enabled(conductor, safe, began)


def _enabled(conductor, safe=None, began=None):
    """Enables it again, and hears how the forces rise; recovered counts from `began` [s of the clock], or from now."""
    began = began or time.monotonic()
    conductor.enable()
    recovered = time.monotonic() - began
    conductor.wait(figures.AFTER)
    return figures.figures(conductor.witness.heard(), safe, recovered)


def _rejoined(conductor, began):
    conductor.until(lambda: conductor.engaged or conductor.faulty, PATIENCE, "the simulation")
    if conductor.faulty:
        conductor.release()
        conductor.enable()
    recovered = time.monotonic() - began
    conductor.wait(FROZEN)
    conductor.release()
    return recovered


def _coupled(conductor, recovered):
    heard = conductor.witness.heard()
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
