# SPDX-License-Identifier: Apache-2.0
"""Notebook: computing time over error of the simulation methods and of other engines, one scene at a time.

marimo edit speed_against_error.py -- --scene peg_in_hole
"""

import marimo

__generated_with = "0.25.2"
app = marimo.App()


@app.cell
def _():
    import csv
    from pathlib import Path

    import marimo as mo
    from matplotlib.figure import Figure

    from haptic_device.theory.palette import METHODS, PEERS

    return Figure, METHODS, PEERS, Path, csv, mo


@app.cell
def _(mo):
    mo.md(r"""
    # Speed against error

    A short step costs time and makes a small error. A long step is cheap and makes a large one. So a method is a curve:
    computing time over error. One method is better than another at an error if its curve is lower there.

    The runs are those of `python -m bench speed_error`. The error is the distance of the bodies from a reference
    solution, relative to the way that they come.
    """)
    return


@app.cell
def _(Path, csv, mo):
    _given = mo.cli_args()
    _there = Path(__file__).resolve().parents[2] / "docs/benchmarks/speed_error.csv"
    _file, scene = Path(str(_given.get("csv", _there))), str(_given.get("scene", "peg_in_hole"))
    try:
        with _file.open(encoding="utf-8", newline="") as _stream:
            _rows = list(csv.DictReader(_stream))
    except OSError as error:
        raise SystemExit(f"--csv: {_file}: {error.strerror}") from None
    if _lacking := {"scene", "method", "wall", "error", "status"} - set(_rows[0] if _rows else ()):
        raise SystemExit(f"--csv: {_file} has no column {min(_lacking)}; python -m bench speed_error --out writes one")
    _scenes = sorted({row["scene"] for row in _rows})
    if scene not in _scenes:
        raise SystemExit(f"--scene is {scene}; {_file} has {', '.join(_scenes)}")
    runs = [row for row in _rows if row["scene"] == scene and row["status"] == "stable"]
    return runs, scene


@app.cell
def _(mo):
    mo.md("""
    A run is on the **front** of its method if no other run of this method is both faster and more exact.
    """)
    return


@app.cell
def _(runs):
    def front_of(method):
        """(error, time [s] per simulated second) of the runs that are on the front, by rising error."""
        points = sorted((float(row["error"]), float(row["wall"])) for row in runs if row["method"] == method)
        best, kept = float("inf"), []
        for error, wall in points:
            if wall < best:
                best = wall
                kept.append((error, wall))
        return kept

    fronts = {method: front_of(method) for method in sorted({row["method"] for row in runs})}
    return (fronts,)


@app.cell
def _(Figure, METHODS, PEERS, fronts, scene):
    picture = Figure(figsize=(8, 5), layout="constrained")
    _axes = picture.subplots()
    _axes.set(title=f"Speed against error: {scene}", xlabel="error, relative", ylabel="computing time [ms per s]")
    _axes.set(xscale="log", yscale="log")
    for _method, _points in fronts.items():
        _errors, _walls = zip(*_points, strict=True)
        _axes.plot(_errors, [1e3 * wall for wall in _walls], label=_method, **(METHODS | PEERS)[_method].line)
    _axes.grid(alpha=0.3)
    picture.legend(loc="outside right upper")
    picture
    return (picture,)


@app.cell
def _(fronts, mo):
    _enough = {method: [wall for error, wall in front if error <= 1e-3] for method, front in fronts.items()}
    fastest = min((min(walls), method) for method, walls in _enough.items() if walls)
    _text = f"fastest with an error of at most 0.1 %: {fastest[1]}, {1e3 * fastest[0]:.3g} ms per simulated second"
    print(_text)
    mo.md(_text)
    return (fastest,)


if __name__ == "__main__":
    app.run()
