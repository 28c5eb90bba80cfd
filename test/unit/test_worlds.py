# SPDX-License-Identifier: Apache-2.0
"""Worlds against closed forms, by every method that can make them up, in a plane as it is and in one that is turned.

A law is a generator: first the world, for a size of the scene, then places and velocities of bodies at later times.
"""

import itertools
import math

import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk
from worlds import DOWN, FAR, TURNS, World, body, box, disc, fixed, floor, joint, spring, tool
from worlds import G as G

from haptic_sim.method.penalty_explicit import PenaltyExplicit
from haptic_sim.method.penalty_implicit import PenaltyImplicit
from haptic_sim.protocol import Coupling

DIRECT = "partitioned event_driven"
RIGID = DIRECT + " impulse"
ALL = RIGID + " penalty_explicit penalty_implicit"
FIRM = {"firm explicit": PenaltyExplicit, "firm implicit": PenaltyImplicit}
"""Contacts of 1e5 N/m and 500 N s/m."""
STEPS = {"impulse": 0.25e-3, "firm explicit": 1e-4, "firm implicit": 1e-4}
COORDINATES = "x", "y", "angle", "vx", "vy", "turning"
PLACES = [*zip(TURNS, (1.0, 0.1), strict=True)]  # angle of the plane, size of the scene
LAWS = []


def law(methods, close, **given):
    """These methods keep the law as close as this, relative, for every combination of what is given."""

    def kept(told):
        for method in methods.split(" ") if isinstance(methods, str) else methods:
            for values in itertools.product(*given.values()):
                words = [told.__name__, method, *map(str, values)]
                more = dict(zip(given, values, strict=True))
                LAWS.append(pytest.param(method, told, more, close, id="-".join(words)))
        return told

    return kept


@pytest.mark.parametrize(("method", "told", "given", "close"), LAWS)
def test_a_world_is_where_its_closed_form_says(method, told, given, close):
    kind = (lambda reduced, h: FIRM[method](reduced, h, 1e5, 500.0)) if method in FIRM else method
    for turn, size in PLACES:
        scene, *looks = told(size, **given)
        handle = scene.pop("handle", None)
        world, gone = World(kind, turn=turn, **{"h": STEPS.get(method, 1e-3)} | scene), 0.0
        for time, name, expected in looks:
            world.run(time - gone, handle)
            found, gone = dict(zip(COORDINATES, world.state(name), strict=True)), time
            for coordinate, value in expected.items():
                exact = (
                    pytest.approx(value, rel=close, abs=min(1e-9, close) + 1e-3 * close)
                    if isinstance(value, float)
                    else value
                )
                assert found[coordinate] == exact, (turn, time, name, coordinate)


def near(value, within):
    return pytest.approx(value, abs=within)


REST = {"vx": 0.0, "vy": 0.0, "turning": 0.0}


@law(ALL, 1e-12, speed=[0.3, 9e-5])
def what_nothing_touches_flies_on(_, speed):
    yield dict(bodies=[body(1.0, 2.0, 0.5, velocity=[speed, -0.2, 4.0])], tool=FAR | {"velocity": [1.0, 0.0, 2.0]})
    yield 1.0, "body", dict(x=1.0 + speed, y=1.8, angle=4.5, vx=speed, vy=-0.2, turning=4.0)
    yield 1.0, "tool", dict(x=51.0, y=50.0, angle=2.0)


@law(ALL, 1e-12, g=[G], time=[0.2])
@law(["impulse"], 1e-9, g=[4e-4], time=[2.0])
def what_falls_has_the_speed_g_t(_, g, time):
    yield dict(bodies=[body()], gravity=(0.0, -g), tool=tool(5.0, 5.0))
    for name, start in ("body", 0.0), ("tool", 5.0):
        yield time, name, dict(vy=-g * time, y=near(start - 0.5 * g * time**2, 0.51e-3 * g * time))


@law(ALL + " closed_form", 1e-6)
def a_held_tool_hangs_by_its_weight_over_the_stiffness(_):
    yield dict(bodies=[], gravity=DOWN, tool=tool(), gains=Coupling(2000.0, 20.0, 1.0, 0.01))
    yield 1.0, "tool", dict(y=pytest.approx(-0.1 * G / 2000.0, rel=1e-9))


