# SPDX-License-Identifier: Apache-2.0
"""Results of all benchmarks in one folder: machine facts, one file each, and the figures that the table shows."""

import json
from pathlib import Path
from typing import NamedTuple

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
    found = []
    for name, read in READERS.items():
        if (content := _content(folder, name)) is not None:
            found += read(content)
    return found


def markdown(folder: Path) -> str:
    """The one table, with the machine above it."""
    facts = _content(folder, MACHINE.removesuffix(".json"))
    machine, program = facts["machine"], facts["program"]
    head = (
        f"{machine['cores']} cores of {machine['processor']}, {machine['system'].split('-with')[0]}; "
        f"Python {program['python']}, numba {facts['packages']['numba']}; {facts['length']} run."
    )
    lines = [head, "", "| figure | measured | wanted |", "| --- | --- | --- |"]
    lines += [f"| {one.name} | {shown(one.value)} {one.unit} | {one.wanted} |" for one in figures(folder)]
    return "\n".join(lines)


def shown(value: float | None) -> str:
    """Three digits, or a dash for what could not be had."""
    return "–" if value is None else f"{value:.3g}"


def _content(folder, name):
    file = folder / f"{name}.json"
    return json.loads(file.read_text(encoding="utf-8")) if file.exists() else None


def _start(found):
    again = [max(one.values()) for one in found["again"]]
    return [
        Figure("very first start, all nodes at work", max(found["first"].values()), "s", "≤ 20 s"),
        Figure("later start", sorted(again)[len(again) // 2], "s", "≤ 3 s"),
        *(
            Figure(f"memory of {name} (PSS), very first start", value, "MB", "≤ 200 MB")
            for name, value in found.get("first_pss_mb", {}).items()
        ),
    ]


def _servo(found):
    lines = []
    for one in found["lateness"]:
        fifo = _fifo(one)
        where = f"{one['rate']:g} Hz, {fifo}, {one['load']}"
        limit = "≤ 2" if fifo == "FIFO" and one["load"] == "alone" else ""
        lines.append(Figure(f"lateness p99, {where}", one["p99"], "µs"))
        lines.append(Figure(f"lateness p99 to cyclictest's, {where}", one["p99_ratio"], "×", limit))
        if one["load"] == "demo":
            missed = 100.0 * one["missed"] / max(1.0, one["ticks"])
            lines.append(Figure(f"missed ticks, {where}", missed, "%", "≤ 0.01 % beyond cyclictest's"))
    return lines


def _fifo(case):
    """What it had, not what it preferred."""
    if case["realtime"] != "prefer":
        return "no FIFO"
    return "FIFO refused" if "no SCHED_FIFO" in case["scheduling"] else "FIFO"


def _round_trip(found):
    lines = []
    for one in found:
        where = f"{one['rate']:g} Hz, {one['answerer']}"
        lines.append(Figure(f"round trip p50, {where}", one["p50_us"], "µs"))
        if one["answerer"] == "simulation":
            lines.append(Figure(f"round trip p50 to the bare one's, {one['rate']:g} Hz", one["ratio"], "×", "≤ 1.35"))
            cores = sum(one[f"{node}_cores"] for node in ("loopback", "simulation", "driver"))
            lines.append(Figure(f"device, simulation and driver, {where}", cores, "cores"))
    return lines


def _costs(found):
    lines = [Figure(f"{one['what']}: one more {one['grows_with']}", one["slope"], "µs") for one in found["costs"]]
    cell = next(one for one in found["costs"] if one["grows_with"] == "cell")
    for one in found["ports"]:
        what = f"an exchange of {one['scene']}, {one['method']}"
        lines.append(Figure(f"{what}: behind pspm to direct", one["pspm"] / one["direct"], "×", "≤ 1.2"))
        if one["bare"]:
            lines.append(Figure(f"{what}: to its bare steps", one["direct"] / one["bare"], "×", "≤ 2.2"))
    return [
        *lines,
        Figure("map off a straight line by at most", 100.0 * cell["apart"], "%", "≤ 10 %"),
        Figure("two cores on a map, efficiency", found["two_cores"], "", "≥ 0.9"),
    ]


def _demo(found):
    return [
        Figure("whole live system with recorder", found["cores"], "cores", "≤ 1.2"),
        *(Figure(f"memory of {name} (PSS)", value, "MB", "≤ 200 MB") for name, value in found["pss_mb"].items()),
    ]


def _exchange(found):
    return [
        Figure(
            f"stiffness felt, {one['method']}, {1e3 * one['delay']:g} ms",
            one["stiffness"] if one.get("passive", True) else None,
            "N/m",
        )
        for one in found["cases"]
    ]


def _hard_cases(found):
    from bench.methods.hard import CREATED, OVERLAP
    from bench.methods.table import default_method

    tried = [one for one in found["verdicts"] if one["world"] == default_method(one["scene"]) and one["tried"]]
    if not tried:
        return []
    survived = sum(one["survives"] for one in tried)
    return [
        Figure("hard cases survived by the method chosen", survived, f"of {len(tried)}", "all"),
        Figure("deepest overlap of these", _worst(tried, "overlap_m", 1e6), "µm", f"≤ {1e6 * OVERLAP:g} µm"),
        Figure(
            "energy created in these, of the largest about",
            _worst(tried, "created", 100.0),
            "%",
            f"≤ {100.0 * CREATED:g} %",
        ),
    ]


def _worst(entries, name, scale):
    """None if one of them blew up."""
    values = [one[name] for one in entries]
    return None if None in values else scale * max(values)


def _speed_error(found):
    from bench.methods.compare import OURS
    from bench.methods.measure import Run
    from bench.methods.table import scenes_of, summary

    runs = [Run(**one) for one in found["runs"]]
    ours = [one for one in runs if one.counts and one.method in OURS]
    least = [min(one.error for one in ours if one.scene == scene) for scene in scenes_of(ours)]
    lines = [Figure(f"least error, worst of {len(least)} scenes", 100.0 * max(least), "% of the way")] if least else []
    return lines + [
        Figure(f"least speed ratio at equal error, {kind}, to {peer}", ratio, "×", f"≥ {wanted:g}")
        for kind, peer, ratio, wanted, _, _ in summary(runs)
    ]


READERS = {
    "start": _start,
    "servo": _servo,
    "round_trip": _round_trip,
    "load": _demo,
    "costs": _costs,
    "exchange": _exchange,
    "hard_cases": _hard_cases,
    "speed_error": _speed_error,
}
