# SPDX-License-Identifier: Apache-2.0
"""Search for energy beyond the account on linkages: the servo's own tick against joints of known angles.

    python test/adversary/linkage_search.py [paths]

A path is joint speeds, else as of account_search. Gains are at a share of the bound of the worst pose, limits are far
off. The table: which stiffness of a wall lets a hand draw energy at a pose that stays, beside the closed form.
"""

import functools
import itertools
import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[1]))  # of this package

from adversary import account_search
from adversary.account_search import CHOICES, LATENESS, PATH, SUB, TICKS
from haptic_device.config import description
from haptic_device.config.parameter_types import defaults
from haptic_device.control import account, controller_config, gain_check, linkage
from haptic_device.control.records import ACCOUNT, STATE, TICK
from haptic_sim.node.parameters import NODES

DEVICES = "haply_2diy_gen3", "haply_2diy_gen2", "pantograph_mk2", "serial_2r", "hapkit"
DEPTH, WAY, STILL = 4e-6, 1e-6, 20  # [m] of a wall at a pose, and of a hand's zigzag in it; ticks before it
SIDES = 0.98, 1.02
load_device = functools.cache(description.load_device)


def one_of(name, rate=1000.0, method="direct", **values):
    """SETTINGS (1) of a device whose limits are far off and whose encoders are fine; nothing pulls."""
    values = defaults(NODES["haptic_driver"]) | {"servo.rate": rate, "exchange.method": method} | values
    one = controller_config.settings_unjudged(load_device(name), values)
    one["coupling"]["stiffness"] = one["coupling"]["damping"] = one["wall"]["count"] = 0.0
    one["hardware"]["gravity"], one["hardware"]["zero"], one["hardware"]["motor_limit"] = 0.0, 0.0, 1e3
    one["hardware"]["position_per_count"], one["hardware"]["velocity_limit"] = 1e-9, 1e3
    one["exchange"]["slew"], one["exchange"]["hold"] = 1e9, 1.0
    one["engage"]["time"], one["exchange"]["fade"], one["engage"]["force"] = 1.0 / rate, 1.0 / rate, 1e9
    one["fault"]["saturation"] = one["fault"]["silence"] = one["fault"]["duty"] = 1e9
    one["coupling"]["limit"] = one["force"]["limit"] = 1e3
    controller_config._set_port(one)
    one["port"]["step"] = 0.0
    return one


def stand(settings, place):
    """The joints are at this place of the handle [m] where all counts are 0."""
    joints = linkage.angles(settings.view(np.recarray)[0].linkage, *place)[:2]
    settings["hardware"]["zero"][..., :2] = -np.array(joints)
    return settings


def wall_of(settings, normal, stiffness, offset=0.0):
    """One wall, or none."""
    wall = settings["wall"]
    wall["count"], wall["x"][0, 0], wall["y"][0, 0] = stiffness > 0.0, *normal
    wall["stiffness"][0, 0], wall["offset"][0, 0] = stiffness, offset


def places(name, count, random):
    """So many random places (x, y) [m] of the handle, a third of them at an edge."""
    hardware = controller_config.settings_of(load_device(name))["hardware"][0]
    low, high = hardware["position_low"][:2], hardware["position_high"][:2]
    share = np.clip(1.25 * random.random((count, 2)) - 0.125, 0.02, 0.98)
    return low + share * (high - low)  # whose y is 0 where there is none


def jacobian(name, place):
    """J [m/rad] at this place, (axes, joints), and damping of the joints [N m s/rad]."""
    settings, device = controller_config.settings_of(load_device(name)).view(np.recarray)[0], load_device(name)
    pose, count = linkage.pose(settings.linkage, *linkage.angles(settings.linkage, *place)[:2]), len(device.joints)
    return np.array(pose[2:6]).reshape(2, 2)[:, :count], settings.port.damping[:count]