def block(size=1.0, speed=0.0, height=0.1, **more):
    """On the floor."""
    return body(0.0, 0.5 * height * size, shapes=box(0.2 * size, height * size), velocity=[speed, 0.0, 0.0], **more)


def tilted(slope):
    return G * math.sin(slope), -G * math.cos(slope)


@law(DIRECT, 1e-9)
@law(["impulse"], 1e-3)
def a_block_slides_down_by_g_sin_less_mu_g_cos(size):
    yield dict(bodies=[floor(), block(size)], friction=0.3, gravity=tilted(math.pi / 6))
    yield 0.1, "body", dict(vx=0.1 * G * (0.5 - 0.3 * math.sqrt(0.75)), turning=0.0)


@law(DIRECT, 1e-9)
@law(["impulse"], 1e-3)
def a_block_slides_to_rest_after_v_squared_over_two_mu_g_and_stays(size):
    yield dict(bodies=[floor(), block(size, 2.0)], friction=0.4, gravity=DOWN)
    yield 1.0, "body", dict(x=4.0 / (0.8 * G), **REST)


@law(DIRECT, 1e-9, slope=[0.35], time=[0.3])
@law(["impulse"], 1e-3, slope=[0.35], time=[0.3])
@law(["impulse"], 2e-2, slope=[1e-5], time=[1.5])
def a_disc_rolls_at_two_thirds_of_g_sin(size, slope, time):
    yield dict(bodies=[floor(), body(0.0, 0.1 * size, shapes=disc(0.1 * size))], friction=0.5, gravity=tilted(slope))
    speed = 2.0 / 3.0 * G * math.sin(slope) * time
    yield time, "body", dict(vx=speed, x=near(0.5 * speed * time, 0.01 * speed * time))


@law(DIRECT, 1e-9, belt=[0.5, -0.5])
@law(["impulse"], 1e-3, belt=[0.5, -0.5, 5e-5])
@law([*FIRM], 1e-2, belt=[0.5])
def a_block_on_a_belt_has_its_speed_after_v_over_mu_g_and_keeps_it(size, belt):
    drag, time = 0.4 * G, abs(belt) / (0.4 * G)
    yield dict(bodies=[floor(surface_velocity=[belt, 0.0]), block()], friction=0.4, gravity=DOWN)
    if time > 0.1:
        yield 0.1, "body", dict(x=math.copysign(0.5 * drag * 0.1**2, belt), vx=math.copysign(0.1 * drag, belt))
    yield 0.5, "body", dict(x=belt * (0.5 - 0.5 * time), vx=belt)


@law(DIRECT, 1e-9, belt=[3.0, 0.3])
def a_ball_that_falls_on_a_belt_is_spun_by_mu_times_its_blow_or_until_it_rolls(_, belt):
    """A disc that ends rolling has a third of the belt's speed."""
    given, ball = min(0.2 * 1.0 * 1.5, belt / 3.0), body(0.0, 0.1 + 1e-4, shapes=disc(0.1), velocity=[0.0, -1.0, 0.0])
    yield dict(bodies=[floor(surface_velocity=[belt, 0.0]), ball], friction=0.2, restitution=0.5)
    yield 2e-3, "body", dict(vx=given, vy=0.5, turning=given / 0.05)


@law(DIRECT, 1e-6)
def a_tool_on_a_belt_goes_with_it_until_its_coupling_pulls_as_hard_as_friction(_):
    held = tool(0.0, 0.01, shapes=box(0.04, 0.02), inertia=1e-4)
    more = dict(tool=held, friction=0.3, gains=Coupling(2000.0, 20.0, 50.0, 0.5), handle=(0.0, 0.0, 0.0))
    yield dict(bodies=[floor(surface_velocity=[0.1, 0.0])], **more)
    yield 0.01, "tool", dict(vx=pytest.approx(0.1, rel=1e-9))
    yield 2.0, "tool", dict(x=0.3 * 0.01, y=0.01)


