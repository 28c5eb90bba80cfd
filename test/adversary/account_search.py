# SPDX-License-Identifier: Apache-2.0
"""Search for energy beyond the account: the servo's own tick against a plant of known places and write times.

    python test/adversary/account_search.py [paths]

A path is a motion of the hand by sub-steps, a tool sample, settings and a write's lateness in each tick, and what goes
wrong in it. Random ones are improved by a (1 + 1) search for the largest E − budget, or the largest E + S + free −
budget, where S is what the springs store at the true place.
"""

import sys

import numpy as np

from haptic_device.config.description import load_device
from haptic_device.config.parameter_types import defaults
from haptic_device.control import controller_config, enable_state, gain_check, linkage, rows, servo
from haptic_device.control.records import STATE, TICK
from haptic_device.jit import kernel, njit
from haptic_sim.node.parameters import NODES

TICKS, SUB, CHOICES = 40, 8, 6  # of a path; sub-steps of a tick; settings that a path changes between
PERIOD, VARIED = 250_000, 3  # [ns]
FASTEST = 2.0  # [m/s] of a linkage's handle, about
FINE, MISSED, STALE, ESTOP = range(4)
PATH = np.dtype(
    [("velocity", "f8", (TICKS * SUB, 3))]
    + [("place", "f8", (TICKS, 3)), ("rate", "f8", (TICKS, 3)), ("stamp", "f8", (TICKS,))]
    + [(name, "i8", (TICKS,)) for name in ("late", "settings", "event")]
)
LATENESS = ((0.0, 0.0), (0.25, 0.25), (0.5, 0.5), (1.0, 1.0), (1.25, 1.25), (0.0, 0.5), (0.0, 1.0), (0.0, 1.25))
LATENESS += ((0.25, 1.25), (0.0, 4.0), (3.5, 4.0), (4.0, 4.0))


