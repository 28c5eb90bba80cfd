# SPDX-License-Identifier: Apache-2.0
"""What is wrong in a configuration file, all of it: an operating point, a device description or a scene."""

import functools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from haptic_device.config import parameter_files as files
from haptic_device.config import yaml_reader
from haptic_device.config.description import load_device
from haptic_device.config.files import ConfigError
from haptic_device.config.link_registry import SERVED
from haptic_device.config.parameter_sections import SECTION, outside
from haptic_device.config.parameter_types import defaults
from haptic_device.config.parameters import OPERATOR
from haptic_device.control import controller_config, gain_check
from haptic_device.device import loopback_config, operator_hand
from haptic_sim.method_registry import AUTO
from haptic_sim.node.parameters import NODES
from haptic_sim.reduction import reduce_scene
from haptic_sim.reduction.method_choice import refusal
from haptic_sim.reduction.promise import unkept_wish
from haptic_sim.scene.checks import hand_inside, too_large
from haptic_sim.scene.language import load as load_scene
from haptic_sim.scene.motion import flat_motion

Measure = Callable[[dict[str, Any]], float | None]
"""How late [s] a machine's writes are, 99 % of them, with these values of the driver; None where it cannot be known."""
DEVICE = {"axes", "kinematics"}  # keys of which a device description has one


def _unknown(driver: dict[str, Any]) -> None:
    return None


def problems(path: Path, measure: Measure = _unknown) -> list[str]:
    """All errors in a YAML file, one sentence each; an empty list if there are none.

    Args:
        path: an operating point, a device description or a scene; the top-level keys tell which.
        measure: how late the writes of this machine are, for gains that are too stiff; nothing is measured by default.

    Examples:
        >>> from pathlib import Path
        >>> from haptic_display.run.config_problems import problems
        >>> file = Path("stiff.yaml")
        >>> _ = file.write_text("/**/haptic_driver: {ros__parameters: {coupling: {stiffness: -5.0}}}")
        >>> problems(file)
        ['/**/haptic_driver: coupling.stiffness is -5.0 N/m; at least 0.0 N/m is needed']
    """
    try:
        document = yaml_reader.load(path)
        if _has_section(document):
            document = yaml_reader.load(path, ros=True)
            together = dict.fromkeys(_together(document, path, measure))
            return [*files.operating_point_problems(document, NODES), *together]
        if DEVICE & document.keys():
            return _refused(load_device, path)
        if "bodies" in document or "tool" in document:
            wrong = [*_refused(load_scene, path), *_motion(document.get("motion"))]
            return wrong or [*_unfit(scene := load_scene(path)), *_unled(scene)]
        raise ValueError(
            f"neither an operating point ({SECTION}), a device description (axes, or kinematics) nor a scene (bodies, "
            f"tool): it has {', '.join(document) or 'no keys'}"
        )
    except ValueError as error:
        return _sentences(error, path)


def _sentences(error: ValueError, at: Any) -> list[str]:
    """What is refused, without the name of the file in which it is."""
    found = error.found if isinstance(error, ConfigError) else [str(error)]
    return [sentence.removeprefix(f"{at}: ") for sentence in found]


def _unfit(scene, method=AUTO) -> list[str]:
    """What no method, or not the one that is asked for, takes of a right scene."""
    try:
        reduced = reduce_scene(scene, method)
    except ValueError as refused:
        return [str(refused)]
    return [refused] if (refused := refusal(scene, reduced.model, reduced.shape_names, reduced.method)) else []


def _unled(scene, start=None, scale=1.0) -> Iterator[str]:
    """Why a hand could not lead the tool of a right scene; start: of its motion, if that is not the scene's."""
    yield from too_large(scene.tool, scale)
    if start or scene.motion:
        start = start or scene.motion.get("start", defaults(OPERATOR)["motion.start"])
        yield from hand_inside(tuple(scene.solids.values()), scene.kept_apart, start)