@law("partitioned impulse", 1e-5)
def a_ball_far_along_a_half_plane_lies_on_it(_):
    rolls = body(75.0, 0.05, shapes=disc(0.05), velocity=[20.0, 0.0, 0.0])
    yield dict(bodies=[floor(), rolls], gravity=DOWN, tool=tool(0.0, 5.0))
    yield 0.2, "body", dict(x=79.0, y=near(0.05, 1e-5))


@law("partitioned impulse", 4e-3, thick=[2e-4, 2e-3])
def a_thin_ladder_slides_down_a_wall(size, thick):
    """Ends on a smooth floor and wall: θ'' = −(3 g/2 L) cos θ of the line between them, until it leaves the wall."""
    length, start, time = 0.3 * size, 1.1, 0.12 * math.sqrt(size)
    ends = [[-0.5 * length, 0.0], [0.0, -0.5 * thick * size], [0.5 * length, 0.0], [0.0, 0.5 * thick * size]]
    at = 0.5 * length * math.cos(start), 0.5 * length * math.sin(start), math.pi - start
    rod = body(*at, shapes=[{"vertices": ends}], mass=0.1, inertia=0.1 * length**2 / 12.0)
    wall = fixed("wall", shapes=[{"half_plane": {"normal": [1.0, 0.0]}}])
    exact = solve_ivp(lambda _, s: (s[1], -1.5 * G / length * math.cos(s[0])), (0.0, time), (start, 0.0), rtol=1e-10)
    angle = float(exact.y[0, -1])
    assert math.sin(angle) > 2.0 / 3.0 * math.sin(start)  # still at the wall
    yield dict(bodies=[floor(), wall, rod], gravity=DOWN, h=0.25e-3 * size)
    yield time, "body", dict(angle=near(math.pi - angle, 2e-3 * (start - angle)))


@law(RIGID, 1e-9, e=[0.0, 0.3, 1.0])
def a_ball_rebounds_with_its_restitution(size, e):
    falls = body(0.0, 0.01017 * size, shapes=disc(0.01 * size), velocity=[0.1, -1.0, 0.0])
    yield dict(bodies=[floor(), falls], restitution=e)
    yield 0.01, "body", dict(vx=0.1, vy=e)


@law("partitioned", 1e-6, start=[0.5, 0.0])
@law(["impulse"], 2e-3, start=[0.5, 0.0])
def a_ball_that_loses_nothing_comes_back_to_its_height(size, start):
    """From its fall, or thrown at the floor that it lies on."""
    radius, speed = 0.05 * size, math.sqrt(2.0 * G * 0.5 * size)
    ball = body(0.0, radius + start * size, shapes=disc(radius), velocity=[0.0, 0.0 if start else -speed, 0.0])
    yield dict(bodies=[floor(), ball], restitution=1.0, gravity=DOWN, h=1e-3 * speed / G)
    yield (2.0 if start else 1.0) * speed / G, "body", dict(y=radius + 0.5 * size)


@law(DIRECT, 1e-9, ratio=[1e-3, 1.0, 1e6], e=[0.0, 0.5, 1.0])
@law(["impulse"], 1e-9, ratio=[1.0, 10.0], e=[0.0, 1.0])
def two_discs_part_by_momentum_and_newtons_law(size, ratio, e):
    one = body(name="one", mass=ratio, shapes=disc(0.1 * size), velocity=[1.0, 0.0, 0.0])
    yield dict(bodies=[one, body(0.20017 * size, shapes=disc(0.1 * size))], restitution=e)
    yield 0.1, "one", dict(vx=(ratio - e) / (ratio + 1.0))
    yield 0.1, "body", dict(vx=ratio * (1.0 + e) / (ratio + 1.0))


@law(RIGID, 1e-9, gap=[-1e-10, 1e-9])
def touching_discs_are_struck_at_once_and_those_a_nanometre_apart_one_by_one(_, gap):
    row = [body(x, name=name, shapes=disc(0.1)) for name, x in (("a", 0.0), ("b", 0.21), ("c", 0.41 + gap))]
    row[0]["velocity"] = [1.0, 0.0, 0.0]
    yield dict(bodies=row, restitution=1.0)
    for name, speed in zip("abc", (-1 / 3, 2 / 3, 2 / 3) if gap < 0.0 else (0.0, 0.0, 1.0), strict=True):
        yield 0.1, name, dict(vx=near(speed, 1e-9))