def settings_for(name, seed, least, most, budget, share=0.95, **more):
    """CHOICES of random SETTINGS whose gains are at this share of the bound at the worst pose; or of one, alike."""
    random, rate = np.random.default_rng(seed), more.get("rate", 1000.0)
    one = one_of(name, rate, more.get("method", "direct"))
    axes, hardware = int(one["axes"][0]), one["hardware"]
    at = places(name, 1, random)[0]
    stand(one, at)
    own = controller_config.settings_of(load_device(name))
    if more.get("step"):
        hardware["position_per_count"] = np.abs(own["hardware"]["position_per_count"])
        one["port"]["step"] = own["port"]["step"]
    if more.get("motor"):
        hardware["motor_limit"] = own["hardware"]["motor_limit"]
    if more.get("slew"):
        one["exchange"]["slew"] = more["slew"]
        controller_config._set_port(one)
    one["exchange"]["budget"] = one["exchange"]["tank"] = budget
    hardware["delay"], late = least / rate, most / rate
    choices, soft = np.repeat(one, CHOICES), float(hardware["damping"][0, 0]) * rate
    for k, each in enumerate(choices):
        each["version"], count = k + 1, int(random.integers(0, 3))
        part = random.random(4) ** (random.random(4) < 0.5)
        each["coupling"]["stiffness"][:axes] = part[:axes] * soft
        each["coupling"]["damping"][:axes] = part[2 : 2 + axes] * 0.3 * soft / rate * (random.random() < 0.6)
        angle = 2.0 * np.pi * random.random(count) if axes > 1 else np.pi * random.integers(0, 2, count)
        each["wall"]["count"], x, y = count, np.cos(angle), np.sin(angle) * (axes > 1)
        each["wall"]["x"][:count], each["wall"]["y"][:count] = x, y
        each["wall"]["offset"][:count] = x * at[0] + y * at[1] + 0.01 * (random.random(count) - 0.7)
        each["wall"]["stiffness"][:count] = soft * random.random(count)
        each["wall"]["damping"][:count] = 0.3 * soft / rate * random.random(count) * (random.random() < 0.6)
        each["cancellation"]["ratio"] = 0.3 * random.random() * (random.random() < 0.3) * bool(more.get("cancel"))
        _scale_to(each, share, late)
        gain_check.counted(choices[k : k + 1], late)
        if not more.get("step"):
            each["port"]["step"] = 0.0
    return np.repeat(choices[:1], CHOICES) if more.get("alike") else choices


def _scale_to(settings, share, lateness):
    """All gains such that they need this share of the damping at the worst pose, beside what is cancelled."""
    for _ in range(8):
        need = 1.0 - gain_check.margins(settings, lateness)[1] / settings["hardware"]["damping"][0]
        for group in ("coupling", "wall"):
            settings[group]["stiffness"] *= share / need
            settings[group]["damping"] *= share / need


def friction_for(choices):
    """Coulomb friction [N m] of each joint that covers its encoder's step in all places, of springs as in a plane."""
    known, most = np.zeros(1, ACCOUNT).view(np.recarray), np.zeros(3)
    low, high = choices["hardware"]["position_low"][0], choices["hardware"]["position_high"][0]
    for settings in choices.view(np.recarray):
        for rows in gain_check._tables(settings):
            rows["stiffness"] *= 0.5
            for x in np.linspace(low[0], high[0], 5):
                for y in np.linspace(low[1], high[1], 5 if settings.axes > 1 else 1):
                    account.at_pose(settings, settings.port, rows.view(np.recarray), rows.size, known[0], x, y)
                    most = np.maximum(most, known[0].blur_now)
    return most


def attack(name, seed, least, most, budget, kind, starts=2, tries=500, events=0.0, damping=1.0, **more):
    """Worst of a search (account_search.search) on a linkage; and the settings, and the best path."""
    choices = settings_for(name, seed, least, most, budget, **more)
    state, ticks = np.zeros(1, STATE).view(np.recarray), np.zeros(1, TICK).view(np.recarray)
    paths, step = np.zeros(3, PATH).view(np.recarray), bool(more.get("step"))
    grid = choices["port"]["step"][0].copy()
    friction = friction_for(choices) if step else np.zeros(3)
    arguments = (choices.view(np.recarray), state, ticks, friction, grid, damping, least * SUB)
    low, high = round(least * SUB), round(most * SUB)
    return account_search.search(seed, kind, *arguments, low, high, starts, tries, events, paths), choices, paths


