# SPDX-License-Identifier: Apache-2.0
"""Which method and which sub-step serve a scene, and why.

Inside a sub-step `impulse` takes steps of its own, so its sub-step is but how often a port that is short of energy
acts; `partitioned` takes its sub-step whole.

Backward difference gives a mode of angular frequency w the damping ratio w h / 2 that it does not have: after one
radian its amplitude is short by that share. With h = 2 error / w that is the error allowed. The mode is the tool on
its coupling at `STIFFNESS`, or a spring of the scene that is faster. Inside, `impulse` takes half of that, between
`SHORT` and `LONG`: what is struck is found a step late at most, and in no shipped scene that adds more than the other
half. Turning is not looked at. Overlaps grow with the square of the step, so a load beyond `EASY` gets `SHORT`; so do
joints, at what rate they swing is not known beforehand.

Sequential impulses pass a load on from contact to contact: of two bodies with mass ratio R a sweep leaves R/(1 + R),
and up a tower of n the load has come one body farther. The sweeps are counted, so what is left of the load after the
last is an overlap, and where one body strikes another, energy. Both grow with R n; the bounds are held by
`test/soak/test_hard_cases_by_default.py`. A coupling is an effective mass in the tool, m + h² K: it
makes a light tool heavier, by 5 mg at 2000 N/m, and asks for nothing more.

A damper c acts by backward difference, in every method that is chosen: what it holds back follows in v = F/c, however
short its time m/c is against a step. So it asks for no shorter one. But sequential impulses settle a light body between
a heavy one and a damper by c h/m sweeps: `GREASE` of it is solved directly.
"""

import math
from collections.abc import Iterable, Iterator, Sequence

from haptic_sim.reduction.model import Model, too_much
from haptic_sim.scene.geometry import Outline, Point, Pose, distance, turned
from haptic_sim.scene.language import Scene

STEPS = (1e-3, 0.5e-3, 0.25e-3, 0.2e-3, 0.125e-3, 0.1e-3, 0.05e-3, 0.025e-3)
"""s; whole shares of a millisecond, so that an exchange at 1 kHz is a whole number of sub-steps."""
ACTS = 0.2e-3
"""s; `impulse` has no shorter sub-step unless the error asks for less than the steps inside: ports cost as much."""
SOLVED = 6e-6
"""s of step for each body: a direct solve costs some 2 us a body, and is to take a third of its step."""
STIFFNESS = 2000.0
"""N/m; coupling that the choice reckons with. A stiffer one is as stable, but less exact."""
SHORT, LONG = 0.05e-3, 0.084e-3
"""s; between these `impulse` steps inside its sub-steps. It cannot keep up with shorter ones; in longer ones what is
fast and swept loses too much (`handle_jump` errs by 3e-2 in steps of 0.125 ms, by 3e-3 in these)."""
EASY = 6.0
"""Mass ratio times bodies on one another up to which steps may be longer than `SHORT`: below 20 um then."""
SHORT_PER_BODY = 10e-6
"""s; with many bodies as long for each: the time for them stays the same."""
HOLDS = 3e-3
"""Relative error that `impulse` at `SHORT` stays below in shipped scenes with a closed form or stored reference."""
LOAD = 60.0
"""Mass ratio times bodies on one another up to which it overlaps below 0.1 mm and creates below 1 % of the energy."""
HIGH = 15
"""Bodies on one another up to which a tower stands: of 20 equal ones it sinks in by 1.3 mm in two of six positions
(`python -m bench hard_cases --scenes stack_20`)."""
GREASE = 4.0
"""c h/m, h the step inside, up to which `impulse` settles dampers: a tool of .1 or 1 kg on a plunger of 1 or 10 g errs
by 4e-5 of its way at 2.5, by up to 2e-2 at 10, by 1 at 100."""
UNBOUNDED = None, "impulse", "closed_form"
"""Methods that take any number of bodies."""
LAYERS = 32
"""Bits of a Chipmunk filter."""
TOUCHING = 1e-5
"""m; bodies that are no farther apart at the start rest on each other."""

Load = tuple[float, int, int, int]
"""Largest mass ratio of two that can meet, the light one and the heavy one, and how many stand on one another."""


