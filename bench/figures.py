# SPDX-License-Identifier: Apache-2.0
"""The pictures of the theory pages and of zwidth.md; and the page, as the last `make test-browser` took it."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from matplotlib import rc_context
from matplotlib.figure import Figure
from PIL import Image

from adversary.horizon import energy_generated_over_horizon
from adversary.switching import switched_cancellation_damping
from bench.jobs import read_csv
from bench.methods import measure
from bench.methods.figure import DPI, pareto_figure
from bench.reference.closed_forms import (
    delayed_wall_damping,
    fractionally_delayed_spring_damping,
    wall_damping,
    wall_damping_for_any_simulation,
)
from bench.theory import mu_threshold
from haptic_device.control.passivity import least_damping
from haptic_device.theory import passivity_figure, zwidth_figure, zwidth_map
from haptic_device.theory.assessment import Display
from haptic_device.theory.delay import delayed_demand, wall_damping_needed
from haptic_device.theory.palette import BLACK, BLUE, DASHED, DOTTED, GREEN, MIXED, ORANGE, PURPLE, SOLID, VERMILION
from haptic_device.theory.passivity_figure import draw_map
from haptic_device.theory.transfer import wall_transfer
from haptic_device.theory.zwidth import Setup

ROOT = Path(__file__).parents[1]
STORED = ROOT / "docs" / "benchmarks"
PHOTOGRAPHS = ROOT / "build" / "browser"
ON_TIME = Display(0.0, 1.0, 0.5, 1e-3, mass=0.1)
LATE = Display(0.0, 1.0, 0.5, 1e-3, mass=0.1, delay_samples=1.0)
LATENESS = 1e-4  # s
LONG = (0, (9, 3))
READABLE = {"font.size": 12.0, "axes.titlesize": 13.0}  # also where the page shows a picture at half its size
SHOTS = ("peg", "fault_position", "wall_at_hand")


def main(folder: Annotated[Path, typer.Argument(show_default="docs")] = ROOT / "docs") -> None:
    """Into figures: theory, and the page if there are photographs of it; into benchmarks: the stored runs."""
    for name in ("figures", "benchmarks"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    pictures = {
        "passivity_sampled": with_legends(5.2, staircase, given),
        "passivity_conditions": with_legends(10.0, demand, delay, late_rows, switch),
        "passivity_negative": with_legends(5.6, negative, drawn),
        "passivity_map": passive_and_stable(),
        "zwidth_map": quiet_walls(),
        "late_spring": late_spring(),
    }
    for name, figure in pictures.items():
        figure.savefig(folder / "figures" / f"{name}.png", dpi=110)
    pareto = pareto_figure(read_csv(STORED / "speed_error.csv", measure.Run))
    pareto.savefig(folder / "benchmarks" / "pareto.png", dpi=DPI)
    for name in SHOTS if PHOTOGRAPHS.is_dir() else ():  # flat colours: a palette makes a picture a third as large
        shot = Image.open(PHOTOGRAPHS / f"{name}.png").convert("RGB")
        shot.quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=3, dither=Image.Dither.NONE).save(
            folder / "figures" / f"viewer_{name}.png", optimize=True
        )


@rc_context(READABLE)
def passive_and_stable() -> Figure:
    """The K–B plane on time and one sample late, to one scale."""
    figure, displays = Figure(figsize=(9.0, 4.9), layout="constrained"), (ON_TIME, LATE)
    titles = ("Force on time", "Force one sample late")
    for axes, display, title in zip(figure.subplots(1, 2, sharey=True), displays, titles, strict=True):
        draw_map(axes, display)
        axes.set_title(title)
        axes.label_outer()
    figure.suptitle(passivity_figure.TITLE)
    passivity_figure.dress(figure, "m = 0.1 kg, b = 0.5 N s/m, T = 1 ms; no encoder step, no friction, contact kept")
    return figure


def quiet_walls() -> Figure:
    """Which walls of the K–B plane shake: without operator, and with the worst of the operators."""
    figure = Figure(figsize=(7.2, 5.0), layout="constrained")
    for axes, operator in zip(figure.subplots(1, 2, sharey=True), ("none", "worst"), strict=True):
        setup = Setup(0.1, 0.5, 1e-3)
        request = zwidth_map.Request(setup, operator, np.linspace(20.0, 5000.0, 100), np.linspace(-0.5, 1.5, 100))
        zwidth_figure.draw_cells(axes, request, zwidth_map.draw_map(request, 2), LATENESS)
        axes.set_title({"none": "Without operator", "worst": "With the worst operator"}[operator])
        axes.label_outer()
    figure.get_layout_engine().set(wspace=0.06)
    figure.suptitle("Which walls shake")
    passivity_figure.dress(figure, zwidth_figure.caption(request, LATENESS))
    return figure


def late_spring() -> Figure:
    """What a spring gives whose force is late: force over position, and the energy over time."""
    stiffness, amplitude, turning = 2000.0, 5e-3, 4.0 * np.pi  # N/m, m, rad/s
    figure, time = Figure(figsize=(7.2, 3.9), layout="constrained"), np.linspace(0.0, 2.0, 2001)
    loop, given = figure.subplots(1, 2)
    once = time <= 0.5
    place, speed = amplitude * np.sin(turning * time), amplitude * turning * np.cos(turning * time)
    for late, colour, dashes in ((0.0, BLUE, SOLID), (0.005, ORANGE, DASHED), (0.02, VERMILION, MIXED)):
        force = -stiffness * amplitude * np.sin(turning * (time - late))
        energy = np.concatenate([[0.0], np.cumsum((force * speed)[1:] * np.diff(time))])
        look = {"color": colour, "linestyle": dashes, "linewidth": 2.0, "label": f"{1e3 * late:g} ms late"}
        loop.plot(1e3 * place[once], force[once], **look)
        given.plot(time, 1e3 * energy, **look)
    loop.set(xlabel="handle position [mm]", ylabel="force on the hand [N]", title="One period, 2 Hz")
    given.set(xlabel="time [s]", ylabel="energy given to the hand [mJ]", title="Energy adds up")
    for axes in (loop, given):
        axes.grid(alpha=0.3)
    figure.suptitle("A spring of 2000 N/m whose force acts late")
    figure.legend(*loop.get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    return figure


@rc_context(READABLE)
def with_legends(height: float, *drawings) -> Figure:
    """Panels two by two, the legend of each below it."""
    figure = Figure(figsize=(9.0, height), layout="constrained")
    for axes, draw in zip(figure.subplots(len(drawings) // 2, 2).flat, drawings, strict=True):
        draw(axes)
        axes.grid(alpha=0.3)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), handlelength=2.6, fontsize=11, frameon=False)
    return figure


def pressed(step):
    """Depths [m] at the samples of a hand that goes 1 mm into a wall and out again."""
    way = np.arange(0.0, 1e-3 + step / 2.0, step)
    return np.concatenate([way, way[-2::-1]])


def staircase(axes):
    """Force of a wall of 1000 N/m at 1 kHz over the depth, the hand moving at 0.1 m/s."""
    depth = 1e3 * pressed(1e-4)  # mm; at 1 N/mm it is the force in N too
    into, out = depth[: len(depth) // 2 + 1], depth[len(depth) // 2 :]
    last = np.append(into[1:], into[-1])
    axes.fill_between(into, into, last, step="post", color=ORANGE, alpha=0.3, label="energy that the hand gains")
    axes.step(into, into, where="post", color=BLUE, label="held force, on the way in")
    axes.step(out, out, where="post", color=VERMILION, linestyle=DASHED, label="held force, on the way out")
    axes.plot(into, into, color=BLACK, linestyle=DOTTED, label="force of a real spring")
    axes.set(xlabel="depth in the wall [mm]", ylabel="force on the hand [N]", title="A sampled wall, in and out")


def given(axes):
    """Energy that the hand has gained when it is out of that wall."""
    depth, damping = pressed(1e-4), np.linspace(0.0, 1.0, 41)
    held = -1000.0 * depth[:-1]
    way = np.diff(depth)
    energy = [np.sum(held * way - b * way**2 / 1e-3) for b in damping]
    axes.plot(damping, 1e3 * np.array(energy), color=BLUE, label="in and out at 0.1 m/s")
    axes.axhline(0.0, color=BLACK, linewidth=0.8)
    axes.axvline(0.5, color=VERMILION, linestyle=DASHED, label="KT/2 = 0.5 N s/m")
    axes.set(xlabel="physical damping b [N s/m]", ylabel="energy given to the hand [mJ]", xlim=(0.0, 1.0))
    axes.set_title("Physical damping takes it back")


def demand(axes):
    """Right-hand side of (1) over frequency; its peak is the damping needed."""
    angle = np.linspace(1e-3, np.pi, 600)
    looks = ((BLUE, SOLID), (ORANGE, DASHED), (GREEN, MIXED), (VERMILION, LONG), (BLACK, DOTTED))
    cases = ((0.0, 0), (0.25, 0), (-0.25, 0), (0.25, 1), (0.25, 5))
    for (damping, samples), (colour, dashes) in zip(cases, looks, strict=True):
        wall = wall_transfer(1.0, damping, 1.0, delay_samples=samples)
        late = f"{samples} T late" if samples else "on time"
        demanded = delayed_demand(wall, 1.0, 0.0, angle)
        axes.plot(angle, demanded, linestyle=dashes, color=colour, label=f"B = {_true(damping)} KT, {late}")
        peak = wall_damping_needed(1.0, damping, 1.0, delay_samples=samples)
        axes.plot(peak.frequency, peak.damping, "o", color=colour)
    axes.set(xlabel="frequency ωT [rad]", ylabel="damping needed b/(KT)", ylim=(-1.5, 6.0))
    axes.set_title("Condition (1); dot: its maximum")


def delay(axes):
    """Damping over delay: exact, whole samples, and the popular rule."""
    late = np.linspace(0.0, 2.0, 101)
    for damping, colour, dashes in ((0.0, BLUE, SOLID), (0.25, ORANGE, DASHED), (1.0, GREEN, MIXED)):
        exact = [wall_damping_needed(1.0, damping, 1.0, delay_samples=value).damping for value in late]
        axes.plot(late, exact, color=colour, linestyle=dashes, linewidth=2.0, label=f"exact, B = {damping:g} KT")
        whole = np.arange(3)
        axes.plot(whole, delayed_wall_damping(1.0, damping, 1.0, whole), "o", color=colour)
    closed = fractionally_delayed_spring_damping(1.0, 1.0, late[::10])
    axes.plot(late[::10], closed, "k+", label="closed form, B = 0", zorder=3)
    axes.plot(late, 0.5 + late, color=BLACK, linestyle=DOTTED, label="K (T/2 + delay), too small")
    axes.set(xlabel="delay of the force [T]", ylabel="damping needed b/(KT)", title="A force that acts late")


def late_rows(axes):
    """What springs and dampers are asked for over delay."""
    late = np.linspace(0.0, 2.0, 201)
    for share, what, colour, mark in ((1.0, "always so late", GREEN, "o"), (0.0, "up to so late", PURPLE, "s")):
        for damping, dashes in ((0.0, SOLID), (0.25, DASHED)):
            asked = [least_damping(1.0, damping, 1.0, float(value), share * float(value)) for value in late]
            look = {"linestyle": dashes, "color": colour, "marker": mark, "markevery": 40, "markersize": 4}
            axes.plot(late, asked, **look, label=f"{what}, B = {damping:g} KT")
    axes.set(xlabel="delay of the force [T]", ylabel="damping needed b/(KT)")
    axes.set_title("Late force: what the driver asks for")


def negative(axes):
    """What a wall and a coupling with damping of either sign need: the correction for B < 0."""
    damping = np.linspace(-0.49, 0.4, 300)
    wall, coupling = wall_damping(1.0, damping, 1.0), wall_damping_for_any_simulation(1.0, damping, 1.0)
    axes.fill_between(damping, wall, coupling, color=VERMILION, alpha=0.2, label="enough for a wall only")
    axes.plot(damping, coupling, color=VERMILION, label="coupling, B < 0: (KT/2)²/(KT/2 + B)")
    axes.plot(damping, wall, color=BLUE, linestyle=DASHED, label="wall: KT/2 + |B|")
    points = np.array([-0.4, -0.3, -0.2, -0.1, 0.0, 0.2])
    axes.plot(points, [mu_threshold(value) for value in points], "ko", markersize=4, label="threshold of the μ test")
    for needed, below in ((wall_damping, 16), (wall_damping_for_any_simulation, -4)):
        need = needed(1.0, -0.3, 1.0)
        axes.annotate(f"{need:.3g}", (-0.3, need), xytext=(6, -below), textcoords="offset points")
    axes.axvline(-0.5, color=BLACK, linewidth=0.8, linestyle=DOTTED, label="limit: no b is enough")
    axes.set(xlabel="virtual damping B/(KT)", ylabel="damping needed b/(KT)", ylim=(0.0, 3.0), xlim=(-0.55, 0.4))
    axes.set_title("Negative damping on a coupling")


def drawn(axes):
    """Energy that the worst path of 60 ticks draws over b, at B = −0.3 KT."""
    b, ticks = np.linspace(0.6, 1.4, 161), np.arange(60.0)
    energy = [energy_generated_over_horizon(1.0, -0.3, value, 1.0, ticks) for value in b]
    positive = np.where(np.array(energy) > 0.0, energy, np.nan)
    axes.semilogy(b, positive, color=BLACK, label="energy drawn")
    axes.axvline(0.8, color=BLUE, linestyle=DASHED, label="KT/2 + |B|, as in the paper")
    axes.axvline(1.25, color=VERMILION, label="(KT/2)²/(KT/2 + B)")
    axes.set(xlabel="physical damping b/(KT)", ylabel="energy drawn / (K path²)", xlim=(b[0], b[-1]))
    axes.set_title("Worst path of 60 ticks, B = −0.3 KT")


def switch(axes):
    """What cancelling damping costs the wall."""
    share = np.linspace(0.0, 0.99, 200)
    outside = switched_cancellation_damping(1.0, 0.0, 1.0, share)
    axes.plot(share, 0.5 / (1.0 - share), color=VERMILION, linestyle=MIXED, label="cancelled inside the wall too")
    axes.plot(share, outside, color=BLUE, label="cancelled outside the wall only")
    axes.plot(share, 1.0 / (2.0 - share), color=BLACK, linestyle=DASHED, label="1/(2 − ρ), an upper bound")
    axes.set(xlabel="share ρ of b that is cancelled", ylabel="damping needed b/(KT)", ylim=(0.4, 2.2))
    axes.set_title("Damping cancelled up to the wall, B = 0")


def _true(number):
    """A number with a true minus."""
    return f"{number:g}".replace("-", "−")