@law(DIRECT, 1e-9, degrees=[10.0, 60.0], e=[0.0, 0.4])
def a_falling_rod_gets_the_impulse_of_its_end(size, degrees, e):
    """P = (1+e) m v/(1 + 3 cos² θ): frictionless, one end hits."""
    angle, slim = math.radians(degrees), [[-0.5, 0.0], [0.0, -0.001], [0.5, 0.0], [0.0, 0.001]]
    shapes = [{"vertices": [[size * x, size * y] for x, y in slim]}]
    at = 0.0, (0.5 * math.sin(angle) + 0.00517) * size, angle
    yield dict(
        bodies=[floor(), body(*at, shapes=shapes, inertia=size**2 / 12.0, velocity=[0.0, -size, 0.0])], restitution=e
    )
    impulse = (1.0 + e) / (1.0 + 3.0 * math.cos(angle) ** 2)
    yield 6e-3, "body", dict(vy=size * (impulse - 1.0), turning=-6.0 * impulse * math.cos(angle))


def hung(length, angle, **more):
    """A rod on a pin at the origin."""
    at = 0.5 * length * math.cos(angle), 0.5 * length * math.sin(angle), angle
    return body(*at, shapes=box(length, 0.01 * length), inertia=length**2 / 12.0, **more)


@law("partitioned", 1e-9, amplitude=[5.0, 90.0, 150.0], whole=[1])
@law(["impulse"], 1e-3, amplitude=[90.0], whole=[0])
def a_pendulum_is_at_its_lowest_after_a_quarter_of_its_period(size, amplitude, whole):
    """T = 4 √(2 L/(3 g)) K(sin² A/2), and ω² = 3 g (1 − cos A)/L there; and so after a whole period more."""
    start = math.radians(amplitude)
    period = 4.0 * math.sqrt(2.0 * size / (3.0 * G)) * ellipk(math.sin(0.5 * start) ** 2)
    yield dict(bodies=[hung(size, start - 0.5 * math.pi)], joints=[joint("pin")], gravity=DOWN, h=period / 20000.0)
    turning = -math.sqrt(3.0 * G * (1.0 - math.cos(start)) / size)
    yield (0.25 + whole) * period, "body", dict(angle=-0.5 * math.pi, turning=turning)


@law(["impulse"], 1e-2)
def a_rod_that_balances_a_little_off_the_top_falls(size):
    """θ = θ₀ cosh(λ t), λ² = 3 g/(2 L), while θ is small."""
    time = 1.5 * math.sqrt(size)
    yield dict(bodies=[hung(size, 0.5 * math.pi + 2e-5)], joints=[joint("pin")], gravity=DOWN)
    fallen = 2e-5 * math.cosh(1.5 * math.sqrt(1.5 * G))
    yield time, "body", dict(angle=near(0.5 * math.pi + fallen, 1e-2 * fallen))


AXES = {"pin": ("angle", "turning"), "slider": ("x", "vx"), "spring": ("x", "vx")}


def driven(kind, size, motor, friction, rate=0.0, **more):
    """A wheel on a pin or a sled on a guide, with motor (speed, strength) and dry friction, both times its inertia."""
    what, velocity = ("torque", [0.0, 0.0, rate]) if kind == "pin" else ("force", [rate, 0.0, 0.0])
    drive = {"speed": motor[0], f"max_{what}": motor[1] * size}
    wheel = body(shapes=box(0.1, 0.1), mass=size, inertia=size, velocity=velocity, layers=[])
    return dict(bodies=[wheel], joints=[joint(kind, **{f"friction_{what}": friction * size, "motor": drive, **more})])


