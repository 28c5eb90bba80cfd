# SPDX-License-Identifier: Apache-2.0
"""Results of all benchmarks in one folder: machine facts, one file each, and the figures that the table shows."""

import json
from pathlib import Path
from typing import NamedTuple

from bench.jobs import markdown as table
from bench.methods.hard_cases import CREATED, OVERLAP
from bench.methods.measure import Run
from bench.methods.table import OURS, by_scene, default_method, summary

MACHINE = "machine.json"


class Figure(NamedTuple):
    """A line of the table: what was measured, its value and unit, and what is wanted of it, in words."""

    name: str
    value: float | None
    unit: str
    wanted: str = ""


def figures(folder: Path) -> list[Figure]:
    """All figures that the folder's files hold. Raises ValueError, one sentence, if it is no folder of results."""
    if not (folder / MACHINE).exists():
        raise ValueError(f"{folder} holds no results of `python -m bench all`: {MACHINE} is missing")
    files = {name: folder / f"{name}.json" for name in READERS}
    return [figure for name, file in files.items() if file.exists() for figure in READERS[name](_read(file))]


def markdown(folder: Path) -> str:
    """The one table, with the machine above it."""
    facts = _read(folder / MACHINE)
    machine, program = facts["machine"], facts["program"]
    head = (
        f"{machine['cores']} cores of {machine['processor']}, {machine['system'].split('-with')[0]}; "
        f"Python {program['python']}, numba {facts['packages']['numba']}; {facts['length']} run."
    )
    rows = [(one.name, f"{_shown(one.value)} {one.unit}", one.wanted) for one in figures(folder)]
    return f"{head}\n\n{table(('figure', 'measured', 'wanted'), rows)}"


def _read(file):
    return json.loads(file.read_text(encoding="utf-8"))


def _shown(value):
    """Three digits, or a dash for what could not be had."""
    return "–" if value is None else f"{value:.3g}"


def _memory(found, when=""):
    return [Figure(f"memory of {name} (PSS){when}", value, "MB", "≤ 200 MB") for name, value in found.items()]


def _start(found):
    again = sorted(max(one.values()) for one in found["again"])
    yield Figure("very first start, all nodes at work", max(found["first"].values()), "s", "≤ 20 s")
    yield Figure("later start", again[len(again) // 2], "s", "≤ 3 s")
    yield from _memory(found.get("first_pss_mb", {}), ", very first start")


def _servo(found):
    for one in found["lateness"]:
        fifo = _fifo(one)
        where = f"{one['rate']:g} Hz, {fifo}"
        yield Figure(f"lateness p99, {where}", one["p99"], "µs")
        yield Figure(f"lateness p99 to cyclictest's, {where}", one["p99_ratio"], "×", "≤ 2" if fifo == "FIFO" else "")


def _fifo(case):
    """What it had, not what it preferred."""
    if case["realtime"] != "prefer":
        return "no FIFO"
    return "FIFO refused" if "no SCHED_FIFO" in case["scheduling"] else "FIFO"


def _round_trip(found):
    for one in found:
        where = f"{one['rate']:g} Hz, {one['answerer']}"
        yield Figure(f"round trip p50, {where}", one["p50_us"], "µs")
        if one["answerer"] == "simulation":
            yield Figure(f"round trip p50 to the bare one's, {one['rate']:g} Hz", one["ratio"], "×", "≤ 1.35")
            cores = sum(one[f"{node}_cores"] for node in ("loopback", "simulation", "driver"))
            yield Figure(f"device, simulation and driver, {where}", cores, "cores")


def _link(found):
    for one in found["waits"]:
        where = f"{one['transport']}, {one['rate']:g} Hz"
        for name in ("p50", "p99"):
            yield Figure(f"sample in hand {name}, {where}", one["ours"][name], "µs")
            yield Figure(f"sample in hand {name} to a bare pair's, {where}", one[f"{name}_ratio"], "×", "≤ 2")
    for one in found["clock"]:
        yield Figure(f"error of the device's clock p99, {one['transport']}", one["p99"], "µs", "≤ 10 µs")
        yield Figure(f"steps of that clock found, {one['transport']}", one["steps"], "of 1", "all")
        yield Figure(f"known again to 10 µs after its step, {one['transport']}", one["again"], "s")


def _costs(found):
    for one in found["costs"]:
        yield Figure(f"{one['what']}: one more {one['grows_with']}", one["slope"], "µs")
    for one in found["ports"]:
        what = f"an exchange of {one['scene']}, {one['method']}"
        yield Figure(f"{what}: with pspm to with direct", one["pspm"] / one["direct"], "×", "≤ 1.2")
        if one["bare"]:
            yield Figure(f"{what}: to its steps alone", one["direct"] / one["bare"], "×", "≤ 2.2")
    cell = next(one for one in found["costs"] if one["grows_with"] == "cell")
    yield Figure("Z-width map: largest deviation from a straight line", 100.0 * cell["apart"], "%", "≤ 10 %")
    yield Figure("Z-width map on two cores, efficiency", found["two_cores"], "", "≥ 0.9")


def _load(found):
    yield Figure("whole live system with recorder", found["cores"], "cores", "≤ 1.2")
    yield from _memory(found["pss_mb"])


def _exchange(found):
    for one in found["cases"]:
        felt = one["stiffness"] if one["passive"] else None
        yield Figure(f"stiffness felt, {one['method']}, {1e3 * one['delay']:g} ms", felt, "N/m")


def _hard_cases(found):
    tried = [one for one in found["verdicts"] if one["world"] == default_method(one["scene"]) and one["tried"]]
    if tried:
        survived, of = sum(one["survives"] for one in tried), len(tried)
        overlap, created = (_worst(one[name] for one in tried) for name in ("overlap_m", "created"))
        yield Figure("hard cases survived by the method chosen", survived, f"of {of}", "all")
        yield Figure("deepest overlap of these", overlap and 1e6 * overlap, "µm", f"≤ {1e6 * OVERLAP:g} µm")
        share, limit = created and 100.0 * created, 100.0 * CREATED
        yield Figure("energy created in these, of the largest energy", share, "%", f"≤ {limit:g} %")


def _worst(values):
    """None if one of them blew up."""
    values = list(values)
    return None if None in values else max(values)


def _speed_error(found):
    runs = [Run(**one) for one in found["runs"]]
    ours = [one for one in runs if one.counts and one.method in OURS]
    if ours:
        least = [min(one.error for one in of_scene) for of_scene in by_scene(ours).values()]
        yield Figure(f"least error, worst of {len(least)} scenes", 100.0 * max(least), "% of the distance moved")
    for kind, peer, ratio, wanted, _, _ in summary(runs):
        yield Figure(f"least speed ratio at equal error, {kind}, to {peer}", ratio, "×", f"≥ {wanted:g}")


_ALL = _start, _servo, _link, _round_trip, _load, _costs, _exchange, _hard_cases, _speed_error
READERS = {reader.__name__[1:]: reader for reader in _ALL}