@kernel
def run(choices, path, state, ticks, friction, grid, least, damping, out, seen):
    """Fills in out: largest E − budget, largest E + S + free − budget, largest −free [J], share of shortened ticks, and
    the largest rise of E + S + Φ + free in a tick, where no step hides a part of it.

    choices: settings, (CHOICES); friction: in the world [N | N m]; grid: the true encoder step; least: of the lateness,
    in sub-steps; damping: that the device really has, as a share. Of a linkage a path is its joints', from `zero` on,
    which stand still where the handle would leave its workspace; and tools are told from where it begins.
    """
    tick, q, counts = ticks[0], np.zeros(3), np.zeros(3)
    f, sent, arrive = np.zeros(3), np.zeros((TICKS + 1, 3)), np.full(TICKS + 1, 1 << 60)
    spring, damper, energy, writes, acting, last = np.zeros(3), np.zeros(3), 0.0, 0, -1, 0
    out[0], out[1], out[2], out[4], before, stop = -1e9, -1e9, -1e9, -1e9, 1e9, 0
    tick.sensors.write_delay = 0.0
    period, joints = round(choices[0].period * 1e9), choices[0].port.joints
    start, place, there = np.zeros(3), np.zeros(3), np.zeros(3)
    dt, latched, unit = period * 1e-9 / SUB, 0.0, np.ones(3)
    if joints > 0.0:
        _handle(choices[0], q, start)
        for i in range(int(choices[0].axes)):
            unit[i] = FASTEST / choices[0].port.fastest[i]
    for k in range(TICKS):
        settings, event = choices[path.settings[k]], path.event[k]
        budget, scale = settings.exchange.budget, settings.hardware.scale
        if event != MISSED or k == 0:
            if event != STALE or k == 0:
                unsure = settings.hardware.stamp_error * 1e9
                latched = (k + 10) * period + path.stamp[k] * unsure
                tick.sensors.stamp_error = unsure
                for i in range(3):
                    counts[i] = np.floor(q[i] / grid[i] + 0.5) * grid[i] if grid[i] > 0.0 else q[i]
            sensors, tool = tick.sensors, tick.tool
            sensors.tick, sensors.deadline, sensors.latched = k, (k + 10) * period, latched
            stop = 3 if event == ESTOP and k > 0 else max(0, stop - 1)
            sensors.command = 0 if stop > 0 else enable_state.ENABLE
            tool.session, tool.sequence, tool.answered, tool.age = 1.0, k + 1.0, k + 1.0, 0.0
            for i in range(3):
                sensors.counts[i] = counts[i] / (settings.hardware.position_per_count[i] * scale[i])
                tool.position[i], tool.velocity[i] = start[i] + unit[i] * path.place[k, i], unit[i] * path.rate[k, i]
            servo.tick(settings, state[0], tick)
            for i in range(3):
                sent[writes, i] = tick.output.torque[i] if joints > 0.0 else tick.output.force_on_handle[i] / scale[i]
                place[i] = q[i]
            if joints > 0.0:
                _handle(settings, q, place)
            acts = max(last, k * SUB + path.late[k])
            arrive[writes], last, writes = acts, acts, writes + 1
            sensors.write_delay = (acts - k * SUB - least) * dt
            book, count = state[0].account, rows.WALLS + int(state[0].change.walls)
            store = rows.force(state[0].rows, count, place, f * 0.0, spring, damper)
            late = book.late if friction[0] == 0.0 and grid[0] == 0.0 else 0.0
            free = book.free + state[0].exchange.shipped - state[0].exchange.returned
            sum_now = energy + store + free + late - budget
            if 4 * k >= TICKS and event != STALE:  # what old counts hide the next sample tells
                out[1] = max(out[1], sum_now)
            # where nothing is stored and nothing on its way a debt may end (account.forgive)
            rise = sum_now - before if book.stored > 0.0 or book.still <= settings.port.holds else 0.0
            out[4], before = max(out[4], rise), sum_now
            out[2] = max(out[2], -free)
            seen[k, 0], seen[k, 1], seen[k, 2], seen[k, 3] = energy, store, free, book.late
        for u in range(SUB):
            now = k * SUB + u
            while acting + 1 < writes and arrive[acting + 1] <= now:
                acting += 1
            stands = False
            if joints > 0.0:
                for i in range(3):
                    there[i] = q[i] + path.velocity[now, i] * dt
                stands = not _handle(settings, there, there)
            for i in range(3):
                v, force = 0.0 if stands else path.velocity[now, i], sent[acting, i] if acting >= 0 else 0.0
                b = damping * settings.hardware.damping[i] / scale[i] ** 2
                b = damping * settings.port.damping[i] if joints > 0.0 else b
                energy += (force * v - b * v * v - friction[i] * abs(v)) * dt
                q[i] += v * dt
            if 2 * k >= TICKS:
                out[0] = max(out[0], energy - budget)
    out[3] = state[0].account.shortened / TICKS


@njit
def _handle(settings, q, place):
    """Handle of a linkage whose joints have turned by q from `zero`; whether it is in its workspace."""
    zero, low, high = settings.hardware.zero, settings.hardware.position_low, settings.hardware.position_high
    x, y, _, _, _, _, c = linkage.pose(settings.linkage, q[0] - zero[0], q[1] - zero[1])
    place[0], place[1], place[2] = x, y, 0.0
    return c > 0.0 and low[0] <= x <= high[0] and low[1] <= y <= high[1]


@njit
def _clear(state):
    state.view(np.int64)[:] = 0


@njit
def _reach(choices):
    """Stretch [m] of some budgets in a spring of 1000 N/m."""
    return 4.0 * np.sqrt(2.0 * choices[0].exchange.budget / 1000.0)


