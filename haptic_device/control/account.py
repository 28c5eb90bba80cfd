# SPDX-License-Identifier: Apache-2.0
"""The one account of energy, for every row of the table (control/rows); proof: docs/theory/passivity.md.

    V = S + Φ,      E ≤ budget − free − V at every sample, and free ≥ 0 while holds are as planned                  (1)

E is the energy [J] that the hand was given beyond what the device's damping took, S what the springs store, Φ the most
that forces can give which are sent and will act later, and dampers in the hold that begins (`promised`). A standing
table whose damping is enough (`needs`) never lets `free` fall; a change of the table costs V' − V (`move`); a hold that
was not planned is booked by the forces that acted and by its ends (`book`).

An axis here is what a motor drives: of a linkage its joints, where a torque held over a hold does exactly τ Δθ. There
the table is the one of the plane that touches the handle's way at the last sample: x ≈ p(θ) + J Δθ, so that for each
hold all of the above stands. That the next sample's plane is another is a change of the table, and costs V' − V
(`_turn_plane`).
"""

import math

from haptic_device.config.kinematics import GRID
from haptic_device.control import actuation_delay, faults, linkage, rows
from haptic_device.control.records import AXES, HELD
from haptic_device.jit import kernel, njit

WINDOW = 16.0  # holds over which what the hand dissipates is counted from one start
TRIALS = 6  # shares of a move that are tried
LONG = 1.5  # periods: a longer hold is one of a missed tick
ROUNDING = 4e-9  # [s] of a hold that is no hold
LEAST = 1e-9  # [N | N m] of a force that is no change


@kernel
def needs(port, table, count, account):
    """What of the damping no standing row needs into account.left; the least of it, as a share of the damping.

    With T K and |B| of all rows, as diagonals above their matrices: b ≥ n₀ T K + n₁ |B|, n of the lateness.
    """
    stiff, damp, blur, least = account.stiff, account.damp, account.blur_now, 1.0
    for i in range(AXES):
        stiff[i] = damp[i] = blur[i] = 0.0
    joints = int(port.joints)
    if joints > 0:
        _need_of_joints(port, table, count, account)
    for r in range(count):
        row = table[r]
        if row.weight <= 0.0 or (joints > 0 and row.normal[2] == 0.0):
            continue
        n, stiffness, damping = row.normal, row.weight * row.stiffness, row.weight * abs(row.damping)
        reach = abs(n[0]) * port.fastest[0] + abs(n[1]) * port.fastest[1] + abs(n[2]) * port.fastest[2]
        counts = abs(n[0]) * port.step[0] + abs(n[1]) * port.step[1] + abs(n[2]) * port.step[2]
        for i in range(AXES):
            if n[i] != 0.0 and port.fastest[i] > 0.0:
                share = abs(n[i]) / port.fastest[i] * reach
                stiff[i] += port.period * share * stiffness
                damp[i] += share * damping
                blur[i] += abs(n[i]) * (stiffness + damping / port.period) * counts
    for i in range(AXES):
        account.left[i] = account.damping[i] - port.needs[0] * stiff[i] - port.needs[1] * damp[i]
        if account.damping[i] > 0.0:
            least = min(least, account.left[i] / account.damping[i])
        # what an encoder step hides of the forces that are still on their way
        account.blur[i] = max(blur[i], account.blur_kept[i])
    return least