DRIVES = {
    "up to its speed": ((3.0, 15.0), 7.5, 0.0, [(0.2, 0.15, 1.5), (0.6, 1.2, 3.0)]),
    "back": ((-3.0, 15.0), 7.5, 0.0, [(0.2, -0.15, -1.5), (0.6, -1.2, -3.0)]),
    "what is faster": ((3.0, 15.0), 7.5, 6.0, [(0.1, 0.4875, 3.75), (0.3, 0.6 + 3.0 / 6.0, 3.0)]),
    "to a stop": ((0.0, 10.0), 5.0, 3.0, [(0.1, 0.225, 1.5), (0.3, 0.3, 0.0)]),
    "nothing": ((3.0, 0.1), 0.5, 0.0, [(0.2, 0.0, 0.0)]),
}


@law(DIRECT, 1e-12, kind=["pin", "slider"], drive=DRIVES)
@law(["penalty_implicit"], 1e-2, kind=["pin", "slider"], drive=DRIVES)
@law(["impulse"], 2e-3, kind=["pin"], drive=["back", "what is faster"])
@law(["impulse"], 2e-3, kind=["slider"], drive=["up to its speed", "nothing"])
def a_motor_less_friction_drives_and_both_together_brake_what_is_faster(size, kind, drive):
    """From 6 to 3 it takes 3/22.5 s, over 4.5 · 3/22.5; then the motor holds its speed."""
    motor, friction, rate, looks = DRIVES[drive]
    yield driven(kind, size, motor, friction, rate)
    for time, way, speed in looks:
        yield time, "body", dict(zip(AXES[kind], (way, speed), strict=True))


@law("partitioned impulse", 2e-3)
def the_motor_of_a_sled_is_not_weakened_by_what_presses_the_sled_on_its_guide(size):
    yield driven("slider", size, (1e3, 2.0), 0.8) | dict(gravity=(0.0, -20.0))
    yield 0.2, "body", dict(x=0.5 * 1.2 * 0.2**2, y=0.0, angle=0.0)


@law(DIRECT, 1e-6)
@law("impulse penalty_implicit", 2e-3)
@law(["firm explicit"], 2e-3, slip=[1.0 / 500.0])
def a_sliders_motor_lifts_its_load_from_a_stop_at_its_speed(size, slip=0.0):
    """On a guide of 30° with gravity: v = (F/m − g sin 30°) t until the motor's speed; explicit contacts' damper slips
    under the force that it carries."""
    scene = driven("slider", size, (0.02, 0.51 * G), 0.0, limits=[0.0, 1.0])
    yield scene | dict(gravity=(-0.5 * G, -math.sqrt(0.75) * G))
    start = 0.02 / (0.01 * G)
    if not slip:
        yield 0.4, "body", dict(x=0.02 * (0.4 - 0.5 * start), vx=0.02)
    yield 0.6, "body", dict(vx=0.02 - slip * 0.5 * G * size)


def sprung(kind, size, stiffness, damping, stretch=0.0, push=0.0):
    """A body on a spring-damper, `stretch` off its rest and pushed by gravity, all times its mass or inertia.

    The pin's body is a ring 1 m about its pin, whose mass centre gravity draws.
    """
    each, more = dict(stiffness=stiffness * size, damping=damping * size), dict(shapes=disc(0.1), layers=[])
    if kind == "pin":
        ring = body(0.0, -1.0, mass=0.5 * size, inertia=0.5 * size, **more)
        return dict(bodies=[ring], joints=[joint("pin", **each, rest=-stretch)], gravity=(2.0 * push, 0.0))
    if kind == "slider":
        sled = body(mass=size, **more)
        return dict(bodies=[sled], joints=[joint("slider", **each, rest=-stretch)], gravity=(push, 0.0))
    return dict(bodies=[body(stretch, mass=size, **more)], joints=[spring(**each, rest=0.0)], gravity=(push, 0.0))


@law(DIRECT, 1e-6, kind=AXES, share=[0.5, 6.0, 1e4], step=[1e-3])
@law(["impulse"], 2e-3, kind=AXES, share=[0.5, 6.0, 1e4], step=[50e-6])
def in_grease_a_body_lags_behind_its_terminal_speed_by_it_over_the_rate(size, kind, share, step):
    """v → g/r and x → v (t − 1/r) with r = c/m, from half of an explicit formula's limit to far beyond it."""
    rate, time, speed = share / step, 0.1, 1e-3
    yield sprung(kind, size, 0.0, rate, push=speed * rate)
    fade = 1.0 - math.exp(-rate * time)
    yield time, "body", dict(zip(AXES[kind], (speed * (time - fade / rate), speed * fade), strict=True))


