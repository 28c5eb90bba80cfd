# SPDX-License-Identifier: Apache-2.0
"""One servo tick: the stages of the table "Servo" in docs/theory/model.md, in its order."""

import numpy as np

from haptic_device.control import (
    bumpless_transfer,
    damping_compensation,
    enable_state,
    exchange_controller,
    fault_watch,
    motor,
    passivity_observer,
    sensing,
    virtual_coupling,
    virtual_wall,
    withheld,
)
from haptic_device.control.records import AXES, OUTPUT
from haptic_device.jit import kernel, njit

CLEARED = np.zeros(1, OUTPUT)


@kernel
def tick(wished, state, tick):
    """One tick: records of SETTINGS, STATE and TICK (control/records); reads its sensors and tool, fills in its output.

    Nothing of the output's last content counts.
    """
    tick.output = CLEARED[0]
    sensors, tool, output, settings = tick.sensors, tick.tool, tick.output, state.in_force
    motion, hold, enable = state.motion, state.hold, state.enable
    observer, spring, walls, fault = state.observer, state.spring, state.walls, state.fault
    bumpless_transfer.begin(wished, state)
    # what has been
    sensing.sense(settings, motion, state.samples, state.compensation, fault, sensors, output)
    virtual_wall.measure_depths(settings.wall, walls, motion.handle)
    passivity_observer.hold_ended(settings, observer, hold, motion, spring, walls, enable, sensors)
    _tell_energy(settings.passivity, observer, output)
    # what is wanted
    bumpless_transfer.follow(wished, state)
    exchange_controller.move_set_point(settings, state, sensors, tool, output)
    passivity_observer.release_wall_energy(settings, observer, walls, enable)
    virtual_wall.push(settings, walls, hold, output)
    virtual_coupling.pull(settings, hold, output)
    damping_compensation.compensate(settings, state.compensation, motion, walls, output)
    passivity_observer.inject(settings, observer, motion, walls, output)
    # whether it may be
    fault_watch.watch(settings, fault, enable, motion, sensors)
    near = enable.state != enable_state.WAITING or output.exchange_fade == 0.0
    near = near or exchange_controller.tool_is_near(settings, tool, output.position)
    enable_state.advance(settings, enable, fault, motion, sensors, near, output)
    bumpless_transfer.pay_for_rise(settings, state, output)
    motor.command(settings, enable, fault, hold, output)
    # what will be held until the next tick
    passivity_observer.hold_begins(settings, observer, hold, motion, walls, output)
    exchange_controller.tick_ended(settings, state, output)
    withheld.tell(settings, state, sensors, tool, output)


@njit
def _tell_energy(passivity, observer, output):
    """What the observer knows, and the damping left over that it counts with, into the output."""
    for i in range(AXES):
        output.energy_given[i], output.generated[i] = observer.energy_given[i], observer.observed_energy[i]
        output.margin[i], output.surplus[i] = passivity.margin[i], passivity.surplus[i]
    output.lateness_counted = passivity.lateness