def choose_method(
    scene: Scene, model: Model, names: Sequence[str], load: Load, axes: tuple[Point, ...] | None
) -> tuple[str, str]:
    """Name of the method and why; `names` of the model's bodies. ValueError if the scene asks for one that cannot.

    `axes` are the directions in which contact acts, if each can be solved by itself.
    """
    if scene.method == "closed_form" and axes is None:
        raise ValueError(
            "method is 'closed_form', which needs a round tool without joints among half_planes, without "
            "friction or restitution, that are parallel or square; take another method"
        )
    crowded = too_many_layers(scene)
    if scene.method:
        return scene.method, "the scene asks for it"
    if axes is not None:
        return (
            "closed_form",
            f"contact acts on {len(axes)} {'axis' if len(axes) == 1 else 'axes'}, and each can be solved by itself",
        )
    asked = crowded or _beyond_impulse(scene, model, names, load)
    if not asked:
        return "impulse", "the scene needs no more than impulses in short steps"
    beyond = too_much(model)
    if beyond and crowded:
        raise ValueError(f"{crowded}, and {beyond}; take fewer layers")
    return ("impulse", f"{asked}; but {beyond}") if beyond else ("partitioned", asked)


def refusal(scene: Scene, model: Model, shape_names: Sequence[str], method: str) -> str:
    """Sentence on what of a scene a method that is asked for cannot take; or ""."""
    if method.startswith("penalty") and (elastic := elastic_pair(model, shape_names)):
        return elastic
    beyond = too_many_layers(scene) if method == "impulse" else too_much(model) if method not in UNBOUNDED else ""
    return f"method is {method!r}, but {beyond}; take another method" if beyond else ""


def elastic_pair(model: Model, shape_names: Sequence[str]) -> str:
    """Sentence on a pair with restitution, or "": what springs and dampers give back depends on the mass instead."""
    for (first, second), restitution in zip(model.pairs, model.pair_restitution, strict=True):
        if restitution > 0.0:
            return (
                f"{shape_names[first]!r} and {shape_names[second]!r} have a restitution of {restitution:g}, which "
                "contacts of springs and dampers do not keep; set it to 0 in the material of one of them, or take "
                "method impulse, partitioned or event_driven"
            )
    return ""


def unkept_wish(scene: Scene, model: Model, names: Sequence[str], load: Load, method: str, sub_step: float) -> str:
    """Sentence on the `error` that a scene wishes for, where it is known beforehand that it may be more; or ""."""
    if method not in ("impulse", "partitioned"):
        return ""
    if method == "impulse" and (asked := _beyond_impulse(scene, model, names, load)):
        return f"{asked}; haptic check --verify measures the relative error"
    step, (frequency, what) = sub_step, max(_modes(model))
    if method == "impulse":
        step = min(sub_step, step_inside(model, load, scene.error))
    expected = 0.5 * step * frequency
    if expected <= scene.error * (1.0 + 1e-9):
        return ""
    return (
        f"error {scene.error:g} is wanted, and {method} in steps of {step * 1e3:.4g} ms may have a relative error of "
        f"{expected:.2g}: of {what} at {frequency:.4g} rad/s; haptic check --verify measures it"
    )


def choose_sub_step(scene: Scene, model: Model, method: str) -> tuple[float, str]:
    """Sub-step [s] and why."""
    if scene.sub_step:
        return scene.sub_step, "the scene asks for it"
    longest, why = longest_step(model, scene.error)
    bodies = len(model.mass) - 1
    if method == "impulse" and SHORT <= longest < ACTS:
        longest = ACTS
        why += f"; {method} takes such steps inside a sub-step of {ACTS * 1e3:g} ms"
    if method == "partitioned" and longest > (own := max(SHORT, SOLVED * bodies)):
        longest = own
        why += f"; {method} takes {own * 1e3:g} ms, " + (
            "as short as the steps inside impulse"
            if own == SHORT
            else f"because the direct solution of {bodies} bodies needs this time"
        )
    step = next((step for step in STEPS if step <= longest), STEPS[-1])
    return step, why + (", which would be too slow" if longest < step else "")


def longest_step(model: Model, error: float) -> tuple[float, str]:
    """Longest step [s] that keeps this error of the fastest mode, and that in words."""
    frequency, what = max(_modes(model))
    longest = 2.0 * error / frequency
    return longest, (
        f"an error of {error:g} in the fastest mode ({what}, {frequency:.4g} rad/s) allows {longest * 1e3:.4g} ms"
    )


def _modes(model: Model) -> Iterator[tuple[float, str]]:
    """(angular frequency, what) of the coupling and of the scene's own springs."""
    yield math.sqrt(STIFFNESS / model.mass[0]), f"the tool on a coupling of {STIFFNESS:g} N/m"
    for spring, mobility in zip(model.joint_spring, model.joint_mobility, strict=True):
        if spring[0] > 0.0:
            yield math.sqrt(spring[0] * mobility), "a spring of the scene"


