# SPDX-License-Identifier: Apache-2.0
"""Notebook: energy at the ports of handle and tool, added up by hand and compared with what the nodes book.

marimo edit energy_at_the_port.py -- --bag haptic_runs/RUN/bag
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

    from haptic_device.theory.palette import DASHED, HANDLE, INK, TOOL

    return DASHED, Figure, HANDLE, INK, TOOL, mo, np, press_a_tool, recorded


@app.cell
def _(mo):
    mo.md(r"""
    # Energy at the port

    A port is a place where two systems exchange power. Its power is force times velocity, so the energy over one servo
    period is force times displacement. This notebook adds up the energy at two ports, handle and tool.

    `--bag FOLDER` names a recording of a device of scale 1. Without it, a simulated hand presses a tool against a wall.
    """)
    return


@app.cell
def _(mo, np, press_a_tool, recorded):
    recording = recorded(mo.cli_args().get("bag"), press_a_tool)
    trace = recording.trace  # one row a servo tick
    damping = np.zeros(3)  # b of each axis [N s/m, N m s/rad]
    _said = [float(part) for part in recording.last_values("haptic_driver")["physical_damping"].split(",")]
    damping[: len(_said)] = _said
    time = (trace["deadline"] - trace["deadline"][0]) * 1e-9  # s
    return damping, recording, time, trace


@app.cell
def _(mo):
    mo.md(r"""
    ## The handle

    The driver books the energy $E$ that the motors give to the operator. Per tick $k$ and axis

    $$E_{k+1} = E_k + \bar f_k \Delta x_k - b \frac{\Delta x_k^2}{T_k}$$

    $\bar f_k$: mean force of the motor on the handle over the period, without the force that carries the handle's
    weight; $\Delta x_k$: displacement; $b$: damping of the mechanism; $T_k$: length of the period. The last term is the
    least that the mechanism's damper takes. A force is written `write_delay` after its deadline. Until then the force
    of the tick before acts.
    """)
    return


@app.cell
def _(damping, np, time, trace):
    _period = np.diff(time)[:, None]
    _force = trace["force_on_handle"] - trace["engage"][:, None] * trace["force_gravity"]
    _late = trace["write_delay"][1:, None]  # of the tick before
    _before = np.vstack([np.zeros(3), _force[:-2]])
    _mean = _force[:-1] + (_before - _force[:-1]) * _late / _period
    _moved = np.diff(trace["position"], axis=0)
    _steps = _mean * _moved - damping * _moved**2 / _period
    by_hand = np.concatenate([[0.0], np.cumsum(_steps.sum(axis=1))])  # J
    booked = trace["energy_given"].sum(axis=1) - trace["energy_given"][0].sum()  # J
    return booked, by_hand


@app.cell
def _(DASHED, Figure, HANDLE, INK, booked, by_hand, time):
    handle_port = Figure(figsize=(8, 4), layout="constrained")
    _axes = handle_port.subplots()
    _axes.set(title="Energy given to the operator", xlabel="time [s]", ylabel="energy E [mJ]")
    _axes.plot(time, 1e3 * booked, color=HANDLE, label="booked by the driver")
    _axes.plot(time, 1e3 * by_hand, color=INK, linestyle=DASHED, label="by hand")
    _axes.legend()
    handle_port
    return (handle_port,)


@app.cell
def _(mo):
    mo.md(r"""
    A display that is passive never gives the operator more energy than was put in, so $E$ does not rise above zero.

    ## The tool

    The coupling supplies energy to the tool: $\sum f \Delta x$ over all exchanges. $f$ is the force of the coupling on
    the tool at the end of the exchange. The simulation books each of its sub-steps, so the two sums differ a little.
    """)
    return


@app.cell
def _(np, recording, trace):
    _new = np.flatnonzero(np.diff(trace["tool_sequence"], prepend=0.0) > 0.0)  # first tick with each tool sample
    _force, _way = trace["tool_effort"][_new], trace["tool_position"][_new]
    tool_time = trace["deadline"][_new[1:]] * 1e-9 - trace["deadline"][0] * 1e-9  # s
    supplied = np.cumsum((_force[1:] * np.diff(_way, axis=0)).sum(axis=1))  # J
    tool_booked = float(recording.last_values("haptic_simulation").get("tool_port_energy", "nan"))  # J
    return supplied, tool_booked, tool_time


@app.cell
def _(DASHED, Figure, INK, TOOL, supplied, tool_booked, tool_time):
    tool_port = Figure(figsize=(8, 4), layout="constrained")
    _axes = tool_port.subplots()
    _axes.set(title="Energy supplied to the tool", xlabel="time [s]", ylabel="energy [mJ]")
    _axes.plot(tool_time, 1e3 * supplied, color=TOOL, label="by hand")
    _axes.axhline(1e3 * tool_booked, color=INK, linestyle=DASHED, label="at the end, booked by the simulation")
    _axes.legend()
    tool_port
    return (tool_port,)


@app.cell
def _(booked, by_hand, mo, np, supplied, tool_booked):
    difference = float(np.abs(by_hand - booked).max())  # J
    tool_difference = float(abs(supplied[-1] - tool_booked)) if len(supplied) else float("nan")  # J
    _text = f"handle: {1e3 * by_hand[-1]:.3f} mJ by hand, at most {1e6 * difference:.3g} µJ from the driver's; "
    _text += f"tool: at the end {1e6 * tool_difference:.3g} µJ from the simulation's"
    print(_text)
    mo.md(_text)
    return difference, tool_difference


if __name__ == "__main__":
    app.run()
