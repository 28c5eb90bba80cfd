# SPDX-License-Identifier: Apache-2.0
"""The pictures of docs/passivity.md and docs/zwidth.md; and the page, as the last `make test-browser` took it."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from matplotlib.figure import Figure
from PIL import Image

from adversary.horizon import energy_generated_over_horizon
from adversary.switching import switched_cancellation_damping
from bench.theory import mu_threshold
from haptic_device.analysis import zwidth_figure, zwidth_map
from haptic_device.analysis.assessment import Display
from haptic_device.analysis.delay import delayed_demand, wall_damping_needed
from haptic_device.analysis.passivity_figure import draw_map
from haptic_device.analysis.transfer import wall_transfer
from haptic_device.analysis.zwidth import Setup
from haptic_device.control.passivity import coupling_damping, least_damping
from reference.closed_forms import (
    delayed_wall_damping,
    fractionally_delayed_spring_damping,
    wall_damping,
    wall_damping_for_any_simulation,
)

ROOT = Path(__file__).parents[1]
PHOTOGRAPHS = ROOT / "build" / "browser"
SHOTS = ("peg", "wrench", "fault", "refused", "dark_1280", "phone")


def main(folder: Annotated[Path, typer.Argument(show_default="docs/figures")] = ROOT / "docs" / "figures") -> None:
    """Pictures of the theory, and those of the page if there are photographs of it."""
    folder.mkdir(parents=True, exist_ok=True)
    pictures = {
        "passivity_conditions": ((11.0, 8.0), (demand, delay, late_coupling, switch)),
        "passivity_negative": ((11.0, 4.8), (negative, drawn)),
        "passivity_map": ((11.0, 4.8), (passive_on_time, passive_late)),
        "zwidth_map": ((11.0, 5.2), (quiet_alone, quiet_with_the_worst)),
    }
    for name, (size, drawings) in pictures.items():
        figure = Figure(figsize=size, layout="constrained")
        for axes, draw in zip(figure.subplots(len(drawings) // 2, 2).flat, drawings, strict=True):
            draw(axes)
            if axes.get_legend() is None:  # the plane of cells has its own
                axes.grid(alpha=0.3)
                axes.legend(fontsize=8)
        figure.savefig(folder / f"{name}.png", dpi=110)
    for name in SHOTS if PHOTOGRAPHS.is_dir() else ():  # flat colours: a palette makes a picture a third as large
        shot = Image.open(PHOTOGRAPHS / f"{name}.png").convert("RGB")
        shot.quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=3, dither=Image.Dither.NONE).save(
            folder / f"viewer_{name}.png", optimize=True
        )


def passive_on_time(axes):
    """The K–B plane: where a display is passive, and where it is stable."""
    draw_map(axes, Display(0.0, 1.0, 0.5, 1e-3, mass=0.1))


def passive_late(axes):
    """The same one sample late."""
    draw_map(axes, Display(0.0, 1.0, 0.5, 1e-3, mass=0.1, delay_samples=1.0))


def quiet_alone(axes, operator="none"):
    """Which walls of the K–B plane shake, without operator."""
    setup = Setup(0.1, 0.5, 1e-3)
    request = zwidth_map.Request(setup, operator, np.linspace(20.0, 5000.0, 100), np.linspace(-0.5, 1.5, 100))
    zwidth_figure.draw_cells(axes, request, zwidth_map.draw_map(request, 2), 1e-4)


def quiet_with_the_worst(axes):
    """The same with the worst of the operators."""
    quiet_alone(axes, "worst")


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


def late_coupling(axes):
    """What wall and coupling are asked for over delay."""
    late = np.linspace(0.0, 2.0, 201)
    for damping, colour in ((0.0, "tab:blue"), (0.25, "tab:orange")):
        for needed, what, line in ((coupling_damping, "coupling", "-"), (least_damping, "wall", "--")):
            asked = [needed(1.0, damping, 1.0, float(value)) for value in late]
            axes.plot(late, asked, line, color=colour, label=f"{what}, B = {damping:g} KT")
    axes.set(xlabel="delay t_d/T", ylabel="damping needed b/(KT)", title="Wall and coupling part where forces act late")


def negative(axes):
    """What a wall and a coupling with damping of either sign need: the correction for B < 0."""
    damping = np.linspace(-0.49, 0.4, 300)
    wall, coupling = wall_damping(1.0, damping, 1.0), wall_damping_for_any_simulation(1.0, damping, 1.0)
    axes.fill_between(damping, wall, coupling, color="tab:red", alpha=0.15, label="enough for a wall only")
    axes.plot(damping, wall, "--", label="wall, and in the paper the coupling too: KT/2 + |B|")
    axes.plot(damping, coupling, color="tab:red", label="coupling: (KT/2)²/(KT/2 + B) for B < 0")
    points = np.array([-0.4, -0.3, -0.2, -0.1, 0.0, 0.2])
    axes.plot(points, [mu_threshold(value) for value in points], "ko", markersize=4, label="threshold of the μ test")
    for needed, below in ((wall_damping, 14), (wall_damping_for_any_simulation, -4)):
        need = needed(1.0, -0.3, 1.0)
        axes.annotate(f"{need:.3g}", (-0.3, need), xytext=(6, -below), textcoords="offset points")
    axes.axvline(-0.5, color="k", linewidth=0.8, linestyle=":", label="no b is enough from here on")
    axes.set(xlabel="virtual damping B/(KT)", ylabel="damping needed b/(KT)", ylim=(0.0, 3.0), xlim=(-0.55, 0.4))
    axes.set_title("Negative damping on a coupling")


def drawn(axes):
    """Energy that the worst path of 60 ticks draws over b, at B = −.3 KT."""
    b, ticks = np.linspace(0.6, 1.4, 161), np.arange(60.0)
    energy = [energy_generated_over_horizon(1.0, -0.3, value, 1.0, ticks) for value in b]
    axes.semilogy(b, np.where(np.array(energy) > 0.0, energy, np.nan), label="with a passive simulation in step")
    axes.axvline(0.8, color="tab:blue", linestyle="--", label="the paper's form, KT/2 + |B|")
    axes.axvline(1.25, color="tab:red", label="(KT/2)²/(KT/2 + B)")
    axes.set(xlabel="physical damping b/(KT)", ylabel="energy given per square of the path, in K", xlim=(b[0], b[-1]))
    axes.set_title("B = −.3 KT: what the worst 60 ticks draw")


def switch(axes):
    """What cancelling damping costs the wall."""
    share = np.linspace(0.0, 0.99, 200)
    axes.plot(share, switched_cancellation_damping(1.0, 0.0, 1.0, share), label="cancelled outside the wall only")
    axes.plot(share, 1.0 / (2.0 - share), "--", linewidth=0.8, label="1/(2 − ρ), simpler and enough")
    axes.plot(share, 0.5 / (1.0 - share), label="cancelled inside too")
    axes.set(xlabel="share ρ of b that is cancelled", ylabel="damping needed b/(KT)", ylim=(0.4, 2.2))
    axes.set_title("Damping cancellation up to the wall, B = 0")
