# SPDX-License-Identifier: Apache-2.0
"""Finds the YAML files of config/: in the source tree, in a pip installation, in a colcon workspace, in that order."""

import os
import sys
from pathlib import Path

INSTALLED = Path("share/haptic_display/config")


def find(folder: str, name) -> Path:
    """The file name if it exists, else config/<folder>/<name>.yaml ("" is config/ itself).

    Raises FileNotFoundError, one sentence with the names that exist.
    """
    if Path(name).is_file():
        return Path(name)
    for root in _roots():
        if (path := root / folder / f"{name}.yaml").is_file():
            return path
    there = ", ".join(names(folder)) or "no file at all"
    raise FileNotFoundError(f"{name} is neither a file nor a name in {Path('config', folder)}, which has {there}")


def names(folder: str) -> list[str]:
    """Sorted names that find(folder, name) knows, without the .yaml."""
    return sorted({path.stem for root in _roots() for path in (root / folder).glob("*.yaml")})


def _roots():
    source = Path(__file__).resolve().parent.parent
    # The package description marks a source tree; in site-packages a folder named config may be anybody's.
    if (source / "package.xml").is_file():
        yield source / "config"
    yield Path(sys.prefix) / INSTALLED
    for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        yield Path(prefix) / INSTALLED