@njit
def _begin(choices, path, low, high, events):
    """A random path: the hand in pieces, the tool in jumps."""
    reach = _reach(choices) * 10.0 ** (-2.0 * np.random.rand())
    speed, late, fixed = 10.0 ** (-2.0 * np.random.rand()), low, np.random.rand() < 0.3
    v, y, choice = np.zeros(3), np.zeros(3), 0
    for k in range(TICKS):
        fastest = choices[0].port.fastest
        if np.random.rand() < 0.3:
            for i in range(3):
                v[i] = speed * fastest[i] * (2.0 * np.random.rand() - 1.0) * (np.random.rand() < 0.7)
        if np.random.rand() < 0.2:
            for i in range(3):
                y[i] = reach * fastest[i] * (2.0 * np.random.rand() - 1.0)
        if np.random.rand() < 0.15:
            choice = int(CHOICES * np.random.rand())
        if np.random.rand() < 0.3:
            late = low + int((high - low + 1) * np.random.rand())
        path.late[k], path.settings[k], path.event[k] = high if fixed else late, choice, FINE
        for i in range(3):
            path.place[k, i], path.rate[k, i] = y[i], 0.0
            if np.random.rand() < 0.1:
                path.rate[k, i] = fastest[i] * (2.0 * np.random.rand() - 1.0)
            for u in range(SUB):
                path.velocity[k * SUB + u, i] = v[i]
        path.stamp[k] = 2.0 * np.random.rand() - 1.0
        if np.random.rand() < events:
            path.event[k] = int(4 * np.random.rand())
    if events > 0.0 and np.random.rand() < 0.3:  # a hold of many periods
        start = 1 + int((TICKS - 2) * np.random.rand())
        for k in range(start, min(TICKS, start + 1 + int(20 * np.random.rand()))):
            path.event[k] = MISSED


@njit
def _vary(choices, path, low, high, events):
    fastest = choices[0].port.fastest
    for _ in range(1 + int(VARIED * np.random.rand())):
        what, start = np.random.rand(), int(TICKS * np.random.rand())
        end = min(TICKS, start + 1 + int(10.0 ** (1.3 * np.random.rand())))
        axis = int(3 * np.random.rand())
        if what < 0.5:
            first, last = start * SUB, end * SUB
            if np.random.rand() < 0.35:
                first = int(TICKS * SUB * np.random.rand())
                last = min(TICKS * SUB, first + 1 + int(2 * SUB * np.random.rand()))
            mix, factor = np.random.rand(), 1.0 + 0.6 * (np.random.rand() - 0.5)
            v = 10.0 ** (-2.5 * np.random.rand()) * fastest[axis] * (1.0 if np.random.rand() < 0.5 else -1.0)
            for n in range(first, last):
                for i in range(3):
                    if mix < 0.4 and i == axis:
                        path.velocity[n, i] = v
                    elif mix < 0.75 and i == axis:
                        path.velocity[n, i] += v
                    elif 0.75 <= mix < 0.9:
                        path.velocity[n, i] *= factor
                    elif mix >= 0.9:
                        path.velocity[n, i] *= -1.0
                    path.velocity[n, i] = min(fastest[i], max(-fastest[i], path.velocity[n, i]))
        elif what < 0.72:
            mix, y = np.random.rand(), _reach(choices) * 10.0 ** (-3.0 * np.random.rand()) * fastest[axis]
            y *= 1.0 if np.random.rand() < 0.5 else -1.0
            for k in range(start, end):
                if mix < 0.4:
                    path.place[k, axis] = y
                elif mix < 0.7:
                    path.place[k, axis] += 0.1 * y
                elif mix < 0.8:
                    path.place[k, axis] *= -1.0
                else:
                    path.rate[k, axis] = 50.0 * y if mix < 0.95 else 0.0
        elif what < 0.82:
            choice = int(CHOICES * np.random.rand())
            for k in range(start, end):
                path.settings[k] = choice
        elif what < 0.85:
            path.stamp[start] = 1.0 if np.random.rand() < 0.5 else -1.0
        elif what < 0.92 or events == 0.0:
            late = low + int((high - low + 1) * np.random.rand())
            for k in range(start, end):
                path.late[k] = late
        else:
            path.event[start] = int(4 * np.random.rand())


