# SPDX-License-Identifier: Apache-2.0
"""How a peg in a hole feels over its insertion, by default into docs/methods/insertion.png.

After Fig. 5 of Colgate, Stanley & Brown (1995); the equations stand in bench/methods/insertion.py.
"""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from matplotlib.figure import Figure

from bench.methods import insertion as peg
from bench.methods.figure import LOOKS

PNG = Path(__file__).parents[2] / "docs" / "methods" / "insertion.png"
CLEARANCE, WIDE = 5e-5, 2e-4  # m
GAIN = 2.0  # N m/rad
DEEP = np.geomspace(peg.INSERTIONS[0], peg.INSERTIONS[-1], 100)


def main(path: Annotated[Path, typer.Argument(show_default="docs/methods/insertion.png")] = PNG) -> None:
    """How a peg in a hole feels over its insertion."""
    figure = Figure(figsize=(14.0, 4.6), layout="constrained")
    panels = figure.subplots(1, 3)
    for draw, axes in zip((stiffness, play, pull), panels, strict=True):
        draw(axes)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=90)
    print(path)


def stiffness(axes):
    """At the handle, contacts of stiffness k in series with the coupling; and rigid ones, which show the coupling."""
    print(f"K_app at the peg and at the handle [N/m], contacts of {peg.STIFFNESS:g} N/m, coupling {peg.COUPLING:g} N/m")
    for gain, style in ((0.0, "-"), (GAIN, "--")):
        theory = [peg.behind_coupling(peg.apparent_stiffness(deep, gain)) for deep in DEEP]
        axes.plot(
            1e3 * DEEP, theory, style, color="black", linewidth=1.0, label=f"theory, rotation gain {gain:g} N m/rad"
        )
        for method in peg.PENALTY:
            found = [peg.felt(method, deep, gain) for deep in peg.INSERTIONS]
            color, mark = LOOKS[method]
            axes.plot(
                1e3 * np.array(peg.INSERTIONS),
                [felt.handle for felt in found],
                mark,
                color=color,
                markersize=6,
                fillstyle="full" if gain == 0.0 else "none",
                label=f"{method}, {gain:g} N m/rad",
            )
            for deep, felt in zip(peg.INSERTIONS, found, strict=True):
                exact = peg.apparent_stiffness(deep, gain)
                print(
                    f"  {method:17} gain {gain:g}  L {1e3 * deep:5.1f} mm  K_app {felt.peg:8.2f}, "
                    f"theory {exact:8.2f} ({100.0 * (felt.peg / exact - 1.0):+.2f} %)  handle {felt.handle:8.2f}, "
                    f"theory {peg.behind_coupling(exact):8.2f}"
                )
    axes.axhline(peg.COUPLING, color="tab:green", linewidth=1.0, linestyle=":", label="coupling alone: rigid contacts")
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="insertion L [mm]",
        ylabel="stiffness at the handle [N/m]",
        title="Elastic contacts: stiffness grows with insertion",
    )


def play(axes):
    """Rigid contacts without rotation gain: free play, then the coupling alone."""
    print(f"free play [mm] and stiffness beyond it [N/m], rigid contacts, clearance {1e3 * CLEARANCE:g} mm")
    axes.plot(
        1e3 * DEEP,
        [1e3 * peg.free_play(deep, CLEARANCE) for deep in DEEP],
        "k-",
        linewidth=1.0,
        label="theory: ±c(½ + h/L)",
    )
    for method in peg.RIGID:
        found = [peg.felt(method, deep, 0.0, CLEARANCE) for deep in peg.INSERTIONS]
        color, mark = LOOKS[method]
        axes.plot(1e3 * np.array(peg.INSERTIONS), [1e3 * felt.play for felt in found], mark, color=color, label=method)
        for deep, felt in zip(peg.INSERTIONS, found, strict=True):
            print(
                f"  {method:12} L {1e3 * deep:5.1f} mm  play {1e3 * felt.play:.4f}, "
                f"theory {1e3 * peg.free_play(deep, CLEARANCE):.4f}  stiffness {felt.handle:.1f}"
            )
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="insertion L [mm]",
        ylabel="free play at the handle [± mm]",
        title="Rigid contacts: the play shrinks with insertion",
    )


def pull(axes):
    """What the hand feels when it pulls sideways, 20 mm deep."""
    deep, places = 0.02, np.linspace(0.0, 2e-3, 26)
    for gain, color in ((0.0, "tab:green"), (GAIN, "tab:purple")):
        exact = [peg.pull_over(place, deep, WIDE, gain) for place in places]
        axes.plot(1e3 * places, exact, "-", color="black", linewidth=1.0)
        axes.plot(
            1e3 * places,
            peg.force_at("partitioned", places, deep, WIDE, gain),
            "o",
            color=color,
            markersize=4,
            label=f"partitioned, rotation gain {gain:g} N m/rad",
        )
    axes.plot([], [], "k-", linewidth=1.0, label="theory")
    axes.set(
        xlabel="handle aside [mm]",
        ylabel="force on the hand [N]",
        title=f"Rigid contacts, L = {1e3 * deep:g} mm, c = {1e3 * WIDE:g} mm",
    )