def remark(path: Path, measure: Measure = _unknown) -> str:
    """One sentence about what a valid file asks for and will not get, or "".

    For a scene: its method has a larger error than the scene asks for. For an operating point: its gains are passive
    without delay, but not with writes as late as on this machine; or it leaves out the simulated device.

    Args:
        path: as in `problems`.
        measure: as in `problems`.

    Examples:
        >>> from haptic_device.config.files import find
        >>> from haptic_display.run.config_problems import remark
        >>> remark(find("scenes", "wall"))
        ''
    """
    document = yaml_reader.load(path)
    if not _has_section(document):
        return "" if DEVICE & document.keys() else unkept_wish(path)
    given = files.read_operating_point(path, NODES)
    values = defaults(NODES["haptic_simulation"]) | given["haptic_simulation"]
    said = unkept_wish(values["scene"], values["method"]), _left_out(given), _too_late(given, measure)
    return "; ".join(filter(None, said))


def _left_out(given) -> str:
    """Why a simulated device that the file does not name would be another one than the driver's."""
    own, default = given["haptic_driver"].get("device"), defaults(NODES["haptic_loopback"])["device"]
    if own in (None, default) or given["haptic_loopback"] or load_device(own).link.type != "loopback":
        return ""
    return (
        f"haptic_loopback has no section and is {default!r} where a launch file starts it; "
        f"name device {own!r} there too (haptic demo does)"
    )


def _too_late(given, measure) -> str:
    """Why the gains of a right operating point leave no damping over where the writes are as late as here."""
    values = defaults(NODES["haptic_driver"]) | given["haptic_driver"]
    if values["passivity.policy"] != "enforce" or (late := measure(values)) is None:
        return ""
    settings = controller_config.settings_unjudged(load_device(values["device"]), values)[0]
    delays = gain_check.delays(settings)
    sentence = next(gain_check.refusals(settings, delays + late, delays), "")
    return f"99 % of the writes here are within {late * 1e3:.3g} ms, and {sentence}" if sentence else ""


def _refused(look, at) -> list[str]:
    """What is said where a look at this raises it."""
    try:
        look(at)
    except ValueError as error:
        return _sentences(error, at)
    return []


def _together(document, path, measure) -> Iterator[str]:
    """What is wrong with values that are right one by one: names, walls that do not fit, gains beyond the device."""
    given, wrong = files.right_values(document, NODES)
    missing = list(files.file_problems(given, path))
    yield from missing
    values = {node: defaults(declared) | given[node] for node, declared in NODES.items()}
    yield from _two_methods(values, wrong)
    loaded = {}
    named = (
        ("haptic_driver", "device", load_device, functools.partial(_driver, measure)),
        ("haptic_loopback", "device", load_device, _hand),
        ("haptic_bridge", "device", load_device, _bridged),
        ("haptic_simulation", "scene", load_scene, _simulation),
    )
    for node, name, load, judge in named:
        if name in wrong[node] or any(sentence.startswith(f"{node}: {name} ") for sentence in missing):
            continue
        try:
            content = load(values[node][name])
        except ConfigError as error:
            yield from (f"{name} {values[node][name]}: {sentence}" for sentence in error.found)
            continue
        loaded[node] = content
        yield from judge(content, values[node], wrong[node])
    yield from _two_devices(loaded, given, values)
    if given["haptic_simulation"].get("scene") and {"haptic_simulation", "haptic_loopback"} <= set(loaded):
        hand, scale = values["haptic_loopback"], loaded.get("haptic_driver", loaded["haptic_loopback"]).scale[0]
        start = hand["motion.start"] if _any(given["haptic_loopback"], "motion.") else None
        yield from _scene_beyond(loaded["haptic_simulation"], loaded["haptic_loopback"], hand, start, scale)


def _two_methods(values, wrong) -> Iterator[str]:
    """Whether driver and simulation would refuse each other's samples."""
    name, sides = "exchange.method", ("haptic_driver", "haptic_simulation")
    ours, theirs = (values[node][name] for node in sides)
    if ours != theirs and not any(name in wrong[node] for node in sides):
        yield f"{name} is {ours!r} of haptic_driver and {theirs!r} of haptic_simulation; both must have the same"


