# SPDX-License-Identifier: Apache-2.0
"""`python -m bench`: lists the measurements; `python -m bench NAME …` runs one, `--help` says what it takes."""

import importlib
import sys

import typer

from haptic_display.cli.main import ending_in_a_sentence
from haptic_display.run.processes import NodeDiedError, interruptible

COMMANDS = {  # name: (module with a `main`, what it measures)
    "all": ("bench.all", "the short or the full form of nine of these into a folder, and the one table made of it"),
    "chosen": ("bench.methods.chosen", "every method that a shipped scene could have, against its reference"),
    "costs": ("bench.servo.costs", "what a tick, an exchange, a sub-step and a cell cost, and how each grows"),
    "exchange": ("bench.exchange.exchange", "exchange methods against delay, jitter, loss and rate"),
    "figures": (
        "bench.figures",
        "draws the pictures of the theory pages and of zwidth.md, and keeps those of the page",
    ),
    "hard_cases": ("bench.methods.hard_cases", "which method and which peer survives which hard scene"),
    "hashes": ("bench.methods.hashes", "hashes of every scene by each method, to compare two commits by"),
    "houses": ("bench.houses", "the rooms of the three packages and who imports whom, for architecture.md"),
    "link": ("bench.servo.link", "a device on a line: its sample in hand beside a bare pair in C, and its clock"),
    "load": ("bench.servo.load", "processor and memory of the whole live system, node by node"),
    "local": ("bench.exchange.local", "what the tool in the servo is worth: stiffness, drag and mass, Fig. 5, tasks"),
    "published": ("bench.published.table", "results of others beside ours, each within its tolerance"),
    "reference": ("bench.methods.converged", "the stored references made again"),
    "round_trip": ("bench.exchange.round_trip", "handle, tool and back on live nodes, beside a bare ping-pong"),
    "servo": ("bench.servo.servo", "how late the servo wakes, beside cyclictest"),
    "speed_error": ("bench.methods.speed_error", "wall time against error of every method and peer on every scene"),
    "start": ("bench.servo.start", "the very first start and the next ones"),
    "theory": ("bench.theory", "the passivity condition against closed forms, the μ test, and where walls shake"),
    "walks": ("bench.walks", "through which files a wall goes to the motor, and a contact to the hand"),
}


def main() -> None:
    """Entry point."""
    with ending_in_a_sentence("bench"):
        _run(*sys.argv[1:] or ["--help"])


def _run(name, *words):
    if name == "--help":
        print(*(f"{each:22} {what}" for each, (_, what) in COMMANDS.items()), sep="\n")
        return
    if name not in COMMANDS:
        raise ValueError(f"measurement is {name!r}; it must be one of {', '.join(COMMANDS)}")
    command = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    command.command()(importlib.import_module(COMMANDS[name][0]).main)
    with interruptible():
        try:
            command(words, prog_name=f"python -m bench {name}")
        except NodeDiedError as error:  # a node that ends by itself ends the command as any refusal does
            raise ValueError(str(error)) from None


if __name__ == "__main__":
    main()
