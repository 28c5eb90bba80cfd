# SPDX-License-Identifier: Apache-2.0
"""What the whole display can show with each exchange method, and how a peg in a hole feels with the tool in the servo.

usage: python bench/figure_local.py [PNG, default docs/figures/local.png]

Left: stiffness felt in contact against drag in free space, the numbers of `haptic bench local`: lock-step, coupling at
0.95 of what the device covers, 1 ms round trip, 1000 samples a second. Right: Fig. 5 of Colgate, Stanley & Brown
(1995), equations in haptic_sim/bench/insertion.py, with the contacts in the servo made soft enough to be seen.
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from haptic_device.law.local import LEAVING
from haptic_sim.bench import insertion as peg
from haptic_sim.cli.bench_local import NETWORKS, measure, run

RATES = {1000.0: "o", 4000.0: "s", 10000.0: "^"}
COLOURS = {"direct": "tab:red", "pspm": "tab:blue", "local": "tab:green"}
SOFT = 1e-5  # [m/N] at rest a contact is a spring of LEAVING times its inverse
GAINS = {0.0: "tab:green", 1.0: "tab:purple"}  # [N m/rad]
HAND = 1.0  # [N m/rad] of the hand, behind which a rotation gain stands
DEEP = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
PULLS = (5e-5, 1e-4)  # [m] beyond the free play


def main():
    path = sys.argv[1] if len(sys.argv) > 1 else "docs/figures/local.png"
    figure, (left, right) = plt.subplots(1, 2, figsize=(13.0, 4.6), layout="constrained")
    whole_display(left)
    insertion(right)
    for axes in (left, right):
        axes.grid(True, which="both", alpha=0.2)
        axes.legend(fontsize=8)
    figure.savefig(path, dpi=100)


def whole_display(axes):
    for method, colour in COLOURS.items():
        found = [measure(rate, method) for rate in RATES]
        drags, felt = [max(1e-4, abs(one.drag)) for one in found], [one.stiffness for one in found]
        axes.plot(drags, felt, "-", color=colour, alpha=0.4)
        for (rate, marker), drag, stiffness in zip(RATES.items(), drags, felt, strict=True):
            axes.plot(drag, stiffness, marker, color=colour, label=f"{method}, {rate * 1e-3:g} kHz")
            print(f"{method:6} {rate:6.0f} Hz: {stiffness:8.0f} N/m, drag {drag:.4f} N s/m", flush=True)
    axes.set(xscale="log", yscale="log", xlabel="drag in free space, net of the device's b [N s/m]",
             ylabel="stiffness felt in contact [N/m]")  # fmt: skip
    axes.set_title("b = 3 N s/m, B = 0.5 N s/m, K = 0.95 · 2(b − B)/T; passive unless direct", fontsize=10)


def insertion(axes):
    stiffness, deep = LEAVING / SOFT, np.geomspace(DEEP[0], DEEP[-1], 100)
    for gain, colour in GAINS.items():
        behind = peg.behind_coupling(gain, HAND)
        theory = [peg.behind_coupling(peg.apparent_stiffness(one, behind, stiffness)) for one in deep]
        axes.plot(1e3 * deep, theory, "k-" if gain == 0.0 else "k--", linewidth=1.0,
                  label=f"theory, rotation gain {behind:g} N m/rad")  # fmt: skip
        found = [felt(one, gain) for one in DEEP]
        axes.plot(1e3 * np.array(DEEP), found, "o", color=colour, label=f"local, 4 kHz, {behind:g} N m/rad")
        for one, shown in zip(DEEP, found, strict=True):
            exact = peg.behind_coupling(peg.apparent_stiffness(one, behind, stiffness))
            print(f"gain {behind:g} N m/rad, L {1e3 * one:5.0f} mm: {shown:8.2f} N/m felt, theory {exact:8.2f} "
                  f"({100.0 * (shown / exact - 1.0):+.2f} %)", flush=True)  # fmt: skip
    axes.axhline(peg.COUPLING, color="gray", linewidth=1.0, linestyle=":", label="coupling")
    axes.set(xscale="log", yscale="log", xlabel="insertion L [mm]", ylabel="stiffness at the handle [N/m]")
    axes.set_title(f"Fig. 5: contacts of {stiffness:g} N/m in the servo, behind the coupling", fontsize=10)


def felt(deep, gain):
    """Stiffness [N/m] at the handle: a straight line through two pulls, each settled."""
    play = peg.free_play(deep, 1e-6)
    (x0, f0), (x1, f1) = [pulled(play + pull, deep, gain) for pull in PULLS]
    return (f1 - f0) / (x1 - x0)


def pulled(place, deep, gain):
    """Where the handle rests [m] and what it pulls with [N]."""
    given = {"coupling.stiffness": peg.COUPLING, "coupling.damping": 1.0, "coupling.rotational_stiffness": gain,
             "coupling.rotational_damping": 0.002, "local.compliance": SOFT}  # fmt: skip
    motion = {"motion.name": "press_wall", "motion.start": (0.0, peg.HEIGHT, 0.0),
              "motion.target": (place, peg.HEIGHT, 0.0), "hand.rotational_stiffness": HAND}  # fmt: skip
    rows, _ = run(peg.peg(deep, 1e-6), "local", *NETWORKS["1 kHz"], given, motion, fine=True)
    held = rows[int(0.6 * len(rows)) : int(0.68 * len(rows))]
    assert held.local.all(), "the servo's own tool was not in use"
    return float(held.position[:, 0].mean()), float(-held.force_coupling[:, 0].mean())


if __name__ == "__main__":
    main()
