# SPDX-License-Identifier: Apache-2.0
"""Work of a servo tick with the tool in it: three axes, four flanks pressed with friction, of 100 000 ticks.

Prints median, p99.9 and worst of the whole tick [us], with `direct` and with `local`, and how many linear systems the
contacts took. Times are read around each tick, so a disturbance by others counts; run it on a quiet machine. The same
ticks run REPEATS times from the same start; `work` is the worst tick by the least of its times, which no disturbance
lengthens unless it strikes a tick each time. Last, the contacts alone where pivoting goes on to its bound.
"""

from typing import Annotated

import numba
import numpy as np
import typer

from haptic_device import controller_config
from haptic_device.control import contact_model, contact_solver, enable_state, faults, records, servo, tool_contacts
from haptic_device.description import load_device
from haptic_device.message_fields import MOST
from haptic_device.parameters import EXCHANGE_METHODS, NODES
from haptic_device.realtime import clock

PERIOD_NS = 250_000
REPEATS = 5


@numba.njit(error_model="numpy")
def run(settings, memory, row, near, times, pivots):
    """A handle that pulls and twists a peg between its flanks; a new set each fourth tick."""
    record, scratch = row[0], np.zeros(2, np.int64)
    for k in range(times.size):
        phase = 0.003 * k
        record.sensors.latched = record.sensors.deadline = (k + 1.0) * PERIOD_NS
        record.sensors.command, record.sensors.device_status = enable_state.ENABLE, faults.FRESH
        record.sensors.counts[0], record.sensors.counts[1] = (
            np.round(400.0 * np.sin(phase)),
            np.round(200.0 * np.sin(1.7 * phase)),
        )
        record.sensors.counts[2] = np.round(800.0 * np.sin(2.3 * phase))
        record.tool.session, record.tool.answered, record.tool.sequence, record.tool.age = 1.0, k + 1.0, k + 1.0, 1e-3
        record.tool.contact_age = 1e-3
        began = clock.now_ns(scratch)
        if k % 4 == 0:
            near[0].number = k + 1.0
            tool_contacts.take(memory[0].virtual_tool.contacts, near[0])
        servo.tick(settings[0], memory[0], record)
        times[k], pivots[k] = clock.now_ns(scratch) - began, record.output.local_pivots


def slot():
    """Set of six contacts: four corners of a peg between two flanks 0.1 mm wider, and two planes of the mouth."""
    near = np.zeros(1, contact_model.SET)
    near["mass"], near["inertia"], near["extent"], near["trust"] = 0.1, 3e-4, 0.1, 10.0
    for i in range(6):
        one, side = near["table"][0, i], 1.0 if i % 2 == 0 else -1.0
        one[[contact_model.IDENTITY, contact_model.KIND, contact_model.FRICTION]] = (
            i + 1.0,
            contact_model.FLAT_THERE,
            0.2,
        )
        one[[contact_model.TOOL_X, contact_model.TOOL_Y]] = -0.01 * side, -0.09 + 0.02 * (i // 2)
        one[[contact_model.POINT_X, contact_model.NORMAL_X]] = -0.01005 * side, side
    return near


def main(ticks: Annotated[int, typer.Argument(min=1)] = 100_000) -> None:
    """Work of a servo tick with the tool in it."""
    print("method   median us   p99.9 us   worst us    work us   systems: mean, most   acting")
    for method in ("direct", EXCHANGE_METHODS[-1]):
        values = {parameter.name: parameter.default for parameter in NODES["haptic_driver"]}
        values |= {
            "exchange.method": method,
            "coupling.stiffness": 2000.0,
            "coupling.damping": 2.0,
            "coupling.rotational_stiffness": 2.0,
            "coupling.rotational_damping": 0.002,
            "local.apart": 1.0,
            "local.rejoin": 0.0,
        }
        settings = controller_config.settings_from(load_device("desktop"), values)
        run(*start(settings), slot(), np.zeros(2000), np.zeros(2000))  # compiled here
        times, pivots = np.zeros((REPEATS, ticks)), np.zeros(ticks)
        for once in times:
            _, memory, row = begun = start(settings)
            run(*begun, slot(), once, pivots)
        median, high, worst = np.percentile(times, (50, 99.9, 100)) * 1e-3
        work = times.min(axis=0).max() * 1e-3
        print(
            f"{method:7} {median:10.2f} {high:10.2f} {worst:10.2f} {work:10.2f} {pivots.mean():12.2f}"
            f" {pivots.max():6.0f} {memory['acting'][0]:10.0f}"
        )
    most = contact_solver.EXACT + contact_solver.BRAKED
    print(f"the contacts alone: {bound() * 1e-3:.2f} us for the {most} systems that a solution takes at most")


def start(settings):
    """Settings, memory and row of a servo that is engaged."""
    memory, row = np.zeros(1, records.STATE), np.zeros(1, records.TICK)
    memory["enable"]["ramp"], memory["fade"]["factor"], memory["enable"]["state"] = 1.0, 1.0, enable_state.ENGAGED
    return settings, memory, row


def bound():
    """Least time [ns] of as many systems as a tick may take at most, of eight contacts with friction."""
    random = np.random.default_rng(1)
    rows = np.zeros((MOST, contact_solver.COLUMNS))
    rows[:, : contact_solver.B_T + 1] = random.normal(size=(MOST, contact_solver.B_T + 1))
    rows[:, [contact_solver.E_N, contact_solver.E_T, contact_solver.MU]] = 1e-2, 1e-5, 0.5
    rows[:, contact_solver.MODE] = contact_solver.STICK
    return min(systems(rows, np.ones(3), np.ones(3), np.zeros((3, 4)), np.zeros(3)) for _ in range(1000))


@numba.njit(error_model="numpy")
def systems(rows, mass, right, system, velocity):
    """Time [ns] of EXACT and BRAKED solutions."""
    scratch = np.zeros(2, np.int64)
    began = clock.now_ns(scratch)
    for turn in range(contact_solver.EXACT + contact_solver.BRAKED):
        braked = turn >= contact_solver.EXACT
        contact_solver._assemble(rows, mass, right, system, braked)
        contact_solver._eliminate(system, velocity)
        contact_solver._review(rows, velocity, True, braked)
    return clock.now_ns(scratch) - began
