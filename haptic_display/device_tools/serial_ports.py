# SPDX-License-Identifier: Apache-2.0
"""Serial ports of this machine: what is plugged in, who may open it, who has, and what is wrong with that."""

import contextlib
import grp
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from serial.tools.list_ports import comports

LASTING, PROCESSES = Path("/dev/serial/by-id"), Path("/proc")
GRABS = "ModemManager"
RULES = "/etc/udev/rules.d/70-haptic-display.rules"
OTHERS = {"mjbots": "moteus", "haply": "haply"}
"""Words that makers put into their boards, and the type of link that these are."""


class Port(NamedTuple):
    """A port: path, its lasting name below /dev/serial/by-id or ""; what the USB device says of itself, or "".

    allowed: whether this user may open it; group: that may; holders: processes that have it open; latency_timer [ms],
    None where it has none.
    """

    path: str
    by_id: str
    vendor: str
    product: str
    serial: str
    maker: str
    model: str
    allowed: bool
    group: str
    holders: tuple[str, ...]
    latency_timer: int | None

    @property
    def lasting(self) -> str:
        """The name that stays with the device when it is plugged in anew, if it has one."""
        return self.by_id or self.path

    @property
    def other_link(self) -> str:
        """Type of link of a maker's board that does not speak our protocol; "" if it is none that is known."""
        said = f"{self.maker} {self.model}".lower()
        return next((link for word, link in OTHERS.items() if word in said), "")


def ports() -> list[Port]:
    """All USB serial ports, by name."""
    found = []
    for _ in range(2):
        with contextlib.suppress(TypeError):  # pyserial stumbled over a port that was just unplugged
            found = comports()
            break
    open_files, lasting = _open_files(), _lasting()
    usb = sorted(one for one in found if one.vid is not None)
    return [_port(one, open_files.get(one.device, ()), lasting.get(one.name, "")) for one in usb]


def grabber() -> bool:
    """Whether ModemManager runs, which opens each new port and talks to it."""
    return any(_text(folder / "comm") == GRABS for folder in _processes())


def notes(port: Port, grabbed: bool) -> list[str]:
    """Sentences on what keeps this port from serving a device, each with its cure."""
    said = []
    if not port.allowed:
        join = f"sudo usermod -aG {port.group} $USER, then log in again" if port.group not in ("", "root") else ""
        cure = " or ".join(filter(None, (join, f"write {rule(port)!r} to {RULES} and plug it in again")))
        said.append(f"{port.path} may not be opened by this user, but by the group {port.group}: {cure}")
    if port.holders:
        said.append(f"{port.path} is held by {', '.join(port.holders)}: end that first")
    if grabbed:
        mute = _rule(port, 'ENV{ID_MM_DEVICE_IGNORE}="1"')
        said.append(f"{GRABS} runs and may talk to {port.path}: write {mute!r} to {RULES} and plug it in again")
    if port.latency_timer is not None and port.latency_timer > 1:
        cure = 'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"'
        late = f"{port.path} keeps what it receives for {port.latency_timer} ms, its latency timer; the limit is 1 ms"
        said.append(f"{late}: write {cure!r} to {RULES} and plug it in again")
    return said


def rule(port: Port) -> str:
    """The udev rule that lets the group dialout, and whoever sits at the machine, open such a device."""
    return _rule(port, 'MODE="0660", GROUP="dialout", TAG+="uaccess"')


def _rule(port: Port, effect: str) -> str:
    device = f'ATTRS{{idVendor}}=="{port.vendor}", ATTRS{{idProduct}}=="{port.product}"'
    return f'SUBSYSTEM=="tty", {device}, {effect}'


def changes(before: list[Port], after: list[Port]) -> tuple[list[Port], list[Port]]:
    """(those that are gone, those that have come), by path and what they say of themselves."""
    old, new = ({(port.path, port.by_id, port.serial): port for port in seen} for seen in (before, after))
    return [old[key] for key in old.keys() - new.keys()], [new[key] for key in new.keys() - old.keys()]


def _port(one: Any, holders: Iterable[str], by_id: str) -> Port:
    serial, maker, model = (_printable(text or "") for text in (one.serial_number, one.manufacturer, one.product))
    timer = _text(Path(one.device_path) / "latency_timer")
    latency = int(timer) if timer.isdecimal() else None
    allowed, ids = os.access(one.device, os.R_OK | os.W_OK), (f"{one.vid:04x}", f"{one.pid:04x}")
    group = _group(Path(one.device))
    return Port(one.device, by_id, *ids, serial, maker, model, allowed, group, tuple(holders), latency)


def _group(path: Path) -> str:
    try:
        number = path.stat().st_gid
        return grp.getgrgid(number).gr_name
    except OSError:
        return ""
    except KeyError:
        return str(number)


def _lasting() -> dict[str, str]:
    """{name of a port: its link below /dev/serial/by-id}."""
    return {Path(os.path.realpath(link)).name: str(link) for link in sorted(LASTING.glob("*"), reverse=True)}


def _open_files() -> dict[str, list[str]]:
    """{path: [processes that have it open]}, of the processes that this user may look at."""
    found: dict[str, list[str]] = {}
    for folder in _processes():
        with contextlib.suppress(OSError):  # another user's, or it has ended meanwhile
            names = {os.readlink(entry) for entry in (folder / "fd").iterdir()}
            for name in names:
                if "/dev/tty" in name:
                    found.setdefault(name, []).append(f"{_text(folder / 'comm')} (process {folder.name})")
    return found


def _processes() -> list[Path]:
    return sorted(folder for folder in PROCESSES.glob("[0-9]*") if folder.name.isdecimal())


def _printable(text: str) -> str:
    return "".join(letter for letter in text.strip() if letter.isprintable())


def _text(file: Path) -> str:
    try:
        return _printable(file.read_text(errors="replace"))
    except OSError:
        return ""