@njit
def _need_of_joints(port, table, count, account):
    """The same of a linkage's joints, of rows in the plane: λ b ≽ Σ K n nᵀ, n = Jᵀ normal, the least λ; so of |B|."""
    k00 = k01 = k11 = b00 = b01 = b11 = 0.0
    jacobian, damping, blur = account.jacobian, account.damping, account.blur_now
    for r in range(count):
        row = table[r]
        if row.weight <= 0.0 or row.normal[2] != 0.0:
            continue
        a, b, _ = along(port, jacobian, row.normal)
        stiffness, damper = row.weight * row.stiffness, row.weight * abs(row.damping)
        k00, k01, k11 = k00 + stiffness * a * a, k01 + stiffness * a * b, k11 + stiffness * b * b
        b00, b01, b11 = b00 + damper * a * a, b01 + damper * a * b, b11 + damper * b * b
        counts = (stiffness + damper / port.period) * (abs(a) * port.step[0] + abs(b) * port.step[1])
        blur[0], blur[1] = blur[0] + abs(a) * counts, blur[1] + abs(b) * counts
    second = damping[1] if port.joints > 1.0 else 0.0
    stiffness = port.period * linkage.largest(k00, k01, k11, damping[0], second)
    damper = linkage.largest(b00, b01, b11, damping[0], second)
    for i in range(int(port.joints)):
        account.stiff[i], account.damp[i] = stiffness * damping[i], damper * damping[i]


@njit
def along(port, jacobian, normal):
    """Direction (3) in which a row acts on what the motors drive: its normal, or Jᵀ normal."""
    x, y = normal[0], normal[1]
    if port.joints == 0.0:
        return x, y, normal[2]
    return jacobian[0, 0] * x + jacobian[1, 0] * y, jacobian[0, 1] * x + jacobian[1, 1] * y, normal[2]


@kernel
def at_poses(settings, port, table, count, account, shares):
    """Fills in what `needs` leaves of its joints' damping all over a linkage's workspace: shares by places of x, y."""
    low, high = settings.hardware.position_low, settings.hardware.position_high
    for m in range(shares.shape[0]):
        for n in range(shares.shape[1]):
            x = low[0] + (high[0] - low[0]) * m / (GRID - 1)
            y = low[1] + (high[1] - low[1]) * n / (GRID - 1)
            shares[m, n] = at_pose(settings, port, table, count, account, x, y)


@kernel
def at_pose(settings, port, table, count, account, x, y):
    """What `needs` leaves of its joints' damping with a linkage's handle at this place of the device [m], as a share.

    Cancellation acts on the joints.
    """
    a, b, _ = linkage.angles(settings.linkage, x, y)
    found, scale, jacobian = linkage.pose(settings.linkage, a, b), settings.hardware.scale[0], account.jacobian
    jacobian[0, 0], jacobian[0, 1] = scale * found[2], scale * found[3]
    jacobian[1, 0], jacobian[1, 1] = scale * found[4], scale * found[5]
    for i in range(int(port.joints)):
        linkage.joint_normal(jacobian, port.joints, i, table[rows.CANCELLATION + i].normal)
    needs(port, table, count, account)
    return account.left[0] / account.damping[0]


@kernel
def count_damping(settings, account, hold, table, count, place, share):
    """The damping that counts from this tick on: this share of it, or less where less is on its way (measured drag).

    A fall of it costs what V grows by, as any change.
    """
    port, low, at = settings.port, share, int(hold.newest)
    for m in range(int(port.holds)):
        low = min(low, account.shares[(at - m) % HELD])
    account.share = share
    if low * port.damping[0] == account.damping[0] and low * port.damping[2] == account.damping[2]:
        return
    value = weigh(port, account, at, table, count, place, 0.0)
    for i in range(AXES):
        account.damping[i] = low * port.damping[i]
    account.free -= max(0.0, weigh(port, account, at, table, count, place, 0.0) - value)


@njit
def worth(x, damping, fastest):
    """max over |v| ≤ fastest of x v − damping v² [W], and that v."""
    x = abs(x)
    if x <= 2.0 * damping * fastest:
        return (0.25 * x * x / damping, 0.5 * x / damping) if x > 0.0 else (0.0, 0.0)
    return (x - damping * fastest) * fastest, fastest


@njit
def kept(port, account, i, holds):
    """Damping [N s/m] that pays for a force which may act for so many holds more."""
    return max(0.0, account.left[i]) + port.needs[2] * holds * account.stiff[i] + port.needs[3] * account.damp[i]


