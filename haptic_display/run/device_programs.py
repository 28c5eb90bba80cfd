# SPDX-License-Identifier: Apache-2.0
"""The processes that a device needs beside the driver: haptic_loopback, or a bridge and what it speaks to."""

import contextlib
import socket
from pathlib import Path

from haptic_device.config.description import Device, load_device
from haptic_device.config.link_registry import UdpOptions
from haptic_device.config.parameter_types import defaults
from haptic_display.run.processes import Program
from haptic_sim.node.parameters import NODES
from haptic_sim.scene.needs import BRIDGE, LOOPBACK, served_by

REFERENCE = "reference_device"
MODULES = {LOOPBACK: "haptic_device.nodes.loopback", BRIDGE: "haptic_device.nodes.bridge"}


def device_programs(name: str, hand: dict, folder: Path, files: tuple[Path, ...] = ()) -> list[Program]:
    """Programs to be started for the device of this name or file, in this order.

    hand: parameters of haptic_loopback, which the reference device follows too, and what cuts it; folder: where its
    settings and its terminal go; files: of more parameters. ValueError, one sentence, where it cannot be had.
    """
    device = load_device(name)
    node = served_by(device.link.type)
    if device.handle and not files:  # whose 0 need not be where its handle can be
        middle = [device.scale[0] * sum(along) / 2.0 for along in device.handle.used]
        hand = {"motion.start": [*middle, *[0.0] * (3 - len(middle))], **hand}
    if node == LOOPBACK:
        return [Program(LOOPBACK, MODULES[LOOPBACK], {"device": name, **hand}, files)]
    if not node:
        return []
    bridge = {"device": name}
    if getattr(device.link.options, "program", "") != "reference":
        return [Program(BRIDGE, MODULES[BRIDGE], bridge, files)]
    if "motor_watchdog" in hand:
        bridge["motor_watchdog"] = hand["motor_watchdog"]
    line, bridge["port"] = _line(device, folder)
    return [_reference(device, hand, folder, line), Program(BRIDGE, MODULES[BRIDGE], bridge, files)]


def _line(device: Device, folder: Path) -> tuple[tuple[str, str], str]:
    """Words that tell the reference device its line, and the bridge's `port`."""
    if isinstance(device.link.options, UdpOptions):
        with contextlib.closing(socket.socket(type=socket.SOCK_DGRAM)) as free:
            free.bind(("127.0.0.1", 0))
            port = str(free.getsockname()[1])
        return ("--udp", port), port
    terminal = str(folder.absolute() / "reference.pty")
    return ("--pty", terminal), terminal


def _reference(device: Device, hand: dict, folder: Path, line: tuple[str, str]) -> Program:
    from haptic_display.run.reference_device import compiled, config_of

    values = defaults(NODES[LOOPBACK]) | hand
    program, settings = compiled(), folder.absolute() / "reference_device.txt"
    folder.mkdir(parents=True, exist_ok=True)
    settings.write_text(config_of(device, values))
    return Program(REFERENCE, "", words=(str(program), "--config", str(settings), *line))
