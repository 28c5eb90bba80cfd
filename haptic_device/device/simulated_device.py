# SPDX-License-Identifier: Apache-2.0
"""The plant behind the page: integrates up to each announced deadline and latches, or runs free without a servo."""

import numpy as np

from haptic_device.config.description import SUB_STEP
from haptic_device.control import enable_state
from haptic_device.control.records import TICK, record
from haptic_device.device import operator_hand, plant
from haptic_device.jit import kernel, njit
from haptic_device.realtime import atomic, clock, hardware_interface, seqlock, servo_loop, servo_writes, shared_memory

FREE_STEP = 1_000_000  # [ns] between samples while there is no servo
STOP, LATE_WRITES, RUN_ON, TRIPS, REFUSED, WATCHDOG, CONTROLS = 0, 1, 2, 3, 4, 5, 8  # words of control

TRUTH = record(
    "position* velocity* operator_force* motor_force* target* target_velocity* time energy_given motion_done driven"
)


@kernel
def advance(device, memory, motion, until):
    """Integrates the plant up to this time [ns] in sub-steps that end at every change of the motor."""
    target = np.empty(3)
    while memory.time < until:
        end = plant.next_change(memory, min(until, memory.time + SUB_STEP))
        if end > memory.time:
            grip = _target(memory, motion, end, target)
            plant.sub_step(device, memory, end, target, grip)
        plant.take_motor(device, memory)


@njit
def _target(memory, motion, end, target):
    """Where the hand wants to be at this time; returns its grip."""
    if motion.kind == operator_hand.FOLLOW:
        step = (end - memory.time) * 1e-9
        for i in range(3):
            target[i] = operator_hand.follow(motion.points[0, i], memory.target[i], motion.lag, step)
        return motion.grip[0]
    time = (end - motion.started) * 1e-9 if 0 < motion.started < end else 0.0
    return operator_hand.target_at(motion, time, target)


@njit
def _latch(device, memory, deadline, sample):
    """Encoder counts and drag latched at this deadline, as a link's sample."""
    plant.sense(
        device,
        memory,
        deadline,
        sample[hardware_interface.COUNTS : hardware_interface.COUNTS + 3],
        sample[hardware_interface.DRAG : hardware_interface.DRAG + 3],
    )
    sample[hardware_interface.LATCHED], sample[hardware_interface.STATUS] = deadline, 0.0


@njit
def _begin(motion, engaged, now):
    """The hand's script begins when the display is engaged."""
    if engaged and motion.started == 0:
        motion.started = now


