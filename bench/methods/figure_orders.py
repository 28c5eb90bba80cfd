# SPDX-License-Identifier: Apache-2.0
"""How fast errors fall with the step, by default into docs/methods/orders.png."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from bench.methods.figure import LOOKS
from bench.methods.orders import PROBLEMS, errors, order, steps_of

PNG = Path(__file__).parents[2] / "docs" / "methods" / "orders.png"


def main(path: Annotated[Path, typer.Argument(show_default="docs/methods/orders.png")] = PNG) -> None:
    """How fast errors fall with the step."""
    figure = Figure(figsize=(18.0, 7.6), layout="constrained")
    panels = figure.subplots(2, -(-len(PROBLEMS) // 2)).flat
    for (name, problem), axes in zip(PROBLEMS.items(), panels, strict=False):
        for method, expected in problem.orders.items():
            steps, found = np.array(steps_of(name, method)), errors(name, method)
            slope, (color, mark) = order(steps, found), LOOKS[method]
            print(
                f"{name:16} {method:17} order {slope:5.2f}, expected {expected:g}; errors "
                + ", ".join(f"{error:.2e}" for error in found)
                + " m"
            )
            axes.plot(
                1e3 * steps,
                found,
                mark,
                color=color,
                fillstyle="none",
                markersize=8,
                label=f"{method}: order {slope:.2f}",
            )
            axes.plot(1e3 * steps, found[-1] * (steps / steps[-1]) ** expected, "-", color=color, linewidth=0.8)
        axes.set(xscale="log", yscale="log", xlabel="step [ms]", ylabel="error [m]", title=problem.what)
        steps = np.array(problem.steps)
        axes.set_xticks(1e3 * steps, [f"{1e3 * step:.3g}" for step in steps])
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    for axes in panels:
        axes.set_visible(False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=90)
    print(path)
