# SPDX-License-Identifier: Apache-2.0
"""The figures of docs/passivity.md, by default into docs/figures."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from matplotlib.figure import Figure

from adversary.switching import switched_cancellation_damping
from haptic_device.analysis.assessment import Display
from haptic_device.analysis.delay import delayed_demand, wall_damping_needed
from haptic_device.analysis.passivity_figure import draw_map
from haptic_device.analysis.transfer import wall_transfer
from reference.closed_forms import (
    delayed_wall_damping,
    fractionally_delayed_spring_damping,
    wall_damping,
    wall_damping_for_any_simulation,
)

FIGURES = Path(__file__).parents[2] / "docs" / "figures"


def main(folder: Annotated[Path, typer.Argument(show_default="docs/figures")] = FIGURES) -> None:
    """The figures of docs/passivity.md."""
    folder.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(11.0, 8.0), layout="constrained")
    for draw, panel in zip((demand, delay, simulation, switch), figure.subplots(2, 2).flat, strict=True):
        draw(panel)
        panel.grid(alpha=0.3)
        panel.legend(fontsize=8)
    figure.savefig(folder / "passivity_conditions.png", dpi=110)
    figure = Figure(figsize=(11.0, 4.8), layout="constrained")
    for panel, samples in zip(figure.subplots(1, 2), (0.0, 1.0), strict=True):
        draw_map(panel, Display(0.0, 1.0, 0.5, 1e-3, mass=0.1, delay_samples=samples))
        panel.grid(alpha=0.3)
        panel.legend(loc="upper left", fontsize=8)
    figure.savefig(folder / "passivity_map.png", dpi=110)


def demand(axes):
    """Right-hand side of (1) over frequency; its peak is the damping needed."""
    angle = np.linspace(1e-3, np.pi, 600)
    for damping, samples in ((0.0, 0), (0.25, 0), (-0.25, 0), (0.25, 1), (0.25, 5)):
        wall = wall_transfer(1.0, damping, 1.0, delay_samples=samples)
        line = axes.plot(angle, delayed_demand(wall, 1.0, 0.0, angle), label=f"B = {damping:g} KT, {samples} T late")
        peak = wall_damping_needed(1.0, damping, 1.0, delay_samples=samples)
        axes.plot(peak.frequency, peak.damping, "o", color=line[0].get_color())
    axes.set(xlabel="ωT [rad]", ylabel="damping needed b/(KT)", ylim=(-1.5, 6.0))
    axes.set_title("Condition (1): the dot binds")


def delay(axes):
    """Damping over delay: exact, whole samples, and the popular rule."""
    late = np.linspace(0.0, 2.0, 101)
    for damping in (0.0, 0.25, 1.0):
        exact = [wall_damping_needed(1.0, damping, 1.0, delay_samples=value).damping for value in late]
        line = axes.plot(late, exact, label=f"exact, B = {damping:g} KT")
        whole = np.arange(3)
        axes.plot(whole, delayed_wall_damping(1.0, damping, 1.0, whole), "o", color=line[0].get_color())
    axes.plot(late, fractionally_delayed_spring_damping(1.0, 1.0, late), "k:", label="closed form, B = 0")
    axes.plot(late, 0.5 + late, "k--", linewidth=0.8, label="K(T/2 + t_d), not enough")
    axes.set(xlabel="delay t_d/T", ylabel="damping needed b/(KT)", title="A force that acts late")


def simulation(axes):
    """Wall against coupling over B of either sign: the correction for B < 0."""
    damping = np.linspace(-0.49, 1.0, 300)
    axes.plot(damping, wall_damping(1.0, damping, 1.0), label="wall: KT/2 + |B|")
    axes.plot(damping, wall_damping_for_any_simulation(1.0, damping, 1.0), label="coupling to any simulation (μ)")
    axes.axvline(-0.5, color="k", linewidth=0.8, linestyle=":", label="no b is enough left of this (μ)")
    axes.set(xlabel="virtual damping B/(KT)", ylabel="damping needed b/(KT)", ylim=(0.0, 3.0))
    axes.set_title("Wall and coupling agree for B ≥ 0 only")


def switch(axes):
    """What cancelling damping costs the wall."""
    share = np.linspace(0.0, 0.99, 200)
    axes.plot(share, switched_cancellation_damping(1.0, 0.0, 1.0, share), label="cancelled outside the wall only")
    axes.plot(share, 1.0 / (2.0 - share), "--", linewidth=0.8, label="1/(2 − ρ), simpler and enough")
    axes.plot(share, 0.5 / (1.0 - share), label="cancelled inside too")
    axes.set(xlabel="share ρ of b that is cancelled", ylabel="damping needed b/(KT)", ylim=(0.4, 2.2))
    axes.set_title("Damping cancellation up to the wall, B = 0")
