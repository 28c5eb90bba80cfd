# SPDX-License-Identifier: Apache-2.0
"""The page as the last `make test-browser` photographed it, into docs/figures.

Flat colours need few of them: a palette makes a picture a third as large.
"""

from pathlib import Path

import typer
from PIL import Image

ROOT = Path(__file__).parents[2]
SHOTS = ("peg", "wrench", "fault", "beside", "refused", "dark_1280", "phone")
COLOURS = 256


def main() -> None:
    """The viewer's page as the last `make test-browser` photographed it, into docs/figures."""
    taken = ROOT / "build" / "browser"
    if lacking := [name for name in SHOTS if not (taken / f"{name}.png").is_file()]:
        typer.echo(f"{taken} lacks {', '.join(lacking)}: run make test-browser first", err=True)
        raise typer.Exit(1)
    for name in SHOTS:
        path = ROOT / "docs" / "figures" / f"viewer_{name}.png"
        shot = Image.open(taken / f"{name}.png").convert("RGB")
        shot.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=3, dither=Image.Dither.NONE).save(path, optimize=True)
        print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1024:.0f} KiB")