def _two_devices(loaded, given, values) -> Iterator[str]:
    """Whether the loopback would be another device than the driver takes it for; a driver alone has hardware."""
    sides = "haptic_driver", "haptic_loopback"
    if not all(given[node] and node in loaded for node in sides):
        return
    ours, theirs = (loaded[node] for node in sides)
    if ours != theirs:
        names = " and ".join(f"{values[node]['device']!r} of {node}" for node in sides)
        yield f"device is {names}, which differ in {_differences(ours, theirs)}; both must have the same"


def _differences(one, other) -> str:
    """Keys of two device descriptions that have not the same value, as they are written."""
    keys = [key for key in _unlike(one, other) if key not in ("name", "axes")]
    if len(one.axes) != len(other.axes):
        return ", ".join(["axes", *keys])
    for i, (a, b) in enumerate(zip(one.axes, other.axes, strict=True)):
        if i >= len(one.joints):  # else they follow from joints and handle
            keys += [f"axes[{i}].{key}" for key in _unlike(a, b)]
    return ", ".join(keys or ["name"])


def _unlike(one, other) -> list[str]:
    return [key for key in type(one).model_fields if getattr(one, key) != getattr(other, key)]


def _scene_beyond(scene, device, values, start, scale) -> Iterator[str]:
    """What is too large for the driver's device, or of the suggested motion outside the workspace of the loopback's."""
    motion = values | {f"motion.{key}": value for key, value in scene.motion.items()}
    if not _motion(scene.motion):
        found = *_unled(scene, start, scale), *loopback_config.outside(device, motion)
        yield from (f"scene {scene.name!r}: {sentence}" for sentence in found)


def _driver(measure, device, values, wrong) -> Iterator[str]:
    """What of a driver's values does not fit its device; where some are wrong, their defaults count."""
    walls = [] if _any(wrong, "wall.") else list(controller_config.wall_problems(len(device.axes), values))
    yield from walls
    if walls or _any(wrong, "wall."):
        values = values | {name: () for name in values if name.startswith("wall.")}
    others = sorted(name for name in wrong if not name.startswith("wall."))
    told = f" (with the default of {', '.join(others)})" if others else ""
    try:
        settings = controller_config.settings_unjudged(device, values)[0]
    except ValueError as error:
        yield f"{error}{told}"
        return
    if values["passivity.policy"] == "enforce":
        lateness = gain_check.delays(settings)
        if not gain_check.refusal(settings, lateness):
            return
        late = measure(values)
        other = None if late is None else lateness + late
        yield from (f"{sentence}{told}" for sentence in gain_check.refusals(settings, lateness, other))


def _bridged(device, values, wrong) -> Iterator[str]:
    """Whether the bridge of these values serves its device; its default is a device that it does not."""
    if device.link.type in SERVED and values["device"] != defaults(NODES["haptic_bridge"])["device"]:
        yield f"device {device.name} has link type {device.link.type}, which haptic_bridge does not serve"


def _simulation(scene, values, wrong) -> Iterator[str]:
    """What of a scene the method of these values does not take."""
    if "method" not in wrong:
        yield from (f"scene {scene.name!r}: {sentence}" for sentence in _unfit(scene, values["method"]))


def _hand(device, values, wrong) -> Iterator[str]:
    """What of a loopback's values does not fit its device."""
    if not _any(wrong, "motion."):
        yield from _refused(operator_hand.script, values) or loopback_config.outside(device, values)


def _any(names, begin) -> bool:
    return any(name.startswith(begin) for name in names)


def _motion(motion) -> list[str]:
    """What the loopback would refuse of a scene's suggested motion."""
    if not isinstance(motion, dict):  # which the scene's language refuses, if it is there
        return []
    if _refused(flat_motion, motion):  # likewise
        motion = {**motion, "waypoints": [0.0, 0.0, 0.0]}
    motion = {f"motion.{key}": value for key, value in flat_motion(motion).items()}
    known = {"haptic_loopback": [parameter for parameter in OPERATOR if parameter.name.startswith("motion.")]}
    wrong = [sentence for item in motion.items() for sentence in files.entry_problems(*item, known)]
    return wrong or _refused(operator_hand.script, defaults(OPERATOR) | motion)


def _has_section(document):
    return any(name == SECTION for _, name, _ in outside(document))