@kernel
def search(seed, kind, choices, state, ticks, friction, grid, damping, least, low, high, starts, tries, events, paths):
    """Largest (E − budget, E + S + free − budget, −free, rise of E + S + Φ + free) [J] of all paths.

    paths[0]: the best of its kind; paths[1:3]: room to work in.
    """
    np.random.seed(seed)
    worst, out, seen, most = np.full(4, -1e9), np.zeros(5), np.zeros((TICKS, 4)), -1e9
    best, known, tried = paths[0:1], paths[1:2], paths[2:3]
    for _ in range(starts):
        _begin(choices, known[0], low, high, events)
        _clear(state)
        run(choices, known[0], state, ticks, friction, grid, least, damping, out, seen)
        value = out[kind]
        for _ in range(tries):
            tried.view(np.int64)[:] = known.view(np.int64)
            _vary(choices, tried[0], low, high, events)
            _clear(state)
            run(choices, tried[0], state, ticks, friction, grid, least, damping, out, seen)
            for i in range(2):
                worst[i] = max(worst[i], out[i])
            worst[2], worst[3] = max(worst[2], out[2]), max(worst[3], out[4])
            if out[kind] >= value:
                value = out[kind]
                known.view(np.int64)[:] = tried.view(np.int64)
        if value > most:
            most = value
            best.view(np.int64)[:] = known.view(np.int64)
    return worst


def settings_for(
    seed, least, most, over, budget, step=0.0, slew=1e9, limit=15.0, walls=2, method="direct", told=None, **more
):
    """CHOICES of random SETTINGS on one device, whose damping is `over` times the largest need."""
    random, period = np.random.default_rng(seed), PERIOD * 1e-9
    values = defaults(NODES["haptic_driver"]) | {"servo.rate": 4000.0, "exchange.method": method}
    one = controller_config.settings_unjudged(load_device("desktop"), values)
    choices = np.repeat(one, CHOICES)
    device = choices["hardware"]
    scale, counted = more.get("scale", 1.0), max(step, 1e-9)
    device["scale"], device["position_per_count"] = scale, np.array((counted, counted, 10.0 * counted)) / scale
    device["zero"], device["friction"], device["gravity"], device["motor_per_force"] = 0.0, 0.0, 0.0, 1.0
    device["motor_limit"], device["velocity_limit"] = scale * more.get("motor", 1e3), np.array((1.0, 1.0, 10.0)) / scale
    device["position_low"], device["position_high"] = -1e3, 1e3
    device["delay"], device["stamp_error"] = least * period, more.get("unsure", 0.0) * period
    choices["exchange"]["budget"] = choices["exchange"]["tank"] = budget
    choices["exchange"]["slew"], choices["exchange"]["hold"] = (slew, slew, 0.1 * slew), 1.0
    choices["engage"]["time"], choices["engage"]["force"], choices["engage"]["torque"] = period, 1e9, 1e9
    choices["fault"]["saturation"] = choices["fault"]["silence"] = choices["fault"]["duty"] = 1e9
    choices["coupling"]["limit"] = choices["force"]["limit"] = (limit, limit, 0.1 * limit)
    for k, each in enumerate(choices):
        each["version"] = k + 1
        share = random.random(6) ** (random.random(6) < 0.5)
        each["coupling"]["stiffness"] = share[:3] * (2000.0, 1500.0, 1.0)
        each["coupling"]["damping"] = share[3:] * (0.5, 0.3, 2e-4)
        count = int(random.integers(0, walls + 1)) if walls else 0
        each["wall"]["count"] = count
        angle = random.random(count) * 2.0 * np.pi * (random.random() < 0.7)
        each["wall"]["x"][:count], each["wall"]["y"][:count] = np.cos(angle), np.sin(angle)
        each["wall"]["offset"][:count] = 0.004 * (random.random(count) - 0.7)
        each["wall"]["stiffness"][:count] = 1500.0 * random.random(count)
        each["wall"]["damping"][:count] = 0.4 * random.random(count)
        if more.get("cancel") and random.random() < 0.5:
            each["cancellation"]["ratio"] = 0.3 * random.random()
    low, high = told or (least, most)
    high += more.get("unsure", 0.0)
    device["damping"] = 1e9, 1e9, 1e9
    device["delay"] = low * period
    need = np.max([_need(each, high * period) for each in choices], axis=0)
    most_cancelled = 1.5 * float(choices["cancellation"]["ratio"].max())
    device["damping"] = scale**2 * (over * need + (1e-6, 1e-6, 1e-8)) / (1.0 - most_cancelled)
    for k in range(CHOICES):
        controller_config._set_port(choices[k])
        gain_check.counted(choices[k : k + 1], high * period)
        if step == 0.0:
            choices[k]["port"]["step"] = 0.0
    return choices