@law(DIRECT, 1e-6, kind=AXES, fast=[0.5, 4.0], within=[2e-5])
@law(["impulse"], 1e-6, kind=AXES, fast=[0.02], within=[2e-3])
def a_damped_oscillator_swings_by_its_closed_form_up_to_some_radians_a_step(size, kind, fast, within):
    """x = x₀ e^(−d t) (cos w t + d/w sin w t), d a tenth of the angular frequency."""
    frequency, x, d = fast * 1e3, 1e-3, 0.1 * fast * 1e3
    w = math.sqrt(frequency**2 - d**2)
    scene = sprung(kind, size, frequency**2, 2.0 * d, x)
    yield scene
    for time in (1e-3, 3e-3, 8e-3, 19e-3, 100e-3):
        way = x * math.exp(-d * time) * (math.cos(w * time) + d / w * math.sin(w * time))
        start = x if kind == "spring" else 0.0
        yield time, "body", {AXES[kind][0]: near(way - x + start, within * x)}


@law("partitioned impulse", 2e-3)
def a_spring_without_length_damps_across_its_stretch_as_along_it(size):
    """ẍ + 2 ζω ẋ + ω² x = 0 in both directions: thrown across from a stretch."""
    time, swing = 0.1, math.sqrt(99.0)
    ball = body(0.02 * size, velocity=[0.0, 0.4 * size, 0.0], layers=[])
    yield dict(bodies=[ball], joints=[spring(stiffness=100.0, damping=2.0, rest=0.0)])
    fade = math.exp(-time)
    x = 0.02 * fade * (math.cos(swing * time) + math.sin(swing * time) / swing)
    yield time, "body", dict(x=size * x, y=size * 0.4 * fade * math.sin(swing * time) / swing)


@law(["impulse"], 1e-6, weak=[(1.0, 4e-4, 1.5), (0.005, 0.05, 2.0)])
def what_a_weak_spring_will_move_swings(_, weak):
    stiffness, stretch, time = weak
    yield dict(bodies=[body(0.1 + stretch)], joints=[spring(stiffness=stiffness, rest=0.1)])
    yield time, "body", dict(x=near(0.1 + stretch * math.cos(math.sqrt(stiffness) * time), 0.01 * stretch))


@law("partitioned impulse", 1e-3, ends=[("world", "body"), ("body", "world")])
def a_sled_pushed_beside_its_mass_centre_stays_on_a_guide_at_its_corner(size, ends):
    sled = body(0.03 * size, 0.02 * size, shapes=box(0.06 * size, 0.04 * size), mass=0.5)
    yield dict(bodies=[sled], joints=[joint("slider", *ends)], gravity=(2.0, -5.0))
    yield 0.2, "body", dict(x=0.03 * size + 0.04, y=near(0.02 * size, 1e-9), angle=near(0.0, 1e-9))


@law("partitioned impulse", 1e-9, kind=["pin", "slider"])
def a_joint_whose_limits_are_both_0_holds_like_a_weld(size, kind):
    at = (0.05 * size, 0.0) if kind == "pin" else (0.0, 0.0)
    yield dict(bodies=[block(size)], joints=[joint(kind, at=at, limits=[0.0, 0.0])], gravity=(1.0, -G))
    yield 0.1, "body", dict(x=near(0.0, 1e-15), y=near(0.05 * size, 1e-15), angle=near(0.0, 1e-15))


@law("partitioned impulse", 1e-3, rate=[50.0, -30.0])
def a_bar_thrown_against_its_pins_stop_stays_there(size, rate):
    bar = body(0.1 * size, shapes=box(0.2 * size, 0.02 * size), mass=0.3, velocity=[0.0, 0.1 * size * rate, rate])
    yield dict(bodies=[bar], joints=[joint("pin", limits=[-0.4, 0.5])])
    yield 0.2, "body", dict(angle=near(0.5 if rate > 0.0 else -0.4, 1e-6), **REST)