@kernel
def promised(port, account, newest, now, sign):
    """Φ [J] of all forces sent and of `now`, which acts beside the springs; and its part in the hold that begins.

    sign: 1 for the most, −1 for the least that an encoder step leaves open.
    """
    total, first = 0.0, 0.0
    for h in range(int(port.holds)):
        for layer in range(3):
            part, most = port.layers[layer, 1] - port.layers[layer, 0], 0.0
            if part <= 0.0:
                continue
            holds = int(port.layers[layer, 3]) - h
            for m in range(max(0, int(port.layers[layer, 2]) - h), holds + 1):
                one = 0.0
                for i in range(AXES):
                    x = now[i] if m == 0 else account.sent[(newest - m + 1) % HELD, i] - account.spring[i]
                    x = max(0.0, abs(x) + sign * account.blur[i])
                    one += worth(x, kept(port, account, i, holds), port.fastest[i])[0]
                most = max(most, one)
            total += part * port.period * most
        first = total if h == 0 else first
    return total, first


@njit
def to_drives(port, account):
    """Forces of springs and dampers on the handle, as those of what the motors drive."""
    if port.joints > 0.0:
        linkage.to_joints(account.jacobian, account.spring)
        linkage.to_joints(account.jacobian, account.damper)


@kernel
def weigh(port, account, newest, table, count, place, sign):
    """S, Φ, forces and what is left of the damping of a table at the sample, into the account; V [J]."""
    account.store = rows.force(table, count, place, account.velocity, account.spring, account.damper)
    to_drives(port, account)
    account.least = needs(port, table, count, account)
    account.late, _ = promised(port, account, newest, account.damper, sign)
    return account.store + account.late


@kernel
def book(settings, account, table, count, hold, motion, sensors):
    """The hold that ends here; the table's rates end with it.

    One that was as planned costs nothing; of the promise that was not used, and of what the hand dissipated beyond what
    is counted with, what is certain comes back. Another is booked by the forces that acted and by its ends:

        E' − E ≤ F̄ Δx − b Δx²/t + Σ (f − F̄)² τ/4b                                                                  (2)
    """
    port, time, known = settings.port, motion.elapsed, account.filled
    if not known:
        account.filled, account.free, account.window = 1.0, settings.exchange.budget, WINDOW
        for m in range(HELD):
            account.shares[m] = 1.0
        for i in range(AXES):
            account.damping[i] = port.damping[i]
        _touch(settings, account, motion)
    same = known and account.counted_least == port.least and account.counted_most == port.most
    same = same and account.counted_ratio == port.ratio
    account.counted_least, account.counted_most, account.counted_ratio = port.least, port.most, port.ratio
    # a write beyond the plan, now or in a hold before this one
    late = sensors.write_delay + settings.hardware.delay + settings.hardware.stamp_error
    account.overdue = port.holds + 1.0 if late > port.most + ROUNDING else max(0.0, account.overdue - 1.0)
    if time <= 0.0:
        return
    cut, longest = int(sensors.device_status) & faults.CUT, time + motion.unsure
    planned = same and not cut and account.unseen == 0.0 and longest <= LONG * port.period
    joints = int(port.joints)
    for i in range(AXES):
        account.way[i] = motion.turned[i] if i < joints else settings.hardware.scale[i] * motion.moved[i]
        account.velocity[i] = account.way[i] / longest if motion.clutched == 0.0 else 0.0
        # a longer hold needs as much more damping: of what is left, or else its own way pays
        more = max(0.0, longest - port.period - ROUNDING) / port.period * (account.damping[i] - account.left[i])
        account.more[i] = min(more, max(0.0, account.left[i]))
        account.lacks[i] = max(0.0, more - account.left[i])
    if joints > 0:
        account.velocity[0], account.velocity[1] = linkage.motion_of(account.jacobian, account.velocity)
    given = _given(settings, account, hold, motion, time, longest, cut)
    if planned:
        _book_planned(settings, account, hold, motion, time)
    for r in range(count):
        table[r].rate = 0.0
    if joints > 0:
        _turn_plane(settings, account, table, count, hold, motion, planned)
    if not planned:
        before = account.stored + account.deposit
        account.free += before - given - weigh(port, account, int(hold.newest), table, count, motion.handle, 1.0)
        for i in range(AXES):  # half an encoder step at either end
            both = abs(account.beside[i]) + abs(account.beside[i] + account.spring_before[i] - account.spring[i])
            account.free -= 0.5 * port.step[i] * both
            account.given += 0.5 * port.step[i] * both
        account.window, account.unseen = WINDOW, 0.0


