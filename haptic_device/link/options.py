# SPDX-License-Identifier: Apache-2.0
"""What all links of a kind may say in a device description; readable without a compiler."""

from typing import Annotated

from pydantic import Field

from haptic_device.refusal import Part, Unit

MOST_BAUD = 12_000_000


class SerialOptions(Part):
    """A serial line: its port, a path or a link below /dev/serial/by-id; baud [bit/s], without meaning on USB CDC."""

    port: Annotated[str, Field(min_length=1)]
    baud: Annotated[int, Field(ge=1200, le=MOST_BAUD, strict=True), Unit("bit/s")] = 115200


class UdpOptions(Part):
    """A UDP peer: host, an address or a name; port of the device."""

    host: Annotated[str, Field(min_length=1)] = "127.0.0.1"
    port: Annotated[int, Field(ge=1, le=65535, strict=True)]
