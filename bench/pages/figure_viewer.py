# SPDX-License-Identifier: Apache-2.0
"""The page as the last `make test-browser` photographed it, into docs/figures: python bench/figure_viewer.py.

Flat colours need few of them: a palette makes a picture a third as large.
"""

import sys
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[1]
SHOTS = ("peg", "wrench", "fault", "beside", "refused", "dark_1280", "phone")
COLOURS = 256


def main():
    taken = ROOT / "build" / "browser"
    if lacking := [name for name in SHOTS if not (taken / f"{name}.png").is_file()]:
        print(f"{taken} lacks {', '.join(lacking)}: run make test-browser first", file=sys.stderr)
        return 1
    for name in SHOTS:
        path = ROOT / "docs" / "figures" / f"viewer_{name}.png"
        shot = Image.open(taken / f"{name}.png").convert("RGB")
        shot.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=3, dither=Image.Dither.NONE).save(path, optimize=True)
        print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1024:.0f} KiB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
