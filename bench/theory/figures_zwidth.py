# SPDX-License-Identifier: Apache-2.0
"""The figures of docs/zwidth.md, with files of what `haptic zwidth --live --json` prints."""

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from matplotlib.figure import Figure

from haptic_device.analysis import probe
from haptic_device.analysis.zwidth import Setup
from haptic_device.analysis.zwidth_figure import draw_cells
from haptic_device.analysis.zwidth_map import Request, draw_map
from haptic_device.description import load_device
from haptic_sim.supervision.zwidth import CANCELLED
from haptic_sim.supervision.zwidth_lockstep import HAND, LockstepDisplay

FIGURES = Path(__file__).parents[2] / "docs" / "figures"
RATES = (1000.0, 4000.0, 10000.0)
DEVICES = (("desktop", "with damper", "tab:green"), ("undamped", "without", "tab:red"))
LATE = 4e-6  # [s] of the servo's writes, as `zwidth --live` says


def main(
    folder: Annotated[Path, typer.Argument(show_default="docs/figures")] = FIGURES,
    live: Annotated[list[Path] | None, typer.Argument(help="What `haptic zwidth --live --json` printed.")] = None,
) -> None:
    """The figures of docs/zwidth.md."""
    folder.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(11.0, 5.2), layout="constrained")
    for axes, operator in zip(figure.subplots(1, 2), ("none", "worst"), strict=True):
        setup = Setup(0.1, 0.5, 1e-3)
        request = Request(setup, operator, np.linspace(20.0, 5000.0, 100), np.linspace(-0.5, 1.5, 100))
        draw_cells(axes, request, draw_map(request, 2), 1e-4)
    figure.savefig(folder / "zwidth_map.png", dpi=110)
    figure = Figure(figsize=(11.0, 4.8), layout="constrained")
    both_ends(figure.subplots(1, 2), [json.loads(path.read_text()) for path in live or ()])
    figure.savefig(folder / "zwidth.png", dpi=110)


def both_ends(panels, live):
    """Lines are lock-step, crosses the live nodes."""
    stiff, free = panels
    for name, said, colour in DEVICES:
        device = load_device(name)
        b = device.axes[0].damping
        here = [one for one in live if one["physical_damping"] == b]
        label = f"{said}, b = {b:g} N s/m"
        draw_stiff(stiff, device, label, colour)
        draw_free(free, device, label, colour)
        for one in here:
            known = [one["live"][end] for end in ("quiet", "shaking") if one["live"][end]]
            stiff.loglog(one["rate"], np.mean(known), "x", color=colour, markersize=10)
            free.loglog([one["rate"]] * 2, list(one["live"]["damping"].values()), "x", color=colour, markersize=10)
    hand = ", ".join(f"{value:g} {unit}" for value, unit in zip(HAND.values(), ("kg", "N s/m", "N/m"), strict=True))
    stiff.set(xlabel="servo rate [Hz]", ylabel="stiffness of the wall [N/m]", title=f"Stiff end, hand {hand}, B = 0")
    free.set(xlabel="servo rate [Hz]", ylabel="damping felt in free space [N s/m]", title="Free end")
    for panel in panels:
        panel.plot([], [], "kx", label="live nodes")
        panel.grid(alpha=0.3, which="both")
        panel.set_ylim(top=panel.get_ylim()[1] * (4.0 if panel is stiff else 1.0))
        panel.legend(fontsize=8, loc="upper left" if panel is stiff else (0.2, 0.54))


def draw_stiff(axes, device, label, colour):
    passive = 2.0 * device.axes[0].damping * np.array(RATES)
    found = [
        probe.find_boundary(LockstepDisplay(device, rate, 0.0, LATE).show, 0.95 * limit, 20.0 * limit).stiffness
        for rate, limit in zip(RATES, passive, strict=True)
    ]
    axes.loglog(RATES, found, "o-", color=colour, label=f"{label}: shakes above")
    axes.loglog(RATES, passive, "--", color=colour, label="passive below, 2b/T")


def draw_free(axes, device, label, colour):
    for ratio, style in ((0.0, "-"), (CANCELLED, ":")):
        felt = [LockstepDisplay(device, rate, 0.0, LATE).turn(ratio) for rate in RATES]
        axes.loglog(RATES, felt, "o" + style, color=colour, label=f"{label}, {100 * ratio:g} % cancelled")