def drawn(name, place, normal, stiffness, rate=1000.0):
    """Energy [J] that a hand draws in a cycle of its worst motion in a wall at a pose that stays, of the bare law."""
    one = stand(one_of(name, rate, **{"passivity.policy": "off", "passivity.control": False}), place)
    turn, damping = jacobian(name, place)
    wall_of(one, normal, stiffness, np.dot(normal, place) + DEPTH)
    gain_check.counted(one, 0.0)
    one["port"]["step"], one["hardware"]["position_low"], one["hardware"]["position_high"] = 0.0, -1.0, 1.0
    path, state, row = np.zeros(1, PATH), np.zeros(1, STATE).view(np.recarray), np.zeros(1, TICK).view(np.recarray)
    way = (turn.T @ normal) / damping
    way *= WAY / np.dot(normal, turn @ way)
    for k in range(STILL, TICKS):
        path["velocity"][0, k * SUB : (k + 1) * SUB, : way.size] = way * rate * (1.0, -1.0)[k % 2]
    out, seen, choices = np.zeros(5), np.zeros((TICKS, 4)), one.repeat(CHOICES).view(np.recarray)
    account_search.run(choices, path.view(np.recarray)[0], state, row, *np.zeros((2, 3)), 0.0, 1.0, out, seen)
    return seen[-1, 0] - seen[-3, 0]


def directions(name):
    turns = np.pi * np.arange(0, 8, 1 if len(load_device(name).joints) > 1 else 4) / 4.0
    return np.round(np.stack((np.cos(turns), np.sin(turns)), axis=1), 15)


def bound(name, place, normal, rate=1000.0):
    """Stiffness [N/m] up to which a wall gives nothing at this pose: K T/2 nᵀ J b⁻¹ Jᵀ n = 1."""
    turn, damping = jacobian(name, place)
    along = turn.T @ normal
    return 2.0 * rate / float(along @ (along / damping))


def judged(name, normal, stiffness, rate=1000.0):
    """SETTINGS (1) of one wall, as they are judged, and a function: what at_pose leaves of the damping, as a share."""
    one, known = one_of(name, rate), np.zeros(1, ACCOUNT).view(np.recarray)
    wall_of(one, normal, stiffness)
    rows, settings = gain_check._tables(one[0])[1].view(np.recarray), gain_check.counted(one, 0.0).view(np.recarray)[0]
    known["damping"] = settings.port.damping
    return one[0], lambda x, y: account.at_pose(settings, settings.port, rows, rows.size, known[0], x, y)


def table(name, rate=1000.0):
    """Walls at 6 poses and at their worst: place, normal, bound [N/m], and at SIDES of it energies drawn [J], shares of
    the damping left, and, at the worst, what they are refused with.
    """
    some = places(name, 6, np.random.default_rng(6))
    for normal in directions(name):
        worst = np.append(gain_check.worst_pose(judged(name, normal, 1.0, rate)[0], 0.0), 0.0)[:2]
        for place in (*some, worst):
            most = bound(name, place, normal, rate)
            both = [judged(name, normal, share * most, rate) for share in SIDES]
            energies = [drawn(name, place, normal, share * most, rate) for share in SIDES]
            refused = [gain_check.refusal(one) for one, _ in both] if place is worst else []
            yield place, normal, most, energies, [left(*place) for _, left in both], refused


VARIANTS = {
    "direct 1 kHz": {},
    "pspm 4 kHz": {"rate": 4000.0, "method": "pspm"},
    "slew": {"slew": 50.0, "method": "pspm"},
    "motor": {"motor": True},
    "encoder": {"step": True},
    "encoder 4 kHz, events, cancelled": {"rate": 4000.0, "step": True, "events": 0.05, "cancel": True},
}


if __name__ == "__main__":
    tries = int(sys.argv[1]) // (3 * len(VARIANTS) * len(LATENESS)) if len(sys.argv) > 1 else 70
    for name, (variant, more) in itertools.product(DEVICES, VARIANTS.items()):
        cases = itertools.product(enumerate(LATENESS), ((2e-5, 1), (2e-5, 2), (5e-3, 0)))
        found = [attack(name, seed, *late, budget, kind, 1, tries, **more)[0] for (seed, late), (budget, kind) in cases]
        told = "  ".join(f"{1e6 * value:11.5f}" for value in np.max(found, axis=0))
        print(f"{name:16s} {variant:32s} E - budget, E + S + a - budget, -a, rise [uJ]: {told}", flush=True)
