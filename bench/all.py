# SPDX-License-Identifier: Apache-2.0
"""Nine of the measurements into a folder, and the one table made of it."""

import json
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from bench import results
from bench.jobs import listed
from bench.results import MACHINE
from haptic_device.process import ending_with_us, own_environment, running_module
from haptic_device.recording.provenance import facts

MARKS = "<!-- benchmarks: python -m bench all -->", "<!-- end of benchmarks -->"
BENCHMARKS = {  # name: words for a short run, for a full one
    "start": (("--again", "1"), ()),
    "servo": (("--seconds", "0.5", "--turns", "3"), ("--seconds", "5")),
    "link": (("--rate", "1000", "--turns", "3"), ("--seconds", "5")),
    "costs": ((), ()),
    "load": (("--seconds", "3"), ()),
    "round_trip": (("--rate", "1000"), ()),
    "exchange": (("--delay", "0", "--delay", "20"), ()),
    "hard_cases": (("--short", "--methods", "impulse,partitioned"), ()),
    "speed_error": (("--short", "--scenes", "wall", "--methods", "closed_form"), ()),
}
_OUT = "Folder of results; what is there already is not measured again."
_ONLY = f"Comma-separated benchmarks of {', '.join(BENCHMARKS)} [all]."
_INSERT = f"Put the table between the marks {MARKS[0]} of this file; may be repeated."


def main(
    out: Annotated[Path, typer.Option(help=_OUT)] = Path("bench_results"),
    short: Annotated[bool, typer.Option("--short", help="Some minutes, for a first look, instead of hours.")] = False,
    only: Annotated[str | None, typer.Option(help=_ONLY)] = None,
    insert: Annotated[list[Path] | None, typer.Option(help=_INSERT)] = None,
) -> None:
    """Nine measurements into a folder with the machine's facts, JSON each, and one table of them."""
    measure(out, short, listed(only, BENCHMARKS, "benchmark"))
    table = results.markdown(out)
    (out / "table.md").write_text(table + "\n", encoding="utf-8")
    for file in insert or ():
        put(table, file)
    typer.echo(table)


def measure(out: Path, short: bool, names: Iterable[str]) -> None:
    """Runs the benchmarks that the folder lacks; one that fails is said and left out.

    Raises ValueError if it lacks some of a run of another length.
    """
    out.mkdir(parents=True, exist_ok=True)
    length = "short" if short else "full"
    if not (out / MACHINE).exists():
        (out / MACHINE).write_text(json.dumps(facts() | {"length": length}), encoding="utf-8")
    known = json.loads((out / MACHINE).read_text(encoding="utf-8"))["length"]
    missing = [name for name in names if not (out / f"{name}.json").exists()]
    if missing and known != length:
        raise ValueError(f"folder {out} has a {known} run; a {length} one needs a folder of its own")
    for name in missing:
        file, words = out / f"{name}.json", BENCHMARKS[name][0 if short else 1]
        print(f"python -m bench {name}", file=sys.stderr, flush=True)
        command = [*running_module("bench"), name, *words, "--json"]
        done = subprocess.run(ending_with_us(command), stdout=subprocess.PIPE, text=True, env=own_environment())
        if done.returncode == 0:
            file.write_text(done.stdout.strip().splitlines()[-1] + "\n", encoding="utf-8")
        else:
            print(f"bench: {name} came to nothing (exit code {done.returncode})", file=sys.stderr)


def put(table: str, file: Path) -> None:
    """Replaces what stands between the marks. Raises ValueError, one sentence, where there are none."""
    above, _, rest = file.read_text(encoding="utf-8").partition(MARKS[0])
    _, last, below = rest.partition(MARKS[1])
    if not last:
        raise ValueError(f"{file} has no marks {MARKS[0]} … {MARKS[1]} to put the table between")
    file.write_text(f"{above}{MARKS[0]}\n{table}\n{MARKS[1]}{below}", encoding="utf-8")
