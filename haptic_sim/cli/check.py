# SPDX-License-Identifier: Apache-2.0
"""`haptic check FILE...`: says whether configuration files are right, before anything moves."""

from pathlib import Path
from typing import Annotated

import typer

from haptic_device import ros_yaml
from haptic_device.device import load_device
from haptic_device.parameter import SECTION, operating_point_problems
from haptic_sim.cli.nodes import NODES
from haptic_sim.scene import load as load_scene


def check(files: Annotated[list[Path], typer.Argument(help="Operating points, device descriptions or scenes (YAML).")]):
    """Check configuration files: prints ok or one sentence for each thing that is wrong; exit code 1 if any is."""
    wrong = 0
    for path in files:
        sentences = problems(path)
        wrong += len(sentences)
        typer.echo("\n".join(f"{path}: {sentence}" for sentence in sentences or ["ok"]))
    raise typer.Exit(1 if wrong else 0)


def problems(path: Path) -> list[str]:
    """Sentences for what is wrong in the file; which kind of file it is shows in its top-level keys."""
    try:
        document = ros_yaml.load(path)
        if _has_section(document):
            return list(operating_point_problems(document, NODES))
        _loader(document)(path)
    except OSError as error:
        return [error.strerror or str(error)]
    except ValueError as error:
        return [str(error).removeprefix(f"{path}: ")]
    return []


def _has_section(document):
    return any(name == SECTION or isinstance(item, dict) and _has_section(item) for name, item in document.items())


def _loader(document):
    if "axes" in document:
        return load_device
    if "bodies" in document or "tool" in document:
        return load_scene
    raise ValueError(
        f"neither an operating point ({SECTION}), a device description (axes) nor a scene (bodies, tool): "
        f"it has {', '.join(document) or 'no keys'}"
    )
