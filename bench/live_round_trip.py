# SPDX-License-Identifier: Apache-2.0
"""Round trip of the exchange on live nodes against a bare ping-pong by the same receive path, in turns.

usage: python bench/live_round_trip.py [turns [seconds]]

Both are what the driver's exchange measures at 1 kHz in free space, from composing a handle sample to its answer. The
bare answerer waits for bytes as the simulation does, and sends them back with the few numbers that make them an answer.
"""

import contextlib
import statistics
import struct
import sys
import tempfile
from pathlib import Path

from haptic_device.law import exchange
from haptic_sim.cli.domain import isolated_domain
from haptic_sim.cli.processes import Nodes, Program

AXES = 3


def answer_barely():
    """The other process of the ping-pong; until SIGTERM."""
    import rclpy
    from rclpy.impl.implementation_singleton import rclpy_implementation

    from haptic_device.node.tap import Untouched
    from haptic_device.node.wire import LATEST, JointLayout, JointState, exchange_names
    from haptic_device.runtime.clock import go_realtime

    rclpy.init()
    node = rclpy.create_node("haptic_simulation", namespace="/haptic")
    publisher = node.create_publisher(JointState, "tool", LATEST)
    subscription = node.create_subscription(
        JointState, "handle", lambda data: None, LATEST, raw=True, callback_group=Untouched()
    )
    layout = JointLayout(exchange_names(AXES))
    place = {entry: layout.offsets[0] + 8 * (AXES + entry) for entry in range(len(exchange.TAIL))}
    go_realtime("prefer", 60)
    wait_set, number = rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, node.context.handle), 0.0
    while True:
        wait_set.clear_entities()
        wait_set.add_subscription(subscription.handle)
        wait_set.wait(50_000_000)
        latest = None
        while (taken := subscription.handle.take_message(JointState, True)) is not None:
            latest = taken[0]
        if latest is None:
            continue
        data, number = bytearray(latest), number + 1.0
        asked = struct.unpack_from("<dd", data, place[exchange.SESSION])
        struct.pack_into("<dddd", data, place[exchange.SESSION], 4711.0, number, *asked)
        publisher.publish(bytes(data))


def measure(domain, answerer, seconds):
    """Round trip p50 and p99 [us], and p99.9 of the tool sample's age [ms], with this answerer."""
    from haptic_sim.cli.tuning import Tuning

    with tempfile.TemporaryDirectory() as logs, Nodes(Path(logs)) as nodes:
        circle = {"motion.name": "circle", "motion.start": (0.0, 0.0, 0.0), "motion.duration": 60.0}
        nodes.start(Program("haptic_loopback", "haptic_device.node.loopback", circle))
        nodes.start(answerer)
        nodes.start(Program("haptic_driver", "haptic_device.node.driver", {"auto_enable": True}))
        with contextlib.closing(Tuning(domain, "/haptic")) as tuning:
            tuning.wait_engaged(nodes.check)
            tuning.watch(seconds)
            return tuple(float(tuning.said(f"{name}")) for name in
                         ("round_trip_us_p50", "round_trip_us_p99", "age_ms_p999"))  # fmt: skip


def main():
    turns = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 5.0
    answerers = {
        "simulation": Program("haptic_simulation", "haptic_sim.node.simulation", {"scene": "free_space"}),
        "bare": Bare("haptic_simulation", "bare"),
    }
    found = {name: [] for name in answerers}
    with tempfile.TemporaryDirectory() as folder, isolated_domain(Path(folder)) as domain:
        for turn in range(turns):
            for name, answerer in answerers.items():
                found[name].append(measure(domain, answerer, seconds))
                p50, p99, age = found[name][-1]
                print(
                    f"{turn} {name:10} round trip {p50:6.1f} us, p99 {p99:7.1f} us; age p99.9 {age:.3f} ms", flush=True
                )
    ratio = statistics.median(one[0] / other[0] for one, other in zip(*found.values(), strict=True))
    print(f"median ratio of {turns} turns: {ratio:.3f}")


class Bare(Program):
    """The bare answerer as a program."""

    def command(self):
        return [sys.executable, __file__, "answer"]


if __name__ == "__main__":
    answer_barely() if sys.argv[1:] == ["answer"] else main()
