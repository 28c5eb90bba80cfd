# SPDX-License-Identifier: Apache-2.0
"""Figure of `python -m bench local`: the whole display's stiffness against its drag, and Fig. 5 of the paper.

Fig. 5: Colgate, Stanley & Brown (1995), equations in bench/methods/insertion.py, with the contacts in the servo made
soft enough to be seen.
"""

import numpy as np
from matplotlib.figure import Figure

from bench.exchange.felt import HAND, SOFT, Felt
from bench.methods import insertion as peg
from haptic_device.control.tool_contacts import LEAVING

LINES = {  # of the methods: colours that all eyes can tell apart (Okabe and Ito), and how the line is drawn
    "direct": ("#D55E00", ":"),
    "wave": ("#CC79A7", "-."),
    "pspm": ("#0072B2", "--"),
    "local": ("#009E73", "-"),
}
MARKERS = ("o", "s", "^", "v", "D", "P")  # of the servo rates
GAINS = ("tab:green", "tab:purple")  # of the rotation gains
LEAST = 1e-4  # [N s/m] drag below which the axis ends


def save(found: dict, path, live: bool) -> None:
    """Write the panels of what was measured, {part: {job: numbers}}, as PNG; OSError if the file cannot be written."""
    panels = [(draw, found[part]) for part, draw in (("felt", _display), ("insertion", _insertion)) if found[part]]
    if not panels:
        raise ValueError("--plot draws felt and insertion; measure at least one of them")
    figure = Figure(figsize=(6.5 * len(panels), 4.6), layout="constrained")
    for axes, (draw, done) in zip(figure.subplots(1, len(panels), squeeze=False).flat, panels, strict=True):
        draw(axes, done)
        axes.grid(True, which="both", alpha=0.2)
        axes.legend(fontsize=8)
    figure.suptitle("on live nodes" if live else "in lock-step", fontsize=10)
    figure.savefig(path, dpi=100, format="png")


def _display(axes, found):
    known = {job: Felt(*numbers) for job, numbers in found.items() if len(numbers) > 1}
    known = {job: one for job, one in known.items() if one.steady}
    markers = dict(zip(sorted({rate for rate, _ in found}), MARKERS, strict=False))
    for method, (colour, style) in LINES.items():
        points = {rate: one for (rate, name), one in known.items() if name == method}
        drags = [max(LEAST, abs(one.drag)) for one in points.values()]
        axes.plot(drags, [one.stiffness for one in points.values()], style, color=colour, alpha=0.4)
        for (rate, one), drag in zip(points.items(), drags, strict=True):
            axes.plot(drag, one.stiffness, markers[rate], color=colour, label=f"{method}, {rate * 1e-3:g} kHz")
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="drag in free space, net of the device's b [N s/m]",
        ylabel="stiffness felt in contact [N/m]",
    )
    axes.set_title("b = 3 N s/m, B = 0.5 N s/m, K = 0.95 · 2(b − B)/T; passive unless direct", fontsize=10)


def _insertion(axes, found):
    depths = sorted({deep for deep, _ in found})
    stiffness, fine = LEAVING / SOFT, np.geomspace(depths[0], depths[-1], 100)
    for colour, gain in zip(GAINS, sorted({gain for _, gain in found}), strict=False):
        behind = peg.behind_coupling(gain, HAND)
        theory = [peg.behind_coupling(peg.apparent_stiffness(one, behind, stiffness)) for one in fine]
        axes.plot(
            1e3 * fine,
            theory,
            "k-" if gain == 0.0 else "k--",
            linewidth=1.0,
            label=f"theory, rotation gain {behind:g} N m/rad",
        )
        felt = {deep: numbers[0] for (deep, other), numbers in found.items() if other == gain and len(numbers) > 1}
        axes.plot(
            1e3 * np.array(list(felt)),
            list(felt.values()),
            "o",
            color=colour,
            label=f"local, 4 kHz, {behind:g} N m/rad",
        )
    axes.axhline(peg.COUPLING, color="gray", linewidth=1.0, linestyle=":", label="coupling")
    axes.set(xscale="log", yscale="log", xlabel="insertion L [mm]", ylabel="stiffness at the handle [N/m]")
    axes.set_title(f"Fig. 5: contacts of {stiffness:g} N/m in the servo, behind the coupling", fontsize=10)
