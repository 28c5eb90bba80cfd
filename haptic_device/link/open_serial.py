# SPDX-License-Identifier: Apache-2.0
"""A device that speaks the link protocol (docs/reference/link_protocol.md) over a serial line.

The compiler is imported where it is needed: who only reads a description does without.
"""

from typing import Literal

from haptic_device.config.link_registry import SerialOptions


class Options(SerialOptions):
    """program: `reference` if it is a reference device, which `haptic demo` starts."""

    program: Literal["none", "reference"] = "none"


def codec(options, device):
    """The codec of such a device; whatever the description says, the device greets with what it is."""
    from haptic_device.link.codec import Codec
    from haptic_device.link.open_state import new_state

    return Codec(new_state(), *compiled())


def compiled():
    """encode and decode; compiled where there is such a link."""
    from haptic_device.link import open_frame

    return open_frame.streams()
