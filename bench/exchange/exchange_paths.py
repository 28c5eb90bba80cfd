# SPDX-License-Identifier: Apache-2.0
"""Round trip of the exchange on live nodes, by the loop on librcl and by rclpy, alone and beside a busy Python thread."""

import statistics
import sys
import tempfile
import threading
from pathlib import Path
from typing import Annotated

import typer

from bench.exchange import live_round_trip
from haptic_device.process import running_module
from haptic_sim.cli.domain import isolated_domain
from haptic_sim.cli.processes import Program

PATHS, BUSY = ("rcl", "rclpy"), (False, True)


def main(
    turns: Annotated[int, typer.Argument(min=1)] = 3,
    seconds: Annotated[float, typer.Argument(min=0.1, help="Of each turn.")] = 5.0,
) -> None:
    """Round trip of the exchange by librcl and by rclpy, alone and beside a busy Python thread of the driver."""
    found = {}
    with tempfile.TemporaryDirectory() as folder, isolated_domain(Path(folder)) as domain:
        simulation = Program("haptic_simulation", "haptic_sim.node.simulation", {"scene": "free_space"})
        for _ in range(turns):
            for busy in BUSY:
                for path in PATHS:
                    kind, given = Busy if busy else Program, {"auto_enable": True, "exchange.path": path}
                    driver = kind("haptic_driver", "haptic_device.nodes.driver", given)
                    try:
                        one = live_round_trip.measure(domain, simulation, seconds, driver)
                    except ValueError as error:  # it never came so far
                        print(f"{path}{' beside a busy thread' * busy}: {error}", flush=True)
                        continue
                    found.setdefault((busy, path), []).append(one)
    for (busy, path), runs in found.items():
        p50, p99, young = (statistics.median(column) for column in zip(*runs, strict=True))
        beside = "beside a busy thread" if busy else "alone"
        print(f"{path:6} {beside:21} p50 {p50:6.1f} us, p99 {p99:7.1f} us; ticks with a tool under 3 ms {young:.2%}")


class Busy(Program):
    """A driver in whose process another Python thread never rests."""

    def command(self):
        words = super().command()
        return [*running_module("bench.exchange.exchange_paths"), *words[words.index("--ros-args") :]]


if __name__ == "__main__":  # the driver's process
    from haptic_device.nodes import driver

    def work():
        while True:
            sum(range(1000))

    threading.Thread(target=work, daemon=True).start()
    sys.exit(driver.main())
