# SPDX-License-Identifier: Apache-2.0
"""Pictures of the runs: wall time over error, error over step."""

from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from bench.methods.measure import Run
from bench.methods.table import default_of, fronts, nearest, scenes_of
from bench.methods.world import title

LOOKS = {
    "impulse": ("tab:blue", "o"),
    "penalty_explicit": ("tab:red", "v"),
    "penalty_implicit": ("tab:orange", "^"),
    "partitioned": ("tab:green", "s"),
    "event_driven": ("tab:cyan", "p"),
    "closed_form": ("tab:olive", "D"),
    "pymunk": ("0.6", "1"),
    "box2d": ("0.3", "2"),
    "mujoco_rk4": ("tab:purple", "+"),
    "mujoco_implicit": ("tab:pink", "x"),
}
LEAST = 1e-14


def panels(of: dict[str, list], draw, columns: int = 3) -> Figure:
    """A panel for each title, drawn of its runs; what `draw` returns, {label: line}, is the legend of all."""
    rows, columns = -(-len(of) // columns), min(columns, len(of))
    figure, drawn = Figure(figsize=(4.6 * columns, 3.6 * rows + 0.5), layout="constrained"), {}
    for axes, (name, runs) in zip(figure.subplots(rows, columns, squeeze=False).flat, of.items(), strict=False):
        drawn |= draw(axes, runs)
        axes.set_title(name, fontsize=9)
        axes.grid(alpha=0.3)
    for axes in figure.axes[len(of) :]:
        axes.set_visible(False)
    figure.legend(list(drawn.values()), list(drawn), loc="outside upper center", ncols=3 * columns, fontsize=8)
    return figure


def pareto_figure(runs: list[Run]) -> Figure:
    """Wall time per simulated second over error, a panel a scene; lines join what is best of each."""
    return panels({scene: [item for item in runs if item.scene == scene] for scene in scenes_of(runs)}, _panel)


def _panel(axes, runs):
    drawn, (method, step) = {}, default_of(runs[0].scene)
    for name, front in fronts(runs).items():
        if front:
            color, marker = LOOKS[name]
            points = [(max(item.error, LEAST), 1e3 * item.wall) for item in front]
            (drawn[title(name)],) = axes.plot(
                *zip(*points, strict=True), marker=marker, color=color, linewidth=1.0, markersize=5
            )
    shown = nearest(runs, method, step)
    if shown and shown.counts:
        axes.plot(max(shown.error, LEAST), 1e3 * shown.wall, "o", color="black", markersize=11, fillstyle="none")
    axes.set(xscale="log", yscale="log", xlabel="error, relative", ylabel="wall time [ms per s]")
    axes.xaxis.set_minor_formatter(NullFormatter())
    return drawn
