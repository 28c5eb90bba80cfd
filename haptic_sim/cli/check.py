# SPDX-License-Identifier: Apache-2.0
"""`haptic check FILE...`: says whether configuration files are right, before anything moves."""

from pathlib import Path
from typing import Annotated

import typer

from haptic_sim.config_problems import problems, remark


def check(files: Annotated[list[Path], typer.Argument(help="Operating points, device descriptions or scenes (YAML).")]):
    """Check configuration files: prints ok or one sentence for each thing that is wrong; exit code 1 if any is.

    Of a scene that is right it says where the error of its method is greater than the scene allows.
    """
    wrong = 0
    for path in files:
        sentences = problems(path)
        wrong += len(sentences)
        if not sentences:
            said = remark(path)
            sentences = [f"ok; but {said}" if said else "ok"]
        typer.echo("\n".join(f"{path}: {sentence}" for sentence in sentences))
    raise typer.Exit(1 if wrong else 0)
