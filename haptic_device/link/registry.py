# SPDX-License-Identifier: Apache-2.0
"""Links by name, as `link: {type: NAME}` of a device description says: a line here is all that a new one needs.

A link is a module of this folder with `Options`, a Part (haptic_device/refusal) with the keys that a description may have
beside `type`, derived from SerialOptions or UdpOptions by the line that it runs on, and `codec(options, device)`, which
makes its Codec (haptic_device/link/codec). Only the one that is used is imported.
"""

import importlib

LINKS = {
    "serial": "haptic_device.link.open_serial",
    "udp": "haptic_device.link.open_udp",
    "haply": "haptic_device.link.haply",
    "moteus": "haptic_device.link.moteus",
}
WITHOUT_BRIDGE = "loopback", "shared_memory"
"""Links that some other process serves: haptic_loopback, or one of the user's own. They have no keys."""


def module_of(name: str):
    """The module of a link on a line."""
    return importlib.import_module(LINKS[name])
