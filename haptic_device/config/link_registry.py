# SPDX-License-Identifier: Apache-2.0
"""Links by name, as `link: {type: NAME, …}` of a device description says: a line here is all that a new one needs.

A link on a line is a module with `Options`, what a description may say beside `type`, `codec(options, device)`, which
makes its Codec, and `compiled()`, its two functions (haptic_device/link/codec). Only the one in use is imported.
"""

import importlib
import termios
from types import ModuleType
from typing import Annotated, Any

from pydantic import AfterValidator, Field, ValidationError, model_serializer, model_validator

from haptic_device.config.refusal import Part, Unit, sentences

LINKS = {
    "serial": "haptic_device.link.open_serial",
    "udp": "haptic_device.link.open_udp",
    "haply": "haptic_device.link.haply",
    "moteus": "haptic_device.link.moteus",
}
"""Links on a line, which haptic_bridge serves."""
SERVED = "loopback", "shared_memory"
"""Links that another process serves: haptic_loopback, or one of the user's own. They have no other keys."""
SPEEDS = {int(n[1:]): v for n, v in vars(termios).items() if n[:1] == "B" and n[1:].isdigit() and int(n[1:]) >= 1200}
"""Of serial lines [bit/s]: lower ones carry no samples, and 0 hangs up."""
BAUDS = f"{', '.join(map(str, sorted(SPEEDS)))} bit/s"


def _known(baud: int) -> int:
    if baud not in SPEEDS:
        raise ValueError(f"it should be one of {BAUDS}")
    return baud


class SerialOptions(Part):
    """A serial line: its port, a path or a link below /dev/serial/by-id; baud [bit/s], without meaning on USB CDC."""

    port: Annotated[str, Field(min_length=1)]
    baud: Annotated[int, Field(strict=True), AfterValidator(_known), Unit("bit/s")] = 115200


class UdpOptions(Part):
    """A UDP peer: host, an address or a name, and port of the device."""

    host: Annotated[str, Field(min_length=1)] = "127.0.0.1"
    port: Annotated[int, Field(ge=1, le=65535, strict=True)]


class Link(Part):
    """What a device is connected by: type, and the options of that type; None where it has none."""

    type: str
    options: Any = None

    @model_validator(mode="before")
    @classmethod
    def _read(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            raise ValueError(f"it should be a mapping such as {{type: serial, port: /dev/ttyACM0}}, not {given!r}")
        told = dict(given)
        name = told.pop("type", None)
        if name not in (*SERVED, *LINKS):
            said = "missing; write" if name is None else f"{name!r}; it should be"
            raise ValueError(f"type is {said} one of {', '.join((*SERVED, *LINKS))}")
        if name in SERVED:
            if told:
                raise ValueError(f"type {name} has no key {next(iter(told))!r}")
            return {"type": name}
        return {"type": name, "options": _options(name, told)}

    @model_serializer
    def _flat(self) -> dict[str, Any]:
        return {"type": self.type, **(self.options.model_dump(mode="json") if self.options else {})}

    @property
    def module(self) -> ModuleType:
        """The module of a link on a line."""
        return _module(self.type)


def _module(name: str) -> ModuleType:
    """The module of a link on a line. Raises ValueError where it is not there, or has not what the bridge needs."""
    try:
        module = importlib.import_module(LINKS[name])
    except ModuleNotFoundError as error:
        raise ValueError(f"type {name} is {LINKS[name]} in the registry of links: {error}") from None
    if missing := [part for part in ("Options", "codec", "compiled") if not hasattr(module, part)]:
        raise ValueError(f"type {name}: {LINKS[name]} has no {', '.join(missing)}")
    return module


def _options(name: str, told: dict[str, Any]) -> Part:
    kind = _module(name).Options
    try:
        return kind.model_validate(told)
    except ValidationError as error:
        raise ValueError(sentences(error, kind, lambda place: False)[0]) from None
