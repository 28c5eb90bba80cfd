# SPDX-License-Identifier: Apache-2.0
"""Z-width of the whole display: stiffness felt in contact against drag in free space, for each exchange method.

usage: python bench/figure_local.py [PNG, default docs/figures/local.png]

In lock-step, coupling at 0.95 of what the device covers, 1 ms round trip, 1000 samples a second; the numbers are those
of `haptic bench local`.
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from haptic_sim.cli.bench_local import measure

RATES = {1000.0: "o", 4000.0: "s", 10000.0: "^"}
COLOURS = {"direct": "tab:red", "pspm": "tab:blue", "local": "tab:green"}


def main():
    path = sys.argv[1] if len(sys.argv) > 1 else "docs/figures/local.png"
    figure, axes = plt.subplots(figsize=(7.0, 4.5), layout="constrained")
    for method, colour in COLOURS.items():
        found = [measure(rate, method) for rate in RATES]
        drags, felt = [max(1e-4, abs(one.drag)) for one in found], [one.stiffness for one in found]
        axes.plot(drags, felt, "-", color=colour, alpha=0.4)
        for (rate, marker), drag, stiffness in zip(RATES.items(), drags, felt, strict=True):
            axes.plot(drag, stiffness, marker, color=colour, label=f"{method}, {rate * 1e-3:g} kHz")
            print(f"{method:6} {rate:6.0f} Hz: {stiffness:8.0f} N/m, drag {drag:.4f} N s/m")
    axes.set(xscale="log", yscale="log", xlabel="drag in free space, net of the device's b [N s/m]",
             ylabel="stiffness felt in contact [N/m]")  # fmt: skip
    axes.set_title("b = 3 N s/m, B = 0.5 N s/m, K = 0.95 · 2(b − B)/T; passive unless direct", fontsize=10)
    axes.grid(True, which="both", alpha=0.2)
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    main()
