# SPDX-License-Identifier: Apache-2.0
"""Parameters as the page shows them: declarations out of the nodes' own, values as polled, and the file they make."""

import math
from collections.abc import Iterable
from typing import Any

from haptic_device.config.parameter_files import Values
from haptic_device.config.parameter_sections import SECTION
from haptic_device.config.parameter_types import Parameter, check_value
from haptic_device.config.yaml_reader import dump
from haptic_sim.node import parameters as node_parameters

DRIVER, LOOPBACK, SIMULATION = "haptic_driver", "haptic_loopback", "haptic_simulation"
RECORDER = "haptic_recorder"
NODES: dict[str, tuple[Parameter, ...]] = {node: node_parameters.NODES[node] for node in (DRIVER, LOOPBACK, SIMULATION)}
LIVE = {parameter.name: parameter for parameter in NODES[DRIVER] if parameter.live}
_OWN = ("autostart", "realtime", "realtime_priority", "publish.", "motion.")  # how a node runs, not what it displays


def declarations() -> list[dict[str, Any]]:
    """The driver's live parameters for the page, in the order of their declaration."""
    return [_shown(parameter) for parameter in LIVE.values()]


def live_of(values: dict[str, Any]) -> dict[str, Any]:
    """Those of the driver's values that may be changed while it runs."""
    return {name: value for name, value in values.items() if name in LIVE}


def typed(name: str, value: Any) -> Any:
    """A value of the page as the driver's parameter takes it: 300 becomes 300.0. ValueError: it does not take it."""
    if name not in LIVE:
        raise ValueError(f"{name} is not a parameter of haptic_driver that may be changed while it runs")
    kind = type(LIVE[name].default)
    if kind is tuple and isinstance(value, list):
        value = [float(item) if type(item) is int else item for item in value]
    elif (kind, type(value)) == (float, int) or kind is int and type(value) is float and value.is_integer():
        value = kind(value)
    check_value(LIVE[name], value)
    return value


def walls(driver: dict[str, Any]) -> list[tuple[float, float, float]]:
    """The servo's walls by the driver's values: normal x, normal y, offset along it [m]; none that are not known."""
    normals = driver.get("wall.normals", [])
    return list(zip(normals[::2], normals[1::2], driver.get("wall.offsets", []), strict=False))


def operating_point(namespace: str, values: Values) -> str:
    """A ROS 2 parameter file with everything that differs from the defaults; values: {node: {name: value}}."""
    given = {node: _differing(NODES[node], values.get(node, {})) for node in NODES}
    document = {f"{namespace.rstrip('/')}/{node}": {SECTION: found} for node, found in given.items() if found}
    head = "# Operating point saved by haptic_viewer; parameters not named here have their defaults.\n"
    return head + (dump(document, flow=True) if document else "")


def _shown(parameter: Parameter) -> dict[str, Any]:
    kind = {bool: "switch", str: "text", tuple: "list", int: "whole", float: "number"}[type(parameter.default)]
    told = {name: getattr(parameter, name) for name in ("name", "unit", "meaning", "choices")}
    limits = {"low": _finite(parameter.low), "high": _finite(parameter.high)}
    return {**told, **limits, "kind": kind, "felt": parameter.felt and (parameter.low, parameter.felt)}


def _finite(limit: float) -> float | None:
    """None where there is no limit: JSON knows no infinity."""
    return limit if math.isfinite(limit) else None


def _differing(declared: Iterable[Parameter], given: dict[str, Any]) -> dict[str, Any]:
    known = {parameter.name: parameter.default for parameter in declared if not parameter.name.startswith(_OWN)}
    return {name: value for name, value in given.items() if name in known and known[name] != value}
