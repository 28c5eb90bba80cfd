# SPDX-License-Identifier: Apache-2.0
"""What is wished for: the table of rows as settings, tool and command have it in this tick (control/rows).

The account moves the table in force there, as far as it is paid (control/account). A wall changes for nothing while the
handle is off it: one that is new, or comes nearer, stands at the handle at first and follows it outwards. One that
turns or vanishes lets the handle in first.
"""

import math

from haptic_device.config.parameters import POLICIES
from haptic_device.control import account, damping_compensation, linkage, rows, velocity_estimator, virtual_wall
from haptic_device.control.rows import AXES, CANCELLATION, COUPLING, WALLS
from haptic_device.jit import kernel, njit

OFF = POLICIES.index("off")
NOTHING = 1e-6  # [J] in springs that are as good as slack
COVERED = 0.999  # of the damping that walls leave to be covered


@kernel
def wish(settings, state, output):
    """All rows as they are wished for without the ramp of forces; what the exchange wants is in the output."""
    _wish_coupling(settings, state, output)
    _wish_walls(settings, state)
    damping_compensation.compensate(settings, state.compensation, state.motion, state.walls, output)
    _wish_cancellation(settings, state, output)


@njit
def _square_to(row, i):
    for k in range(AXES):
        row.normal[k] = 1.0 if k == i else 0.0


@njit
def _wish_coupling(settings, state, output):
    gains, going = settings.coupling, False
    for i in range(int(settings.axes)):
        row, now = state.wished[COUPLING + i], state.rows[COUPLING + i]
        _square_to(row, i)
        row.stiffness, row.damping = gains.stiffness[i], gains.damping[i]
        row.low, row.high, row.weight = -gains.limit[i], gains.limit[i], output.exchange_fade
        row.offset, row.rate = output.coupling_position[i], output.coupling_velocity[i]
        same = now.stiffness == row.stiffness and now.damping == row.damping and now.high == row.high
        going = going or not (same or now.weight == 0.0)
    state.change.going = 1.0 if going else 0.0


@njit
def _wish_walls(settings, state):
    wall, place, change = settings.wall, state.motion.handle, state.change
    change.walls = max(change.walls, wall.count)
    while change.walls > wall.count and state.rows[WALLS + int(change.walls) - 1].weight == 0.0:
        change.walls -= 1.0
    for j in range(int(change.walls)):
        row, now = state.wished[WALLS + j], state.rows[WALLS + j]
        if j >= wall.count:
            rows.copy(now, row)
            row.weight, change.going = 0.0, 1.0
            continue
        row.normal[0], row.normal[1], row.normal[2] = wall.x[j], wall.y[j], 0.0
        row.offset, row.stiffness, row.damping, row.rate = wall.offset[j], wall.stiffness[j], wall.damping[j], 0.0
        row.low = 0.0
        row.high = virtual_wall.wall_limit(settings.coupling.limit, settings.axes, wall.x[j], wall.y[j])
        state.walls.depth[j] = rows.stretch(row, place)
        row.weight = 1.0
        rising = now.weight == 0.0 and state.enable.ramp < 1.0
        at_once = rising or settings.passivity.policy == OFF
        if state.enable.ramp == 0.0 or at_once or (now.weight > 0.0 and rows.same(now, row)):
            continue
        change.going = 1.0
        if now.weight == 0.0 or rows.stretch(now, place) <= 0.0:
            row.offset = min(row.offset, row.normal[0] * place[0] + row.normal[1] * place[1])
        elif not rows.same_normal(now, row):
            rows.copy(now, row)
            row.weight = 0.0


@njit
def _wish_cancellation(settings, state, output):
    chosen = settings.cancellation
    acts = chosen.source == damping_compensation.MODEL and chosen.ratio > 0.0
    for i in range(int(settings.axes)):
        row = state.wished[CANCELLATION + i]
        _square_to(row, i)
        row.damping = -chosen.ratio * settings.port.damping[i] if acts else 0.0
        row.low, row.high = -settings.coupling.limit[i], settings.coupling.limit[i]
        row.weight, row.rate = output.cancellation_fade if acts else 0.0, 0.0
        if acts and i < settings.port.joints:
            most = settings.hardware.motor_limit[i]
            row.low, row.high = -most, most
            linkage.joint_normal(state.account.jacobian, settings.port.joints, i, row.normal)