@kernel
def serve(words, control, truth_mail, session, device, memory, motion, truth):
    """Serves the page until control[STOP]: driven by the servo's writes, free and with motor zero without them.

    control[WATCHDOG]: time [ns] without a write after which the motor is cut, as a real drive does. When it returns the
    motor is zero, and the truth says so.

    Counts into control: LATE_WRITES (a write's time lay before what was integrated), RUN_ON (deadlines that passed
    without a write), TRIPS (of the motor watchdog, a servo that ended well not counted), REFUSED (writes of nonsense).
    """
    scratch, zero, sample = np.zeros(2, np.int64), np.zeros(3), np.zeros(hardware_interface.SAMPLE)
    inbox, outbox = np.zeros(shared_memory.SERVO_WORDS, np.int64), np.zeros(shared_memory.DEVICE_WORDS, np.int64)
    seen, driven, holding = shared_memory.read_servo(words, inbox), False, False
    memory[0].time = clock.now_ns(scratch)
    words[shared_memory.DEVICE_WATCHDOG] = watchdog = control[WATCHDOG]
    _cut_motor(device[0], memory[0], motion[0], memory[0].time, zero)
    announced, period, heartbeat = memory[0].time, np.int64(FREE_STEP), memory[0].time
    while atomic.load(control, STOP) == 0:
        turn, now = shared_memory.read_servo(words, inbox), clock.now_ns(scratch)
        fresh = turn >= 0 and turn != seen
        seen = turn if fresh else seen
        if fresh and not servo_writes.sensible(inbox, now, watchdog):
            control[REFUSED] += 1
        elif fresh:
            driven, holding = True, servo_writes.holds(inbox)
            heartbeat, announced, period = inbox[1], inbox[2], inbox[3]
            control[LATE_WRITES] += heartbeat < memory[0].time
            plant.push_motor(device[0], memory[0], max(heartbeat, memory[0].time), inbox.view(np.float64)[5:])
            _begin(motion[0], inbox[4] != 0, heartbeat)
        elif driven and now - heartbeat > watchdog:
            driven = False
            control[TRIPS] += holding
            _cut_motor(device[0], memory[0], motion[0], heartbeat + watchdog, zero)
        elif driven and now >= announced + period:
            announced += period
            control[RUN_ON] += 1
        elif driven:
            clock.sleep_until(now + max(period // 16, 5000), scratch)
            continue
        if not driven:
            announced = max(now, memory[0].time)
        advance(device[0], memory[0], motion[0], announced)
        _latch(device[0], memory[0], announced, sample)
        status = 0 if driven else shared_memory.WATCHDOG
        counts, drag = sample[hardware_interface.COUNTS :], sample[hardware_interface.DRAG :]
        shared_memory.write_device(words, outbox, session, announced, status, now, counts, drag, 0, 0)
        _tell(truth_mail, memory[0], motion[0], truth, driven)
        clock.sleep_until(announced + (period // 4 if driven else FREE_STEP), scratch)
    _cut_motor(device[0], memory[0], motion[0], max(clock.now_ns(scratch), memory[0].time), zero)
    _tell(truth_mail, memory[0], motion[0], truth, False)
    return seen


@njit
def _cut_motor(device, memory, motion, when, zero):
    """Motor zero from `when` on, whatever is still queued."""
    advance(device, memory, motion, when)
    memory.queue_tail = memory.queue_head
    plant.push_motor(device, memory, memory.time - device.actuation_delay, zero)
    plant.take_motor(device, memory)


@njit
def _tell(mail, memory, motion, truth, driven):
    """The truth for whoever publishes it."""
    t = truth[0]
    t.time, t.energy_given, t.driven = memory.time * 1e-9, memory.energy_given, driven
    t.motion_done = motion.started > 0 and (memory.time - motion.started) * 1e-9 >= motion.duration
    for i in range(3):
        t.position[i], t.velocity[i] = memory.position[i], memory.velocity[i]
        t.operator_force[i], t.motor_force[i] = memory.operator_force[i], memory.motor_force[i]
        t.target[i], t.target_velocity[i] = memory.target[i], memory.target_velocity[i]
    atomic.publish(mail, 0, seqlock.FIRST, atomic.words_of(truth))


@kernel
def gather(mail, control, period, deadline, rows, scratch):
    """Takes the truth at `deadline` and each period after it into the rows, until they are full or control[STOP].

    deadline, period: [ns]. rows: words of TRUTH (count, words), zeros where there is none. Returns the next deadline.
    """
    for k in range(rows.shape[0]):
        stopped = atomic.load(control, STOP) != 0
        if not stopped:
            clock.sleep_until(deadline, scratch)
            deadline = max(deadline + period, clock.now_ns(scratch))
        if stopped or atomic.collect(mail, 0, seqlock.FIRST, rows[k]) < 0:
            for i in range(rows.shape[1]):
                rows[k, i] = 0
    return deadline


@kernel
def run_lockstep(settings, state, rows, tool, body, body_state, motion, start, first, write_delay, word):
    """rows.size ticks without clock, the first of number `first` at time start [ns], against the plant itself.

    The motor is written write_delay [ns] after each deadline, as the live servo's lateness has it. All records as in
    run_realtime, of one each; body, body_state and motion as in device/plant and device/operator_hand; word: command.
    """
    sample, ticks = np.zeros(hardware_interface.SAMPLE), np.zeros(1, TICK)
    tick, period = ticks[0], np.int64(round(settings[0].period * 1e9))
    tick.sensors.lateness, tick.sensors.write_delay = write_delay * 1e-9, write_delay * 1e-9
    tick.sensors.command = word
    for k in range(rows.size):
        deadline = start + k * period
        advance(body[0], body_state[0], motion[0], deadline)
        _latch(body[0], body_state[0], deadline, sample)
        servo_loop.run_tick(settings[0], state[0], tool[0], tick, first + k, deadline, sample, 1)
        plant.push_motor(body[0], body_state[0], deadline + write_delay, tick.output.motor)
        _begin(motion[0], tick.output.state == enable_state.ENGAGED, deadline + write_delay)
        servo_loop.copy_tick(ticks, rows, k)
