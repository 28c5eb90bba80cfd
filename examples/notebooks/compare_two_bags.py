# SPDX-License-Identifier: Apache-2.0
"""Notebook: two recordings side by side: force, stretch of the coupling, energy.

marimo edit compare_two_bags.py -- --bag soft/bag --other stiff/bag
"""

import marimo

__generated_with = "0.25.2"
app = marimo.App()


@app.cell
def _():
    import marimo as mo
    import numpy as np
    from matplotlib.figure import Figure
    from short_run import press_a_tool, recorded

    from haptic_device.theory.palette import RUNS

    return Figure, RUNS, mo, np, press_a_tool, recorded


@app.cell
def _(mo):
    mo.md(r"""
    # Two recordings compared

    The same hand presses the same tool against the same wall, once through a soft coupling and once through a stiff
    one. What changes for the hand?

    `--bag FOLDER` and `--other FOLDER` name two recordings. Without them: couplings of 1000 and 2000 N/m.
    """)
    return


@app.cell
def _(mo, press_a_tool, recorded):
    _given = mo.cli_args()
    _first = recorded(_given.get("bag"), lambda: press_a_tool(1000.0))
    _second = recorded(_given.get("other"), lambda: press_a_tool(2000.0))
    names = [str(_given.get("bag") or "1000 N/m"), str(_given.get("other") or "2000 N/m")]
    traces = [_first.trace, _second.trace]
    return names, traces


@app.cell
def _(mo):
    mo.md(r"""
    Two recordings do not begin at the same time. We set time 0 to the first tick in which the motor is engaged and the
    tool is known, and keep the ticks from there on.
    """)
    return


@app.cell
def _(names, np, traces):
    _begins = [np.flatnonzero((trace["engage"] > 0.0) & (trace["tool_age"] >= 0.0)) for trace in traces]
    for _name, _begin in zip(names, _begins, strict=True):
        if not len(_begin):
            raise SystemExit(f"recording {_name}: the motor never engages while the tool is known")
    runs = [trace[begin[0] :] for trace, begin in zip(traces, _begins, strict=True)]
    times = [(run["deadline"] - run["deadline"][0]) * 1e-9 for run in runs]  # s
    forces = [np.hypot(*run["force_on_handle"][:, :2].T) for run in runs]  # N
    stretches = [np.hypot(*(run["tool_position"] - run["position"])[:, :2].T) for run in runs]  # m
    energies = [run["energy_given"].sum(axis=1) - run["energy_given"][0].sum() for run in runs]  # J
    return energies, forces, stretches, times


@app.cell
def _(Figure, RUNS, energies, forces, names, stretches, times):
    picture = Figure(figsize=(8, 7), layout="constrained")
    _axes = picture.subplots(3, 1, sharex=True)
    picture.suptitle("The same hand on two couplings")
    _shown = (("force on the hand [N]", forces, 1.0), ("stretch of the coupling [mm]", stretches, 1e3))
    for _place, (_label, _curves, _scale) in zip(_axes, (*_shown, ("energy given [mJ]", energies, 1e3)), strict=True):
        _place.set_ylabel(_label)
        for _name, _time, _curve, _look in zip(names, times, _curves, RUNS, strict=False):
            _place.plot(_time, _scale * _curve, color=_look.colour, linestyle=_look.dashes, label=_name)
    _axes[-1].set_xlabel("time since the motor engaged [s]")
    _axes[0].legend()
    picture
    return (picture,)


@app.cell
def _(energies, forces, mo, names, stretches):
    greatest_force = [float(force.max()) for force in forces]  # N
    greatest_stretch = [float(stretch.max()) for stretch in stretches]  # m
    energy = [float(curve[-1]) for curve in energies]  # J, at the end
    _rows = zip(names, greatest_force, greatest_stretch, energy, strict=True)
    _lines = [f"{name}: {f:.2f} N, {1e3 * way:.2f} mm, {1e3 * e:.2f} mJ" for name, f, way, e in _rows]
    print("\n".join(_lines))
    mo.md("Greatest force, greatest stretch, energy given at the end:\n\n" + "\n".join(f"* {line}" for line in _lines))
    return energy, greatest_force, greatest_stretch


if __name__ == "__main__":
    app.run()