@njit
def _touch(settings, account, motion):
    """The plane that touches a linkage's way where it is now, in the world."""
    for i in range(2):
        for j in range(2):
            account.jacobian[i, j] = settings.hardware.scale[i] * motion.jacobian[i, j]
    for i in range(AXES):
        account.place[i] = motion.handle[i]


@njit
def _turn_plane(settings, account, table, count, hold, motion, planned):
    """From the last sample's plane to this one's: by V' − V, where what went before was counted as planned."""
    port, newest, place, value = settings.port, int(hold.newest), account.place, 0.0
    if planned:
        if motion.clutched == 0.0:
            x, y = linkage.motion_of(account.jacobian, account.way)
            place[0], place[1], place[2] = place[0] + x, place[1] + y, motion.handle[2]
        value = weigh(port, account, newest, table, count, place, 0.0)
    _touch(settings, account, motion)
    if planned:
        account.free -= weigh(port, account, newest, table, count, place, 0.0) - value


@njit
def _given(settings, account, hold, motion, time, longest, cut):
    """(2), into energy_given by axis; the sum of all [J]. Fills in account.beside: F̄ − 2 b Δx/t less the spring."""
    port, total = settings.port, 0.0
    for i in range(int(settings.axes)):
        way, b, fastest = account.way[i], account.damping[i], port.fastest[i]
        mean, square = actuation_delay.acted(hold, account.sent, i, motion.sample_time, time)
        unknown = 0.0
        if motion.unsure > 0.0:
            off, more = actuation_delay.unsure(hold, account.sent, i, motion, motion.sample_time, time, mean)
            unknown, square = off * abs(way), square + more
        unknown += max(0.0, -mean * way) if cut else 0.0
        spread = _spread(square, b, fastest, longest)
        made = mean * way - b * way * way / longest + spread + unknown
        account.energy_given[i] += made
        # what the motor gave at most: a count that flickers goes nowhere, and dissipates nothing
        if cut:  # at some time in this hold: Σ (f − F̄)² τ is most where half of it had no force
            spread = _spread(square + 0.25 * mean * mean * longest, b, fastest, longest)
        account.given += mean * _sure_way(port, account, motion, i) + spread + unknown
        account.beside[i] = mean - 2.0 * b * way / longest - account.spring[i]
        account.spring_before[i] = account.spring[i]
        total += made
    return total


@njit
def _spread(square, damping, fastest, time):
    """Most [J] that forces which change within a hold may give; square: Σ (f − F̄)² τ [N² s]."""
    most = fastest * math.sqrt(square * time)
    return min(most, square / (4.0 * damping)) if damping > 0.0 else most


@njit
def _sure_way(port, account, motion, i):
    """Way of axis i in this hold [m | rad], with half an encoder step of play."""
    half, place = 0.5 * port.step[i], account.from_start[i] + account.way[i]
    account.from_start[i] = place
    before = account.followed[i]
    account.followed[i] = min(place + half, max(place - half, before))
    return account.followed[i] - before


