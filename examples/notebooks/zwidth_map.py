# SPDX-License-Identifier: Apache-2.0
"""Notebook: which walls a device shows without shaking, a map of stiffness and damping.

marimo edit zwidth_map.py -- --device desktop --rate 1000
"""

import marimo

__generated_with = "0.25.2"
app = marimo.App()


@app.cell
def _():
    import os

    import marimo as mo
    import numpy as np
    from matplotlib.figure import Figure

    from haptic_device.theory import zwidth, zwidth_map
    from haptic_device.theory.zwidth_figure import draw_cells
    from haptic_display.device_tools.zwidth_plane import device_figures, request_of

    return Figure, device_figures, draw_cells, mo, np, os, request_of, zwidth, zwidth_map


@app.cell
def _(mo):
    mo.md(r"""
    # A map of walls

    A wall has a stiffness $K$ and a damping $B$. Colgate and Brown (1994) call the range that a device can show its
    Z-width. Each cell of the map is one simulated run: the handle taps on the wall and stays pressed against it.

    `--device NAME` names a device description, `--rate HZ` the servo rate. Without them: `desktop`, 1000 Hz.
    """)
    return


@app.cell
def _(device_figures, mo, zwidth):
    _given = mo.cli_args()
    try:
        _rate = float(_given.get("rate", 1000.0))  # Hz
        if not 500.0 <= _rate <= 10000.0:
            raise ValueError(f"rate is {_rate:g} Hz; the servo takes 500 to 10000 Hz")
        period = 1.0 / _rate  # s
        _figures = device_figures(str(_given.get("device", "desktop")), period)
    except (OSError, ValueError) as error:
        raise SystemExit(f"--device, --rate: {error}") from None
    setup = zwidth.Setup(**_figures, period=period, seconds=0.5)
    mo.md(f"m = {setup.mass:g} kg, b = {setup.physical_damping:g} N s/m, T = {1e3 * period:g} ms")
    return period, setup


@app.cell
def _(os, request_of, setup, zwidth_map):
    request = request_of(setup, "none", None, None, 24)  # no operator; 24 × 24 cells up to what theory allows
    plane = zwidth_map.draw_map(request, len(os.sched_getaffinity(0)))
    return plane, request


@app.cell
def _(mo):
    mo.md(r"""
    ## Theory

    A wall is passive if $b > K T / 2 + |B|$ (Colgate 1995, equation 3), with the damping $b$ of the mechanism and the
    servo period $T$. Then $K < 2 (b - |B|) / T$. A passive wall is quiet with every operator. Another wall may still be
    quiet in this run, because nobody holds the handle.
    """)
    return


@app.cell
def _(np, period, request, setup):
    passive = np.maximum(0.0, 2.0 * (setup.physical_damping - np.abs(request.damping)) / period)  # N/m, of each row
    return (passive,)


@app.cell
def _(Figure, draw_cells, plane, request):
    picture = Figure(figsize=(7, 5), layout="constrained")
    _axes = picture.subplots()
    draw_cells(_axes, request, plane)
    _axes.set_title("Which walls shake")
    _axes.legend(loc="upper left")
    picture
    return (picture,)


@app.cell
def _(mo, passive, plane, request):
    _inside = request.stiffness[None, :] < passive[:, None]
    shaking = plane.outcome.assessment != 0
    passive_cells, passive_shaking = int(_inside.sum()), int((_inside & shaking).sum())
    shaking_cells = int(shaking.sum())
    _text = f"of {passive_cells} passive walls {passive_shaking} shake; of all {shaking.size} walls {shaking_cells} do"
    print(_text)
    mo.md(_text)
    return passive_cells, passive_shaking, shaking_cells


if __name__ == "__main__":
    app.run()