def too_many_layers(scene: Scene) -> str:
    """Sentence on layers that `impulse` has no bits for; or ""."""
    many = len(scene.shared_layers)
    return f"bodies share {many} layers, of which impulse takes at most {LAYERS}" if many > LAYERS else ""


def step_inside(model: Model, load: Load, error: float) -> float:
    """Longest step [s] that `impulse` takes inside its sub-step, where this error is allowed."""
    ratio, _, _, height = load
    jointed, wanted = len(model.joint_kind) > 0, error / max(_modes(model))[0]
    short = short_step(model)
    return short if jointed or ratio * height > EASY else max(short, min(LONG, wanted))


def short_step(model: Model) -> float:
    """Shortest step [s] that `impulse` takes inside a sub-step of that length or more."""
    return max(SHORT, SHORT_PER_BODY * (len(model.mass) - 1))


def _beyond_impulse(scene: Scene, model: Model, names: Sequence[str], load: Load) -> str:
    """What the scene asks for beyond `impulse`, in words; "" if nothing. `names`: of the bodies of the model."""
    if scene.error < HOLDS:
        return f"error {scene.error:g} is wanted; impulse holds {HOLDS:g}"
    longest, why = longest_step(model, scene.error)
    if longest < SHORT:
        return f"{why}, and impulse cannot keep up with steps below {SHORT * 1e3:g} ms"
    rate = float((model.joint_spring[:, 1] * model.joint_mobility).max(initial=0.0))  # c/m of the dampers
    grease = short_step(model) * rate  # a damper is a joint's
    if grease > GREASE:
        return (
            f"a damper holds a body back within {1e3 / rate:.2g} ms, a step of impulse is {grease:.3g} times "
            f"as long, and it keeps up with {GREASE:g}"
        )
    ratio, light, heavy, height = load
    if height > HIGH:
        return f"{height} bodies stand on one another, and impulse takes at most {HIGH}"
    if ratio * height > LOAD:
        return (
            f"{names[heavy]} is {ratio:.4g} times as heavy as {names[light]}"
            + (f", and {height} bodies stand on one another" if height > 1 else "")
            + f": a load of {ratio * height:.4g}, and impulse takes at most {LOAD:g}"
        )
    return ""


def load_of(model: Model) -> Load:
    """What a model's bodies weigh on each other."""
    pairs = {(a, b) for a, b in model.shape_body[model.pairs].tolist() + model.joint_bodies.tolist()}
    ratio, light, heavy = max(_ratios(model, pairs), default=(1.0, 0, 0))
    return ratio, light, heavy, max(1, _height(model))


def _ratios(model: Model, pairs: Iterable[tuple[int, int]]) -> Iterator[tuple[float, int, int]]:
    """(mass ratio, light body, heavy body) of those two that can both move."""
    for a, b in pairs:
        if not (model.fixed[a] or model.fixed[b]):
            light, heavy = sorted((a, b), key=lambda body: model.mass[body])
            yield model.mass[heavy] / model.mass[light], light, heavy


def _height(model: Model) -> int:
    """Bodies of the highest tower: how many steps from touch to touch the farthest body is from what is fixed."""
    near: dict[int, set[int]] = {}
    for a, b in _touching(model):
        near.setdefault(a, set()).add(b)
        near.setdefault(b, set()).add(a)
    ground = len(model.mass) - 1
    height, seen, layer = 0, {ground}, {ground}
    while layer := {body for under in layer for body in near.get(under, ())} - seen:
        height, seen = height + 1, seen | layer
    return height


def _touching(model: Model) -> Iterator[tuple[int, int]]:
    """Pairs of bodies that touch at the start."""
    shapes = [_outline(model, s) for s in range(len(model.radius))]
    middles = [turned(middle, at) for middle, (_, at) in zip(model.middle.tolist(), shapes, strict=True)]
    reach = model.reach.tolist()
    for i, j in model.pairs.tolist():
        near = math.dist(middles[i], middles[j]) <= reach[i] + reach[j] + TOUCHING
        if near and distance(*shapes[i], *shapes[j]) <= TOUCHING:
            yield model.shape_body[i], model.shape_body[j]


def _outline(model: Model, s: int) -> tuple[Outline, Pose]:
    corners = model.vertices[model.shape_start[s] : model.shape_start[s + 1]]
    return Outline(tuple(map(tuple, corners.tolist())), float(model.radius[s])), tuple(model.pose[model.shape_body[s]])