@njit
def _book_planned(settings, account, hold, motion, time):
    """A hold as it was planned: what comes back of it."""
    port, begin, end, at = settings.port, motion.sample_time - time * 1e9, motion.sample_time, int(hold.newest)
    if account.window >= WINDOW:
        account.window, account.time, account.error = 0.0, 0.0, motion.unsure * 1e9 - motion.sample_error
        for i in range(AXES):
            account.gone[i] = account.worst[i] = account.earned[i] = account.lost[i] = account.dim[i] = 0.0
            account.hazy[i] = account.single[i] = 0.0
            account.earn[i], account.lossy[i] = math.inf, account.damping[i]
    account.window, account.time = account.window + 1.0, account.time + time
    used, most, top = 0.0, 0.0, 0.0
    for i in range(AXES):
        account.fast[i], account.one_worst[i] = 0.0, account.worst[i]
    for _ in range(HELD):
        start = max(begin, hold.acts[at])
        if start < end:
            one, high, peak = _use(port, account, at, (start - begin) * 1e-9, (end - begin) * 1e-9, time)
            used, most, top, end = used + one, most + high, max(top, peak), start
        if end <= begin:
            break
        at = (at - 1) % HELD
    extra = max(0.0, time - port.period - ROUNDING) * top  # of a hold that lasts longer
    back = account.sure - most - motion.unsure * top
    if account.overdue > 0.0 or used - extra - ROUNDING * top > account.planned:
        account.free += back
    else:
        account.free += max(0.0, back) - extra
    longest, time = time + motion.unsure, account.time + (account.error + motion.sample_error) * 1e-9
    for i in range(AXES):
        if account.lacks[i] > 0.0:
            way = abs(account.way[i]) + port.step[i]
            account.free -= account.lacks[i] * way * way / longest
        account.gone[i] += account.way[i]
        account.hazy[i] += motion.unsure * account.fast[i]
        account.dim[i] = max(account.dim[i], account.blur[i])
        kept_now = kept(port, account, i, int(port.whole)) - account.more[i]
        account.earn[i], account.lossy[i] = min(account.earn[i], kept_now), min(account.lossy[i], account.damping[i])
        gone = max(0.0, abs(account.gone[i]) - port.step[i])
        lost = max(account.lost[i], account.lossy[i] * gone * gone / time)
        account.given, account.lost[i] = account.given - (lost - account.lost[i]), lost
        # of this hold alone, and of the window in one
        one = abs(account.way[i] - (account.worst[i] - account.one_worst[i])) - motion.unsure * account.fast[i]
        account.single[i] += _certain(one, kept_now, port.step[i], account.blur[i], longest)
        whole = abs(account.gone[i] - account.worst[i]) - account.hazy[i]
        sure = _certain(whole, account.earn[i], port.step[i], account.dim[i], time)
        more = max(0.0, max(sure, account.single[i]) - account.earned[i])
        account.free, account.earned[i] = account.free + more, account.earned[i] + more


@njit
def _certain(way, damping, step, blur, time):
    """b (way − Δ − ε t/2b)²/t [J], of what is certain of a way [m | rad]."""
    if damping <= 0.0:
        return 0.0
    sure = max(0.0, way - step - 0.5 * blur / damping * time)
    return damping * sure * sure / time


@njit
def _use(port, account, at, begin, end, time):
    """What the force at this place of the pipe used, and at most, of the promise from `begin` to `end` [s] in the hold,
    and its greatest power [W]."""
    used, most, peak = 0.0, 0.0, 0.0
    for layer in range(3):
        part = min(end, port.layers[layer, 1] * time) - max(begin, port.layers[layer, 0] * time)
        if part <= 0.0:
            continue
        one, high = 0.0, 0.0
        for i in range(AXES):
            x = account.sent[at, i] - account.spring[i]
            b = kept(port, account, i, int(port.layers[layer, 3])) - account.more[i]
            power, speed = worth(x, b, port.fastest[i])
            one += power
            high += worth(abs(x) + account.blur[i], b, port.fastest[i])[0]
            account.worst[i] += math.copysign(speed, x) * part
            account.fast[i] = max(account.fast[i], speed)
        used, most, peak = used + one * part, most + high * part, max(peak, high)
    return used, most, peak


