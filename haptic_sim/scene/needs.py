# SPDX-License-Identifier: Apache-2.0
"""What a scene needs to be felt: launch file, `haptic demo` and page ask `needs_of`, tools for devices `served_by`.

Needs no library but PyYAML: the launch file has no other.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from haptic_device.config.files import find, find_beside
from haptic_device.config.parameter_sections import given_to, sections
from haptic_device.config.yaml_reader import load
from haptic_sim.scene.motion import flat_motion

LOOPBACK, BRIDGE = "haptic_loopback", "haptic_bridge"
TOGETHER = 45.0  # [s] that the driver waits for its simulation, which may be compiling its kernels


class Needs(NamedTuple):
    """device: a path or name; "" for the default, which is simulated. serving: the node of ours that serves it; "" for
    somebody else's process. motion: {parameter of the hand: value} that the scene suggests. start: where the tool
    begins [m, m, rad]."""

    device: str
    serving: str
    motion: dict[str, Any]
    start: Any


def needs_of(scene: Any, device: str = "", files: Iterable[str | Path] = (), namespace: str = "/haptic") -> Needs:
    """Of a scene, a path or name, "" for none; with this device, or else that which parameter files give the driver.

    What is wrong in the rest of scene, device or files, the nodes say. Raises OSError or ValueError, one sentence.
    """
    content = load(find("scenes", scene)) if scene else {}
    motion, tool = (part if isinstance(part, dict) else {} for part in (content.get("motion"), content.get("tool")))
    try:
        hand = {f"motion.{name}": value for name, value in flat_motion(motion).items()}
    except ValueError as error:
        raise ValueError(f"{scene}: motion.{error}") from None
    device = device or _device_in(files, f"{namespace.rstrip('/')}/haptic_driver")
    link = (load(find("devices", device)).get("link") if device else None) or {"type": "loopback"}
    kind = link.get("type") if isinstance(link, dict) else None
    return Needs(device, served_by(str(kind)), hand, tool.get("pose", (0.0, 0.0, 0.0)))


def served_by(link: str) -> str:
    """The node of ours that serves the page of a device with a link of this type; "" for somebody else's process."""
    return {"loopback": LOOPBACK, "shared_memory": ""}.get(link, BRIDGE)


def _device_in(files: Iterable[str | Path], driver: str) -> str:
    found = ""
    for file in files:
        try:
            device = given_to(driver, sections(load(file, ros=True))).get("device")
        except ValueError:  # which the nodes say
            continue
        found = find_beside(Path(file), "devices", device) if isinstance(device, str) else found
    return found
