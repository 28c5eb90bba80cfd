# SPDX-License-Identifier: Apache-2.0
"""Picture of the runs: wall time over error."""

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, NullLocator

from bench.methods.measure import Run
from bench.methods.table import by_scene, default_of, nearest, pareto
from bench.methods.world import label
from haptic_device.theory.palette import BLACK, METHODS, PEERS

LOOKS = METHODS | PEERS
WIDTH, DPI = 7.0, 150  # inches, dots an inch: narrow, so that text is large enough at half of the size
COLUMNS = 3
LEAST, MOST = 1e-9, 1.0  # what errs less or more is drawn there


def pareto_figure(runs: list[Run]) -> Figure:
    """Wall time per simulated second over error, a panel a scene; lines join what is best of each."""
    scenes = by_scene(runs)
    rows, columns, drawn = -(-len(scenes) // COLUMNS), min(COLUMNS, len(scenes)), {}
    figure = Figure(figsize=(WIDTH, 2.1 * rows + 1.2), layout="constrained")
    every = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for axes, (scene, of_scene) in zip(every.flat, scenes.items(), strict=False):
        drawn |= _panel(axes, of_scene)
        axes.set_title(scene, fontsize=10)
        axes.tick_params(labelsize=9)
        axes.grid(alpha=0.3)
    for axes in every.flat:
        axes.label_outer()
    for above, axes in zip(every.flat[len(scenes) - columns :], every.flat[len(scenes) :], strict=False):
        axes.set_axis_off()
        above.set_xlabel(every[-1, 0].get_xlabel())
        above.tick_params(labelbottom=True)
    ring = Line2D([], [], linestyle="", marker="o", color=BLACK, markersize=12, fillstyle="none")
    legend = drawn | {"the scene's own method and step": ring}
    lines = {"handles": list(legend.values()), "labels": list(legend), "fontsize": 9}
    if len(scenes) < rows * columns:  # in the last place where that is free
        every.flat[-1].legend(loc="center", **lines)
    else:
        figure.legend(loc="outside lower center", ncols=3, **lines)
    figure.suptitle("Speed against error in each scene: lower left is better")
    return figure


def _panel(axes, runs):
    drawn, (method, step) = {}, default_of(runs[0].scene)
    shown = nearest(runs, method, step)
    runs = [item._replace(error=_clipped(item.error)) for item in runs]
    for name in dict.fromkeys(item.method for item in runs):
        if front := pareto([item for item in runs if item.method == name]):
            points = [(item.error, 1e3 * item.wall) for item in front]
            (drawn[label(name)],) = axes.plot(
                *zip(*points, strict=True), **LOOKS[name].line, linewidth=1.2, markersize=5, clip_on=False
            )
    if shown and shown.counts:
        at = (_clipped(shown.error), 1e3 * shown.wall)
        axes.plot(*at, LOOKS[method].mark, color=LOOKS[method].colour, markersize=5, clip_on=False)
        axes.plot(*at, "o", color=BLACK, markersize=12, fillstyle="none", clip_on=False)
    axes.set(xscale="log", yscale="log", xlabel="error, relative", ylabel="wall time\n[ms per s]", xlim=(LEAST, MOST))
    axes.xaxis.set_major_locator(FixedLocator([LEAST, 1e-6, 1e-3, MOST]))
    axes.set_xticklabels(["≤10⁻⁹", "10⁻⁶", "10⁻³", "≥1"])
    axes.xaxis.set_minor_locator(NullLocator())
    return drawn


def _clipped(error):
    return min(max(error, LEAST), MOST)