@njit
def _hidden(port, account, table, wished, first, end, place):
    """What a change of rows may cost more, as the handle is up to half an encoder step from `place` [J], in V."""
    cost, step = 0.0, port.step
    for r in range(first, end):
        a, b = table[r], wished[r]
        if a.weight == b.weight and rows.same(a, b):
            continue
        x, y, most = rows.stretch(a, place), rows.stretch(b, place), 0.0
        p, q = along(port, account.jacobian, a.normal), along(port, account.jacobian, b.normal)
        e = 0.5 * (abs(p[0]) * step[0] + abs(p[1]) * step[1] + abs(p[2]) * step[2])
        f = 0.5 * (abs(q[0]) * step[0] + abs(q[1]) * step[1] + abs(q[2]) * step[2])
        for k in range(-1, 2):
            before, after, one = rows.pull(a, x + k * e, 0.0)[0], rows.pull(b, y + k * f, 0.0)[0], 0.0
            for i in range(AXES):
                one += abs(q[i] * after - p[i] * before) * step[i]
            most = max(most, one)
        cost += most
    return cost


@kernel
def open_table(settings, account, hold, table, trial, count, place, changes):
    """Weighs the table as it stands; trial is a copy of it from now on. changes: whether moves follow."""
    for r in range(count):
        rows.copy(table[r], trial[r])
    # what a change costs is not known better than by an encoder step
    account.sign = -1.0 if changes else 0.0
    account.value = weigh(settings.port, account, int(hold.newest), table, count, place, account.sign)


@kernel
def move(settings, account, hold, table, wished, trial, count, first, end, place, spare, forced, least):
    """Rows from first to end towards those that are wished for; returns the share 0…1 of the way that they went.

    As far as V' − V is paid and `spare` [J] is left, no mixture needs more damping than both ends, and the force
    changes by no more than the handle's own motion makes of it and the slew. The table is weighed, before and after.
    forced: all of the way, whatever it costs. least: what `needs` leaves at the worse of the two ends; inf: this move
    goes there.
    """
    port, newest, alone = settings.port, int(hold.newest), least == math.inf
    least = min(0.0, account.least) if alone else least
    best, share, high, cost, beside, tried = 0.0, 1.0, 1.0, 0.0, 0.0, -1.0
    there = max(0.0, account.free - spare)
    for n in range(TRIALS):
        rows.blend(table, wished, first, end, share, trial)
        value = weigh(port, account, newest, trial, count, place, 1.0)
        hidden = _hidden(port, account, table, trial, first, end, place)
        price = value - account.value + hidden
        turn, tried = _turn(port, account), share
        account.unpaid = (1.0 if price > there else 0.0) if n == 0 else account.unpaid
        for i in range(AXES if n == 0 else 0):
            account.asked[i] = account.spring[i] + account.damper[i]
        # no mixture needs more than the table that stands or the one wished for
        least = min(least, account.least) if n == 0 and alone else least
        enough = account.least >= least
        if forced or (enough and turn <= 1.0 and price <= there):
            best, cost, beside = share, price, hidden
            if share == 1.0:
                break
        else:
            high = share
        if best > 0.0:
            share = 0.5 * (best + high)
            continue
        # force and price go about as the share does
        guess = 0.999 / turn if turn > 1.0 else 1.0
        guess = min(guess, 0.999 * there / price) if price > there > 0.0 else guess
        share *= guess if n == 0 and guess < 1.0 else min(0.5, guess)
    if tried != best:
        rows.blend(table, wished, first, end, best, trial)
        sign = 1.0 if best > 0.0 else account.sign
        cost = weigh(port, account, newest, trial, count, place, sign) - account.value + beside
    for r in range(first, end):
        rows.copy(trial[r], table[r])
    account.free, account.given = account.free - cost, account.given + beside
    account.value, account.sign = account.store + account.late, 1.0 if best > 0.0 else account.sign
    return best


