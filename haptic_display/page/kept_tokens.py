# SPDX-License-Identifier: Apache-2.0
"""The tokens of the links, kept in the user's state folder, so that a bookmark still opens the page tomorrow."""

import contextlib
import os
import re
import secrets
import stat
from pathlib import Path
from typing import NamedTuple

from haptic_device.os_errors import in_words

_FORM = re.compile(r"([\w-]{22})\n([\w-]{22})\n", re.ASCII)  # as fresh() makes them
_OTHERS = 0o077  # any right of group or others


class Tokens(NamedTuple):
    """Of the page with control, and of the one that only looks on."""

    control: str
    look: str


def fresh() -> Tokens:
    """Two random tokens of 128 bits each."""
    return Tokens(secrets.token_urlsafe(16), secrets.token_urlsafe(16))


def kept() -> tuple[Tokens, str]:
    """The user's tokens, made if there are none; and "", or a sentence: why those in the file were not used."""
    path = None
    try:
        path = place()
        tokens, why = _read(path)
        if tokens is None:
            tokens = fresh()
            _write(path, tokens)
        return tokens, f"{path} {why}: the links are new" if why else ""
    except (OSError, RuntimeError) as error:  # RuntimeError: nobody's home is known
        return fresh(), f"the links change at each start: {in_words(error)}"


def forget() -> None:
    """Removes the user's tokens: the next start makes new ones. OSError if that is not possible."""
    place().unlink(missing_ok=True)


def place() -> Path:
    """The file. OSError if this user's state folder cannot be found."""
    base = os.environ.get("XDG_STATE_HOME", "")
    try:
        home = Path(base) if os.path.isabs(base) else Path.home() / ".local" / "state"
    except RuntimeError as error:
        raise OSError(str(error)) from None
    return home / "haptic_display" / "links"


def _read(path: Path) -> tuple[Tokens | None, str]:
    """Tokens, or None and why what is there is not used ("" where nothing is)."""
    try:
        file = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except FileNotFoundError:
        return None, ""
    except OSError as error:
        return None, f"cannot be read ({error.strerror})"
    with open(file, "rb") as opened:
        state = os.fstat(file)
        if not stat.S_ISREG(state.st_mode) or state.st_uid != os.geteuid():
            return None, "is no file of yours"
        if state.st_mode & _OTHERS:
            return None, "could be read or written by others"
        found = _FORM.fullmatch(opened.read(100).decode("ascii", "replace"))
    return (Tokens(*found.groups()), "") if found else (None, "holds no links")


def _write(path: Path, tokens: Tokens) -> None:
    """A file of this user alone, whole or not at all."""
    _own(path.parent)
    draft = path.with_name(f".{path.name}-{secrets.token_hex(8)}")
    file = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    try:
        with open(file, "w") as opened:
            opened.write("".join(f"{token}\n" for token in tokens))
        draft.replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            draft.unlink()
        raise


def _own(folder: Path) -> None:
    """Makes the folder, of this user alone. OSError if it is somebody else's."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if folder.stat().st_uid != os.geteuid():
        raise PermissionError(f"{folder} is another user's folder")
    folder.chmod(0o700)
