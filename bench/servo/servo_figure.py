# SPDX-License-Identifier: Apache-2.0
"""Figure of `python -m bench servo`: histograms of lateness, one panel a rate, servo and cyclictest in each."""

import numpy as np
from matplotlib.figure import Figure

COLOURS = {"prefer": "tab:blue", "off": "tab:orange"}
STYLES = {("servo", "alone"): "-", ("servo", "demo"): "--", ("cyclictest", "alone"): ":", ("cyclictest", "demo"): ":"}
_BINS = np.unique(np.round(np.concatenate([[0.0], np.logspace(0.0, 4.3, 60)])))  # [µs], whole as cyclictest counts


def save(samples: dict, path) -> None:
    """Write {(rate, realtime, load, who): lateness [us]} as PNG; OSError if the file cannot be written."""
    rates = sorted({case[0] for case in samples})
    figure = Figure(figsize=(8.0, 2.2 * len(rates) + 0.8), layout="constrained")
    for axes, rate in zip(figure.subplots(len(rates), 1, sharex=True, squeeze=False).flat, rates, strict=True):
        for (at, realtime, load, who), late in samples.items():
            if at == rate and (who, load) != ("cyclictest", "demo"):
                share = np.histogram(np.floor(late), _BINS)[0] / len(late)
                axes.stairs(
                    np.where(share > 0.0, share, np.nan),
                    _BINS,
                    color=COLOURS[realtime],
                    linestyle=STYLES[who, load],
                    label=f"{who}, {load}, realtime {realtime}",
                )
        axes.axvline(1e6 / rate, color="black", linewidth=0.8)
        axes.set(xscale="log", yscale="log", ylabel=f"{rate:g} Hz\nshare of ticks")
        axes.grid(alpha=0.3)
    figure.axes[-1].set_xlabel("wake-up after its deadline [µs]; black: the next deadline")
    figure.axes[0].legend(fontsize=7)
    figure.savefig(path, dpi=100, format="png")