@kernel
def weigh_in(settings, state, output, held):
    """The ramp of forces on all that is wished for; held: what the motor has in the world [N | N m].

    Beside cancellation walls weigh as much as the damping covers; who pushes beyond the motor yields; and in debt all
    springs let go of as much.
    """
    wished, count, chosen = state.wished, WALLS + int(state.change.walls), settings.cancellation
    measured = chosen.ratio if chosen.source == damping_compensation.MEASURED else 0.0
    share = 1.0 - measured * output.engage * output.cancellation_fade
    account.count_damping(settings, state.account, state.hold, state.rows, count, state.motion.handle, share)
    if chosen.ratio > 0.0 and settings.wall.count > 0.0:
        _cover(settings.port, state, count)
    for r in range(count):
        wished[r].weight *= output.engage * state.motion.unfaded
    if settings.velocity.estimator != velocity_estimator.BACKWARD_DIFFERENCE:
        _estimated(state, output, count)
    if settings.passivity.control > 0.0 and settings.passivity.policy != OFF and state.account.free < 0.0:
        _let_go(state, count)
    _fit(settings, state, count, held)


@njit
def _cover(port, state, count):
    """Walls as light as the damping covers beside all else."""
    if account.needs(port, state.wished, count, state.account) >= 0.0:
        return
    share = 1.0
    for i in range(AXES):
        state.account.own[i] = state.account.left[i]
    for r in range(WALLS, count):
        state.walls.whole[r], state.wished[r].weight = state.wished[r].weight, 0.0
    account.needs(port, state.wished, count, state.account)
    for i in range(AXES):
        without, beside = state.account.left[i], state.account.own[i]
        if beside < 0.0 and without > beside:
            share = min(share, max(0.0, COVERED * without / (without - beside)))
    for r in range(WALLS, count):
        state.wished[r].weight = share * state.walls.whole[r]


@njit
def _estimated(state, output, count):
    """What another estimate of the velocity makes of dampers, as the rate of their ends."""
    for r in range(count):
        row = state.wished[r]
        for i in range(AXES):
            row.rate -= row.normal[i] * (output.velocity[i] - state.account.velocity[i])


@njit
def _let_go(state, count):
    """In debt springs keep no more than they hold now, less what is owed."""
    book, place = state.account, state.motion.handle
    store = rows.force(state.rows, count, place, book.velocity, book.spring, book.damper)
    nothing = store < NOTHING
    share = max(0.0, 1.0 + book.free / store) if not nothing else 0.0
    for r in range(count):
        row = state.rows[r]
        if rows.pull(row, rows.stretch(row, place), 0.0)[2] > 0.0:
            if nothing:
                row.weight = 0.0
                book.free -= NOTHING
            state.wished[r].weight = min(state.wished[r].weight, share * row.weight)


@njit
def _fit(settings, state, count, limit):
    """Weights wished for, lowered until all springs together are within the limits: who pushes yields.

    What they have let go of so comes back for what they were paid for it, or once they do not pull.
    """
    wished, place, spring, walls = state.wished, state.motion.handle, state.account.spring, state.walls
    for r in range(count):
        walls.whole[r] = wished[r].weight
    rows.force(wished, count, place, state.account.velocity, spring, state.account.damper)
    for i in range(int(settings.axes)):
        over = abs(spring[i]) - limit[i]
        if over <= 1e-12 * limit[i]:
            continue
        into = 0.0
        for r in range(count):
            into += max(0.0, _along(wished[r], place, i, spring[i]))
        for r in range(count):
            if into > 0.0 and _along(wished[r], place, i, spring[i]) > 0.0:
                wished[r].weight *= max(0.0, 1.0 - over / into)
    _regain(wished, walls, count, place)


@njit
def _regain(wished, walls, count, place):
    """Of what rows have yielded: less is taken back than the paid energy [J] allows."""
    cost, energy, share = 0.0, 0.0, 1.0
    for r in range(count):
        row, whole = wished[r], walls.whole[r]
        if walls.yielded[r] == 0.0 and row.weight == whole:
            continue
        fits, row.weight = row.weight, whole
        energy = rows.pull(row, rows.stretch(row, place), 0.0)[2]
        left = whole * (1.0 - walls.yielded[r])
        row.weight = fits
        if energy < NOTHING or whole == 0.0:
            walls.yielded[r] = 0.0
        elif fits <= left:  # yields
            walls.paid += energy * (left - fits) / whole
            walls.yielded[r] = 1.0 - fits / whole
        else:
            cost += energy * (fits - left) / whole
    if cost > 0.0:
        share = min(1.0, walls.paid / cost)
        walls.paid -= share * cost
    pulled = False
    for r in range(count):
        row, whole = wished[r], walls.whole[r]
        if walls.yielded[r] > 0.0:
            left = whole * (1.0 - walls.yielded[r])
            row.weight = min(row.weight, left + share * max(0.0, row.weight - left))
            walls.yielded[r], pulled = 1.0 - row.weight / whole, True
    walls.paid = walls.paid if pulled else 0.0


@njit
def _along(row, place, i, sign):
    """Force of a row's spring on axis i [N], positive along the sign."""
    if row.normal[i] == 0.0 or row.weight <= 0.0:
        return 0.0
    return row.normal[i] * rows.pull(row, rows.stretch(row, place), 0.0)[0] * math.copysign(1.0, sign)


