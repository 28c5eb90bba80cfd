# SPDX-License-Identifier: Apache-2.0
"""A device that speaks the link protocol (docs/link_protocol.md) over UDP."""

from typing import Literal

from haptic_device.link import open_frame
from haptic_device.link.codec import Codec
from haptic_device.link_registry import UdpOptions

compiled = open_frame.datagrams


class Options(UdpOptions):
    """program: `reference` if it is a reference device, which `haptic demo` starts."""

    program: Literal["none", "reference"] = "none"


def codec(options, device):
    """The codec of such a device; whatever the description says, the device greets with what it is."""
    return Codec(open_frame.new_state(), *compiled(), datagram=True)