@law("partitioned impulse", 1e-3, speed=[0.2, 2.0, -20.0])
def a_sled_thrown_against_its_stop_stays_there(size, speed):
    sled = body(0.0, 0.02 * size, shapes=box(0.04 * size, 0.02 * size), mass=0.5, velocity=[speed * size, 0.0, 0.0])
    yield dict(bodies=[sled], joints=[joint("slider", limits=[-0.03 * size, 0.05 * size])])
    yield (
        0.5,
        "body",
        dict(x=near((0.05 if speed > 0.0 else -0.03) * size, 1e-6), y=near(0.02 * size, 1e-6), angle=0.0, **REST),
    )


def two_links(ratio=1.0, **more):
    """Of 30 mm, the second so many times as heavy as the first of 20 g, let go level."""
    sizes = zip(("one", "two"), (0.015, 0.045), (0.02, 0.02 * ratio), strict=True)
    links = [body(x, name=name, shapes=box(0.03, 0.006), mass=mass, layers=[]) for name, x, mass in sizes]
    pins = [joint("pin", "world", "one", **more), joint("pin", "one", "two", (0.03, 0.0), **more)]
    return dict(bodies=links, joints=pins, gravity=DOWN)


@law(["partitioned"], 1e-3, ratio=[1.0, 50.0])
@law(["impulse"], 1e-3, ratio=[50.0])
def an_arm_that_hangs_on_the_stops_of_its_pins_comes_to_rest(_, ratio):
    yield two_links(ratio, limits=[-0.1, 0.1])
    for time in (0.8, 0.83, 0.9):
        for name, angle in ("one", -0.1), ("two", -0.2):
            yield time, name, dict(angle=near(angle, 1e-4), turning=near(0.0, 1e-3))


@law(["partitioned"], 2e-3, damping=[1e2, 1e6])
def what_strikes_a_plunger_in_grease_drives_it_by_its_momentum_over_the_damping(size, damping):
    """c x = m v: all that the ball has goes into the grease; c h/m of the light plunger 10 to 1e5."""
    plunger = body(name="plunger", shapes=box(0.02, 0.02), mass=0.01 * size)
    ball = body(-0.0217, name="ball", shapes=disc(0.01), mass=size, velocity=[0.5, 0.0, 0.0])
    yield dict(bodies=[plunger, ball], joints=[joint("slider", "world", "plunger", damping=damping * size)])
    yield 0.5, "plunger", dict(x=pytest.approx(0.5 / damping, rel=2e-3))
    yield 0.5, "ball", dict(vx=near(0.0, 1e-3))


@law(DIRECT, 1e-9)
def two_joints_with_motor_and_friction_in_a_row_each_keep_their_own_law(_):
    """The first motor is stronger than its friction, the second weaker: both arms turn as one."""
    arms = [body(x, name=name, shapes=box(0.2, 0.02), inertia=0.1) for name, x in (("a", 0.1), ("b", 0.3))]
    first = dict(friction_torque=0.5, motor={"speed": 2.0, "max_torque": 5.0})
    second = dict(friction_torque=9.0, motor={"speed": 9.0, "max_torque": 0.1})
    yield dict(bodies=arms, joints=[joint("pin", "world", "a", **first), joint("pin", "a", "b", (0.2, 0.0), **second)])
    yield 1.0, "a", dict(turning=2.0)
    yield 1.0, "b", dict(turning=2.0)


@law("partitioned impulse", 1e-4)
def a_tool_on_a_guide_comes_to_its_stop(_):
    guide = joint("slider", "world", "tool", limits=[-0.1, 0.02])
    held = dict(tool=tool(0.0, 0.01), gains=Coupling(2000.0, 20.0, 2.0, 0.02), handle=(0.03, 0.01, 0.0))
    yield dict(bodies=[], joints=[guide], **held)
    yield 0.2, "tool", dict(x=near(0.02, 1e-6), y=near(0.01, 1e-6), vx=0.0)
