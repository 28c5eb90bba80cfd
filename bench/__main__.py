# SPDX-License-Identifier: Apache-2.0
"""`python -m bench`: lists the measurements; `python -m bench NAME …` runs one, `--help` says what it takes."""

import importlib
import sys

import typer

from haptic_sim.cli.main import ending_in_a_sentence

COMMANDS = {  # name: (module with a `main`, what it measures)
    "all": ("bench.all", "the short or the full form of nine of these into a folder, and the one table made of it"),
    "by_default": ("bench.methods.by_default", "every scene with its default method, turned and shifted"),
    "chosen": ("bench.methods.chosen", "every method that a shipped scene could have, against its reference"),
    "cold_starts": ("bench.servo.cold_starts", "demos with an empty cache, and one told to end while it compiles"),
    "costs": ("bench.servo.costs", "what a tick, an exchange, a sub-step and a cell cost, and how each grows"),
    "crash_table": ("bench.recording.crash_table", "what a recorder that is killed loses, and its bags repaired"),
    "estop_beside_load": ("bench.pages.estop_beside_load", "how long an e-stop waits beside requests and messages"),
    "exchange": ("bench.exchange.exchange", "exchange methods against delay, jitter, loss and rate; --round-trip"),
    "exchange_reference": ("bench.exchange.exchange_reference", "how a late tool follows, and a cut in contact"),
    "exchange_tick": ("bench.exchange.exchange_tick", "what the exchange methods add to a tick's own work"),
    "figure_insertion": ("bench.methods.figure_insertion", "draws docs/methods/insertion.png"),
    "figure_orders": ("bench.methods.figure_orders", "draws docs/methods/orders.png"),
    "figure_report": ("bench.pages.figure_report", "a report's page as a Chromium draws it, docs/figures/report.png"),
    "figure_viewer": ("bench.pages.figure_viewer", "the viewer's page as `make test-browser` photographed it"),
    "figures_model": ("bench.pages.figures_model", "draws the figures of docs/model.md and docs/cli.md"),
    "figures_passivity": ("bench.theory.figures_passivity", "draws the figures of docs/passivity.md"),
    "figures_zwidth": ("bench.theory.figures_zwidth", "draws the figures of docs/zwidth.md"),
    "first_start": ("bench.methods.first_start", "what the first step of each compiled method costs"),
    "flame_graphs": ("bench.servo.flame_graphs", "flame graphs of the three nodes at 1 kHz exchange, as SVG"),
    "gravel": ("bench.methods.gravel", "writes config/scenes/gravel.yaml again"),
    "growth": ("bench.methods.growth", "an exchange with 10 to 300 bodies, ours and the peers'"),
    "hard_cases": ("bench.methods.hard_cases", "which method and which peer survives which hard scene"),
    "hashes": ("bench.methods.hashes", "hashes of every scene by each method, to compare two commits by"),
    "impulse_bounds": ("bench.methods.impulse_bounds", "what `impulse` carries: towers of blocks, light tools"),
    "inner_steps": ("bench.methods.inner_steps", "error against cost of the steps inside a sub-step of `impulse`"),
    "late_forces": ("bench.exchange.late_forces", "what a late force costs: stiffness, drag and age at each delay"),
    "late_ticks": ("bench.exchange.late_ticks", "energy given where ticks are missed"),
    "live_against_lockstep": ("bench.exchange.live_against_lockstep", "a recorded demo played again in lock-step"),
    "live_cancellation": ("bench.servo.live_cancellation", "what cancelled damping leaves to feel, live"),
    "live_round_trip": ("bench.exchange.live_round_trip", "round trip beside a bare ping-pong; --profile: its stages"),
    "load": ("bench.servo.load", "processor and memory of the whole live system, node by node"),
    "local": ("bench.exchange.local", "what the tool in the servo is worth: stiffness, drag and mass, Fig. 5, tasks"),
    "local_tick": ("bench.exchange.local_tick", "work of a servo tick with the tool in it"),
    "long_bag": ("bench.recording.long_bag", "a bag of many minutes, and what its report costs"),
    "recorder_restart": ("bench.recording.recorder_restart", "how soon a new recorder hears the servo"),
    "recording_losses": ("bench.recording.recording_losses", "what a recorder loses and costs, in pairs of runs"),
    "reduction": ("bench.methods.reduction", "the wall in closed form against the general method"),
    "reference": ("bench.methods.converged", "the stored references made again"),
    "servo": ("bench.servo.servo", "how late the servo wakes, beside cyclictest"),
    "speed_error": ("bench.methods.speed_error", "wall time against error of every method and peer on every scene"),
    "start": ("bench.servo.start", "the very first start and the next ones"),
    "step_profile": ("bench.methods.step_profile", "what a step goes into, piece by piece"),
    "theory": ("bench.theory.theory", "the passivity condition against closed forms, tables, the μ test"),
    "viewer_disturbs": ("bench.pages.viewer_disturbs", "what the servo notices of a viewer"),
    "zwidth_boundary": ("bench.theory.zwidth_boundary", "where walls begin to shake in lock-step, against eigenvalues"),
    "zwidth_growth": ("bench.theory.zwidth_growth", "how the stiffest wall grows with the servo rate, live"),
    "zwidth_speed": ("bench.theory.zwidth_speed", "core time of the Z-width map, and what two threads bring"),
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
    command(words, prog_name=f"python -m bench {name}")


if __name__ == "__main__":
    main()
