# SPDX-License-Identifier: Apache-2.0
"""Pictures of the runs: wall time over error, error over step."""

from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from bench.methods.measure import Run
from bench.methods.table import TITLES, default_of, fronts, nearest, scenes_of

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


def pareto_figure(runs: list[Run], columns: int = 3) -> Figure:
    """Wall time per simulated second over error, a panel a scene; lines join what is best of each."""
    scenes = scenes_of(runs)
    rows = -(-len(scenes) // columns)
    columns = min(columns, len(scenes))
    figure = Figure(figsize=(4.6 * columns, 3.6 * rows + 0.5), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).flat
    drawn = {}
    for scene, axes in zip(scenes, panels, strict=False):
        drawn |= _panel(axes, [item for item in runs if item.scene == scene], scene)
    for axes in list(panels):
        axes.set_visible(False)
    ordered = {name: drawn[name] for name in LOOKS if name in drawn}
    figure.legend(
        list(ordered.values()),
        [TITLES.get(name, name) for name in ordered],
        loc="outside upper center",
        ncols=min(len(ordered), 3 * columns),
        fontsize=8,
    )
    return figure


def _panel(axes, runs, scene):
    drawn, (method, step) = {}, default_of(scene)
    for name, front in fronts(runs).items():
        if front:
            color, marker = LOOKS[name]
            points = [(max(item.error, LEAST), 1e3 * item.wall) for item in front]
            (drawn[name],) = axes.plot(
                *zip(*points, strict=True), marker=marker, color=color, linewidth=1.0, markersize=5
            )
    shown = nearest(runs, method, step)
    if shown and shown.counts:
        axes.plot(max(shown.error, LEAST), 1e3 * shown.wall, "o", color="black", markersize=11, fillstyle="none")
    axes.set(xscale="log", yscale="log", xlabel="error, relative", ylabel="wall time [ms per s]")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_title(f"{scene} ({runs[0].kind})", fontsize=9)
    axes.grid(alpha=0.3)
    return drawn