@njit
def _turn(port, account):
    """By how many slews the force of an axis is beside both that which was held and that which the handle's own motion
    has made of it; the greatest."""
    most = 0.0
    for i in range(AXES):
        force, reach = account.spring[i] + account.damper[i], port.slew[i] * port.period
        low, high = min(account.was[i], account.own[i]), max(account.was[i], account.own[i])
        beside = max(0.0, max(low - force, force - high) - LEAST)
        if beside > 0.0:
            most = max(most, beside / reach if reach > 0.0 else math.inf)
    return most


@kernel
def settle(settings, account, hold, limit):
    """The force that is sent into account.sent, within ±limit [N | N m], and all that the next tick must know of it.

    What the limit cuts is taken from the account unasked. The table is weighed. A linkage's torques are cut together,
    so that the force on the handle keeps its direction.
    """
    port, newest, whole, still, joints = settings.port, int(hold.newest), True, True, int(settings.port.joints)
    for i in range(AXES):
        account.was[i] = account.spring[i] + account.damper[i]
    share = _share_within(settings, account, limit) if joints > 0 else 1.0
    for i in range(AXES):
        force = share * account.was[i] if i < joints else min(limit[i], max(-limit[i], account.was[i]))
        whole, still = whole and force == account.was[i], still and force == 0.0
        account.force[i] = force
        account.damper[i] = account.damper[i] if force == account.was[i] else force - account.spring[i]
        if account.blur_now[i] >= account.blur_kept[i] or account.blur_age[i] >= port.holds:
            account.blur_kept[i], account.blur_age[i] = account.blur_now[i], 0.0
        account.blur_age[i] += 1.0
    account.still = account.still + 1.0 if still else 0.0
    if not whole:
        late, _ = promised(port, account, newest, account.damper, account.sign)
        account.free -= late - account.late
        account.late = late
    account.stored = account.store
    account.deposit, account.sure = promised(port, account, newest, account.damper, -1.0)
    _, account.planned = promised(port, account, newest, account.damper, 0.0)


@njit
def _share_within(settings, account, limit):
    """Share of a linkage's torques that its motors have, and that the handle's limit allows."""
    share, was, most = 1.0, account.was, settings.hardware.motor_limit
    for i in range(int(settings.port.joints)):
        share = min(share, most[i] / abs(was[i])) if abs(was[i]) > most[i] else share
    force = linkage.to_handle(account.jacobian, settings.port.joints, was)
    for i in range(2):
        share = min(share, limit[i] / abs(force[i])) if abs(force[i]) > limit[i] else share
    return share


@kernel
def ship(settings, account, exchange, spare):
    """What the account has beyond its keep and `spare` [J] goes to the simulation, which sends it back at most once."""
    over = account.free - spare - settings.exchange.tank
    if over > 0.0:
        exchange.shipped += over
        account.free -= over


@kernel
def forgive(settings, account, exchange):
    """Nothing is stored and nothing on its way: what was booked beyond what was given ends.

    E is at most Σ (2), so `free` may rise to budget − E − shipped + returned, and never above the budget: who lets go
    and begins again gets no second one.
    """
    # of what the hand lost in the past no more counts than the account holds, and one budget
    held = exchange.returned - exchange.shipped - max(0.0, account.free) - account.stored - account.late
    account.given = max(account.given, held)
    if account.stored == 0.0 and account.still > settings.port.holds:
        budget = settings.exchange.budget
        level = budget - account.given - exchange.shipped + exchange.returned
        account.free = max(account.free, min(budget, level))