def _need(settings, lateness):
    """Damping that all but cancellation needs, in the world."""
    settings = settings.copy()
    settings["cancellation"]["ratio"] = 0.0
    controller_config._set_port(settings)
    left = gain_check._left(settings, lateness) / settings["hardware"]["scale"] ** 2
    return (settings["port"]["damping"] - left).max(axis=0)


def attack(
    seed, least, most, over, budget, kind, starts=3, tries=500, step=0.0, events=0.0, damping=1.0, told=None, **more
):
    """Worst of a search (search), of random settings (settings_for); and the settings, and the best path."""
    choices = settings_for(seed, least, most, over, budget, step, told=told, **more)
    state, ticks = np.zeros(1, STATE).view(np.recarray), np.zeros(1, TICK).view(np.recarray)
    paths = np.zeros(3, PATH).view(np.recarray)
    grid = np.array((step, step, 10.0 * step))
    friction = np.max([-gain_check.friction_left(each) for each in choices], axis=0) if step else np.zeros(3)
    friction /= choices["hardware"]["scale"][0]
    if more.get("blind"):
        choices["port"]["step"] = 0.0
    if more.get("forget"):
        choices["port"]["holds"] = 0.0
    low, high = round(least * SUB), round(most * SUB)
    told_least = float(choices["hardware"]["delay"][0]) / (PERIOD * 1e-9) * SUB
    arguments = (choices.view(np.recarray), state, ticks, friction, grid, damping, told_least, low, high)
    return search(seed, kind, *arguments, starts, tries, events, paths), choices, paths


if __name__ == "__main__":
    tries = int(sys.argv[1]) // 12 if len(sys.argv) > 1 else 400
    for name, more in (
        ("plain", {}),
        ("encoder 5 um", {"step": 5e-6}),
        ("events", {"step": 5e-6, "events": 0.05}),
        ("slew", {"slew": 400.0, "method": "pspm"}),
        ("motor 7 N", {"motor": 7.0}),
        ("stamps", {"unsure": 0.1}),
        ("scaled", {"scale": 3.0, "step": 5e-6, "events": 0.05, "cancel": True}),
    ):
        for least, most in LATENESS:
            worst = np.full(4, -np.inf)
            for seed, over, budget, kind in (
                (1, 1.0, 2e-5, 1),
                (2, 1.3, 2e-5, 0),
                (3, 3.0, 5e-3, 1),
                (4, 1.0, 5e-3, 0),
            ):
                worst = np.maximum(worst, attack(seed, least, most, over, budget, kind, 3, tries, **more)[0])
            told = "  ".join(f"{1e6 * value:12.5f}" for value in worst)
            print(f"{name:14s} late {least}..{most}: E - budget, E + S + a - budget, -a, rise [uJ]: {told}", flush=True)
