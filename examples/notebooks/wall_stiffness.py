# SPDX-License-Identifier: Apache-2.0
"""Notebook: the stiffness of a wall by linear regression, with its confidence interval.

marimo edit wall_stiffness.py -- --bag haptic_runs/RUN/bag
"""

import marimo

__generated_with = "0.25.2"
app = marimo.App()


@app.cell
def _():
    import marimo as mo
    import numpy as np
    from matplotlib.figure import Figure
    from scipy import stats
    from short_run import recorded, tap_a_wall

    from haptic_device.theory.palette import DASHED, FORCE, HANDLE, INK

    return DASHED, FORCE, Figure, HANDLE, INK, mo, np, recorded, stats, tap_a_wall


@app.cell
def _(mo):
    mo.md(r"""
    # The stiffness of a wall

    A hand presses the handle into a wall and measures depth and force. For a spring and a damper,
    $f = K d + B \dot d$, where $f$ is the force of the wall on the handle, $d$ the depth, $K$ the stiffness
    and $B$ the damping. We find $K$ and $B$ by least squares.

    `--bag FOLDER` names a recording whose wall is at $x = 0$ and pushes along $+x$. Without it, a simulated hand
    taps three times on a wall of 1000 N/m.
    """)
    return


@app.cell
def _(mo, recorded, tap_a_wall):
    recording = recorded(mo.cli_args().get("bag"), tap_a_wall, "operator/state")
    state = recording.joint("operator/state")
    time = (state.stamp - state.stamp[0]) * 1e-9  # s
    depth, speed = -state.entry("x"), -state.entry("x", "velocity")  # m, m/s; into the wall
    force = state.entry("motor_x", "effort")  # N, of the motor on the handle
    return depth, force, recording, speed, time


@app.cell
def _(FORCE, Figure, HANDLE, depth, force, time):
    over_time = Figure(figsize=(8, 4), layout="constrained")
    _above, _below = over_time.subplots(2, 1, sharex=True)
    _above.set(title="Depth and force over time", ylabel="depth d [mm]")
    _above.plot(time, 1e3 * depth, color=HANDLE)
    _below.set(xlabel="time [s]", ylabel="force f [N]")
    _below.plot(time, force, color=FORCE)
    over_time
    return (over_time,)


@app.cell
def _(mo, np, force):
    # A contact is a stretch of samples with force; shorter ones are touches that tell nothing.
    _edges = np.flatnonzero(np.diff(np.concatenate([[False], force > 0.05, [False]])))
    contacts = [slice(begin, end) for begin, end in _edges.reshape(-1, 2) if end - begin >= 20]
    if len(contacts) < 2:
        raise SystemExit(
            f"the interval needs at least 2 contacts with the wall at x = 0; this recording has {len(contacts)}"
        )
    mo.md(f"There are {len(contacts)} contacts. Each gives one estimate of $K$ and $B$, and of a constant offset.")
    return (contacts,)


@app.cell
def _(contacts, depth, force, np, speed):
    def fit(part):
        """K [N/m], B [N s/m] and offset [N] of one contact, by least squares."""
        columns = np.column_stack([depth[part], speed[part], np.ones_like(depth[part])])
        return np.linalg.lstsq(columns, force[part], rcond=None)[0]

    fits = np.array([fit(part) for part in contacts])
    return (fits,)


@app.cell
def _(contacts, fits, mo, stats):
    # Errors within a contact are alike, so the contacts are the independent samples, not the ticks.
    stiffness, damping = fits[:, :2].mean(axis=0)
    _quantile = stats.t.ppf(0.975, len(contacts) - 1)
    half_width = _quantile * fits[:, 0].std(ddof=1) / len(contacts) ** 0.5
    print(f"stiffness {stiffness:.1f} ± {half_width:.1f} N/m (95 %), damping {damping:.2f} N s/m")
    mo.md(f"$K = {stiffness:.1f} \\pm {half_width:.1f}$ N/m (95 % interval, Student's $t$), $B = {damping:.2f}$ N s/m.")
    return damping, half_width, stiffness


@app.cell
def _(DASHED, FORCE, Figure, INK, contacts, depth, fits, force, np):
    law = Figure(figsize=(6, 4), layout="constrained")
    _axes = law.subplots()
    _axes.set(title="Force over depth, and the fitted spring", xlabel="depth d [mm]", ylabel="force f [N]")
    for _part in contacts:
        _axes.plot(1e3 * depth[_part], force[_part], ".", color=FORCE, markersize=3)
    _line = np.linspace(0.0, max(depth[part].max() for part in contacts), 2)
    _mean = fits.mean(axis=0)
    _axes.plot(1e3 * _line, _mean[0] * _line + _mean[2], color=INK, linestyle=DASHED, label="K d")
    _axes.legend()
    law
    return (law,)


@app.cell
def _(mo):
    mo.md(r"""
    $B$ is smaller than the damping that was set, 1 N s/m, by about $K T$. $T$ is the servo period: the force of a tick
    is held for one period while the handle moves on. Try another stiffness: `tap_a_wall(500.0)`.
    """)
    return


if __name__ == "__main__":
    app.run()
