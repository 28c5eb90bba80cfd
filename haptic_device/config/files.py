# SPDX-License-Identifier: Apache-2.0
"""Finds the YAML files of config/: in the source tree, in a pip installation, in a colcon workspace, in that order."""

import difflib
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

INSTALLED = Path("share/haptic_display")
SHOWN = 6  # names that a refusal lists


class ConfigError(ValueError):
    """A file that cannot be used. The text is one sentence that begins with the name of the file.

    Attributes:
        found: one sentence for each error, without the name of the file.

    Examples:
        >>> from haptic_device.config.files import ConfigError
        >>> from haptic_device.config.description import parse
        >>> try:
        ...     parse({"axes": []}, "rail.yaml")
        ... except ConfigError as error:
        ...     for sentence in error.found:
        ...         print(sentence)
        name is missing; add it
        axes: it should have at least 1 item and has 0
    """

    def __init__(self, sentence: str, found: Sequence[str] = ()):
        super().__init__(sentence)
        self.found = tuple(found) or (sentence,)


def find(folder: str, name: str | Path) -> Path:
    """The file `name` if it exists, else config/<folder>/<name>.yaml; the folder "" is config/ itself.

    Raises FileNotFoundError with one sentence that suggests similar names.

    Args:
        folder: devices or scenes; "" is config/ itself.
        name: a name, or the path of a file.

    Examples:
        >>> from haptic_device.config.files import find
        >>> find("scenes", "wall").name
        'wall.yaml'
    """
    if Path(name).is_file():
        return Path(name)
    if path := _shipped(folder, name):
        return path
    raise FileNotFoundError(f"{name} is neither a file nor {_no_name(folder, name)}")


def find_beside(file: str | Path, folder: str, name: str) -> str:
    """What a YAML file means by `name`: a name in config/<folder>, as it stands, or else a path from the file's folder.

    The path comes back absolute. Raises FileNotFoundError if it is neither, ValueError if it is both; one sentence.
    """
    path = Path(os.path.abspath(Path(file).parent / name))
    shipped = None if "/" in name else _shipped(folder, name)
    if path.is_file() and shipped:
        raise ValueError(f"{name!r} is both the file {path} and a name in config/{folder}; write ./{name} for the file")
    if not path.is_file() and not shipped:
        raise FileNotFoundError(f"{name!r} is neither the file {path} nor {_no_name(folder, name)}")
    return name if shipped else str(path)


def names(folder: str) -> list[str]:
    """The names that `find` knows in a folder of config/, sorted, without `.yaml`.

    Args:
        folder: devices or scenes; "" is config/ itself.

    Examples:
        >>> from haptic_device.config.files import names
        >>> "desktop" in names("devices")
        True
    """
    return sorted({path.stem for root in places("config") for path in (root / folder).glob("*.yaml")})


def nearest(word: str, known: Iterable[str]) -> str:
    """The known word that is likely meant; "" if there is none like it."""
    return next(iter(difflib.get_close_matches(word, list(known), 1)), "")


def _shipped(folder: str, name: str | Path) -> Path | None:
    return next((path for root in places("config") if (path := root / folder / f"{name}.yaml").is_file()), None)


def _no_name(folder: str, name: str | Path) -> str:
    """The known names, of many the nearest six; with the one that is likely meant."""
    word, known = Path(name).stem, names(folder)
    shown = known if len(known) <= SHOWN else difflib.get_close_matches(word, known, SHOWN, 0.0)
    listed = ", ".join(shown) + (f" and {len(known) - SHOWN} more" if len(known) > SHOWN else "")
    asked = f"; did you mean {meant}?" if (meant := nearest(word, known)) else ""
    return f"a name in {Path('config', folder)}, which has {listed or 'no file at all'}{asked}"


def places(folder: str) -> Iterator[Path]:
    """Where this folder of ours may be: of the source tree, of a pip installation, of a colcon workspace."""
    source = Path(__file__).resolve().parents[2]
    # The package description marks a source tree; in site-packages a folder named config may be anybody's.
    if (source / "package.xml").is_file():
        yield source / folder
    for prefix in (sys.prefix, *filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))):
        yield Path(prefix) / INSTALLED / folder