@kernel
def rest(state, release):
    """A tick on old counts: the table stays, or all of it is let go. What it did the next sample tells."""
    book = state.account
    book.unseen = 1.0
    for r in range(WALLS + int(state.change.walls) if release else 0):
        state.rows[r].weight = 0.0
    for i in range(AXES if release else 0):
        book.force[i] = 0.0


@kernel
def move(settings, state, release):
    """The table in force towards the wished one, the coupling first; how far the coupling and the others went.

    release: all rows at once to no weight.
    """
    own = state.virtual_tool
    local, spare = own.spare > 0.0, own.spare
    book, hold, place = state.account, state.hold, state.motion.handle
    table, wished, trial, count = state.rows, state.wished, state.trial, WALLS + int(state.change.walls)
    taken = settings.passivity.policy == OFF and state.change.version != settings.version
    state.change.version = settings.version
    coupled = others = False
    for r in range(count):
        row, now = wished[r], table[r]
        if now.weight == 0.0:  # nothing of it is there yet
            rows.copy(row, now)
            now.weight = now.rate = 0.0
        if row.weight != now.weight or row.rate != 0.0 or (now.weight > 0.0 and not rows.same(row, now)):
            coupled, others = coupled or r < AXES, others or r >= AXES
    _own(settings.port, state, count, local)
    account.open_table(settings, book, hold, table, trial, count, place, coupled or others)
    one = other = 1.0
    # with `off` nothing waits for energy that is not there
    forced = release or taken or (settings.passivity.policy == OFF and book.free < 0.0)
    least = math.inf  # of both ends, where they are not the two of one move
    if coupled and others:
        least = min(0.0, book.least, account.needs(settings.port, wished, count, book))
    bounds = spare, forced, least
    if coupled:
        one = account.move(settings, book, hold, table, wished, trial, count, COUPLING, AXES, place, *bounds)
        book.shortened += 1.0 if one < 1.0 else 0.0
        _note_short(settings, book, one)
    if others:
        other = account.move(settings, book, hold, table, wished, trial, count, AXES, count, place, *bounds)
    return one, other


@njit
def _own(port, state, count, local):
    """The forces that the handle's own motion makes of those that were held; the own tool's way is one too."""
    table, trial, book = state.rows, state.trial, state.account
    for r in range(count):
        rows.copy(table[r], trial[r])
        if r < AXES:
            trial[r].rate = state.coupling.set_velocity[r]
            if local:
                trial[r].offset, trial[r].rate = state.wished[r].offset, state.wished[r].rate
    rows.force(trial, count, state.motion.handle, book.velocity, book.spring, book.damper)
    account.to_drives(port, book)
    for i in range(AXES):
        book.own[i] = book.spring[i] + book.damper[i]


@njit
def _note_short(settings, book, share):
    """By how much the coupling's force is short of what is wished for, over engage.force and engage.torque."""
    for i in range(AXES if share < 1.0 and book.unpaid > 0.0 else 0):
        short = abs(book.asked[i] - book.spring[i] - book.damper[i])
        book.short = max(book.short, short / (settings.engage.torque if i == 2 else settings.engage.force))


@kernel
def tell_forces(settings, state, table, output):
    """Forces that are wanted of the table's rows [N | N m], without ramp and limits, into the output."""
    place, velocity, walls = state.motion.handle, state.account.velocity, int(state.change.walls)
    for i in range(AXES):
        output.force_walls[i] = output.force_coupling[i] = 0.0
    for i in range(int(settings.axes)):
        row = table[COUPLING + i]
        spring = min(row.high, max(row.low, row.stiffness * (row.offset - place[i])))
        force = spring + row.damping * (row.rate - velocity[i])
        output.force_coupling[i] = output.exchange_fade * force if output.exchange_fade > 0.0 else 0.0
        row = state.wished[CANCELLATION + i]
        if row.weight > 0.0 and i < settings.port.joints:
            rate = row.normal[0] * output.velocity[0] + row.normal[1] * output.velocity[1]
            for k in range(2):
                force = -output.cancellation_fade * row.damping * rate * row.normal[k]
                output.force_cancellation[k] += force
        elif row.weight > 0.0:
            output.force_cancellation[i] = -output.cancellation_fade * row.damping * output.velocity[i]
    for r in range(WALLS, WALLS + walls):
        row = table[r]
        depth = rows.stretch(row, place)
        if depth > 0.0 and (row.weight > 0.0 or state.enable.ramp == 0.0):
            rate = -row.normal[0] * velocity[0] - row.normal[1] * velocity[1]
            force = virtual_wall.wall_force(row.stiffness, row.damping, depth, rate)
            output.force_walls[0] += row.normal[0] * force
            output.force_walls[1] += row.normal[1] * force
