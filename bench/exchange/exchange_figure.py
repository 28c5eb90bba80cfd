# SPDX-License-Identifier: Apache-2.0
"""Figure of `python -m bench exchange`: transparency and energy against the delay, one line a method.

A cross is a case that gave more energy than the budget: what it felt like means little.
"""

from matplotlib.figure import Figure

from bench.exchange.exchange import BUDGET

PANELS = (  # and up to where the axis is straight, logarithmic beyond
    ("stiffness felt at a rigid wall [N/m]", lambda one: one.stiffness, None),
    ("tool error in free motion [mm]", lambda one: one.tool_error * 1e3, 0.01),
    ("apparent damping in free motion [N s/m]", lambda one: one.damping, 0.2),
    ("apparent mass in free motion [kg]", lambda one: one.mass, 0.2),
    ("energy given to the operator, largest [mJ]", lambda one: one.given * 1e3, 1.0),
    ("energy supplied to the tool, largest [mJ]", lambda one: one.supplied * 1e3, 1.0),
)
COLOURS = {"direct": "tab:red", "wave": "tab:blue", "pspm": "tab:green", "local": "tab:purple"}


def save(found: dict, path) -> None:
    """Write the figure of {Case: Figures} as PNG; OSError if the file cannot be written."""
    figure = Figure(figsize=(9.0, 9.5), layout="constrained")
    for axes, (label, value, straight) in zip(figure.subplots(3, 2).flat, PANELS, strict=True):
        _draw(axes, found, value)
        axes.set(ylabel=label, xlabel="round trip delay [ms]")
        if straight is not None:
            axes.set_yscale("symlog", linthresh=straight)
        axes.set_xscale("symlog", linthresh=1.0)
        axes.set_xlim(left=0.0)
        axes.grid(alpha=0.3)
    figure.axes[0].set_ylim(bottom=0.0)  # what an active wall fits to may be negative
    figure.axes[0].legend()
    line = figure.axes[4].axhline(BUDGET * 1e3, color="black", linestyle=":")
    figure.axes[4].legend([line], ["exchange.budget, the default"], loc="upper left")
    first = next(iter(found))
    figure.suptitle(
        f"Exchange methods in lock-step; jitter ± {first.jitter * 1e3:g} ms at the first delay, "
        f"loss {first.loss:g}, {first.rate:g} samples/s",
        fontsize=10,
    )
    figure.savefig(path, dpi=110, format="png")


def _draw(axes, found, value):
    lines = sorted({case._replace(delay=0.0, jitter=0.0) for case in found})
    for line in lines:
        points = [
            (case.delay * 1e3, value(one), one.passive)
            for case, one in found.items()
            if case._replace(delay=0.0, jitter=0.0) == line
        ]
        name = line.method if len({(one.loss, one.rate) for one in lines}) == 1 else f"{line.method} {line.loss:g}"
        look = {"color": COLOURS[line.method], "alpha": 1.0 - line.loss}
        axes.plot(*zip(*(point[:2] for point in points), strict=True), "-", label=name, **look)
        for late, figure, passive in points:
            axes.plot(late, figure, "o" if passive else "x", **look)
