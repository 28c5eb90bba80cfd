# SPDX-License-Identifier: Apache-2.0
"""What is wrong in a configuration file: an operating point, a device description or a scene."""

from pathlib import Path

from haptic_device import controller_config, gain_check, ros_yaml
from haptic_device.description import load_device
from haptic_device.device import loopback_config
from haptic_device.parameter_files import operating_point_problems, read_operating_point
from haptic_device.parameter_types import SECTION, check_value, unknown
from haptic_device.parameters import OPERATOR
from haptic_sim.node_parameters import NODES
from haptic_sim.scene import load as load_scene


def problems(path: Path) -> list[str]:
    """Sentences for what is wrong in the file; which kind of file it is shows in its top-level keys."""
    try:
        document = ros_yaml.load(path)
        if _has_section(document):
            return list(operating_point_problems(document, NODES)) or _together(path)
        if "axes" in document:
            load_device(path)
            return []
        if "bodies" in document or "tool" in document:
            return _motion(load_scene(path).motion)
        raise ValueError(
            f"neither an operating point ({SECTION}), a device description (axes) nor a scene (bodies, tool): "
            f"it has {', '.join(document) or 'no keys'}"
        )
    except OSError as error:
        return [error.strerror or str(error)]
    except ValueError as error:
        return [str(error).removeprefix(f"{path}: ")]


def _together(path):
    """What is wrong with values that are right one by one: walls that do not fit, gains beyond the device, names."""
    given = read_operating_point(path, NODES)
    everything = {
        node: {parameter.name: parameter.default for parameter in declared} | given.get(node, {})
        for node, declared in NODES.items()
    }
    driver = everything["haptic_driver"]
    device = load_device(driver["device"])
    loopback_config.hand_from(load_device(everything["haptic_loopback"]["device"]), everything["haptic_loopback"])
    load_scene(everything["haptic_simulation"]["scene"])
    settings = controller_config.settings_from(device, driver)
    refusal = (
        gain_check.refusal(settings[0], float(settings[0]["hardware"]["delay"]))
        if driver["passivity.policy"] == "enforce"
        else ""
    )
    return [refusal] if refusal else []


def _motion(motion):
    """What the loopback would refuse of a scene's suggested motion."""
    known = {parameter.name: parameter for parameter in OPERATOR}
    for key, value in motion.items():
        if f"motion.{key}" not in known:
            return [unknown(f"motion.{key}", "a parameter of haptic_loopback", known)]
        check_value(known[f"motion.{key}"], value)
    return []


def _has_section(document):
    return any(name == SECTION or isinstance(item, dict) and _has_section(item) for name, item in document.items())
