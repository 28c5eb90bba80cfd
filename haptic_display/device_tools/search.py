# SPDX-License-Identifier: Apache-2.0
"""Which devices are connected, what answers there, and why nothing does."""

from collections.abc import Callable
from typing import Any

from haptic_device.os_errors import in_words
from haptic_display.device_tools import probe as device_probe
from haptic_display.device_tools import serial_ports
from haptic_display.device_tools.probe import Greeting
from haptic_display.device_tools.serial_ports import Port

NOT_ASKED = "not asked, since a byte that it does not expect may block it"
SILENT = "nothing greeted: no power, other firmware, or another baud"


def look(baud: int = 115200, patience: float = 1.0, hello: bool = True) -> list[dict[str, Any]]:
    """All serial ports, each asked for its greeting for so long [s] at this baud [bit/s]; hello: whether at all."""
    grabbed = serial_ports.grabber()
    return [found_at(port, grabbed, baud, patience, hello) for port in serial_ports.ports()]


def found_at(port: Port, grabbed: bool, baud: int, patience: float, hello: bool) -> dict[str, Any]:
    """One port: what it is, `greeting` or None, `answer`, a sentence, `link` for a description or None, and `notes`."""
    told, greeting = serial_ports.notes(port, grabbed), None
    if not hello:
        answer = "not asked"
    elif port.holders:
        answer = "not asked, since it is held"
    elif port.other_link:
        answer = f"a board for the link type {port.other_link}; {NOT_ASKED}"
    elif not port.allowed:
        answer = "not asked, since it may not be opened"
    else:
        greeting, answer = _asked(lambda: device_probe.ask_serial(port.path, baud, patience), SILENT)
    link = None
    if greeting:
        link = {"type": "serial", "port": port.lasting} | ({} if baud == 115200 else {"baud": baud})
    usb = {name: getattr(port, name) for name in ("vendor", "product", "serial", "maker", "model")}
    heard = {"answer": answer, "greeting": greeting._asdict() if greeting else None, "link": link, "notes": told}
    return {"port": port.path, "by_id": port.by_id, "usb": usb, **heard}


def plugged(seen: Callable[[], list[Port]], told: Callable[[str], None], wait: Callable[[], None]) -> Port:
    """The port that comes next.

    seen() gives the ports there are, wait() passes between two looks, told hears a sentence on each that is gone.
    """
    before = seen()
    while True:
        wait()
        now = seen()
        gone, come = serial_ports.changes(before, now)
        for port in gone:
            told(f"{port.lasting} is gone; plug it in again")
        if come:
            return come[0]
        before = now


def look_at(address: str, patience: float = 1.0) -> dict[str, Any]:
    """What answers at HOST:PORT of UDP, as found_at tells it. Raises ValueError for what is no such address."""
    host, port = address_of(address)
    silent = f"nothing greeted at {host}, port {port}: no such device, other firmware, or a firewall"
    greeting, answer = _asked(lambda: device_probe.ask_udp(host, port, patience), silent)
    link = {"type": "udp", "host": host, "port": port} if greeting else None
    told = greeting._asdict() if greeting else None
    return {"address": address, "answer": answer, "greeting": told, "link": link, "notes": []}


def address_of(text: str) -> tuple[str, int]:
    """(host, port) of HOST:PORT, an IPv6 address in brackets. Raises ValueError."""
    host, _, port = text.rpartition(":")
    if not host or not (port.isascii() and port.isdecimal()) or not 1 <= int(port) <= 65535:
        raise ValueError(f"--udp is {text!r}; HOST:PORT is needed, the port from 1 to 65535")
    return host.removeprefix("[").removesuffix("]"), int(port)


def _asked(ask: Callable[[], Greeting | None], silent: str) -> tuple[Greeting | None, str]:
    """(greeting or None, sentence)."""
    try:
        greeting = ask()
    except OSError as error:
        return None, f"it cannot be asked: {in_words(error)}"
    if greeting is None:
        return None, silent
    kind = "a simulated device" if greeting.simulated else "a device"
    axes = f"{greeting.axes} {'axis' if greeting.axes == 1 else 'axes'}"
    watchdog = f"watchdog {greeting.watchdog / 1e6:g} ms"
    return (
        greeting,
        f"{greeting.name or 'without a name'}: {kind} with {axes}, firmware {greeting.firmware}, {watchdog}",
    )
