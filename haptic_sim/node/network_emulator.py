# SPDX-License-Identifier: Apache-2.0
"""haptic_relay: a bad network between driver and simulation, to see what an exchange method makes of it.

`handle` goes out on `far_handle`, `far_tool` comes in on `tool`, `far_local_contacts` on `local_contacts`, each message
on its own way: delayed, lost, doubled and overtaken by others. The simulation is started with its topics renamed so.
"""

if __name__ == "__main__":  # before the imports, which take seconds
    from haptic_device.process import start

    raise SystemExit(start(__spec__.name))

import heapq
import itertools
import random
import threading
import time

from rclpy.impl.implementation_singleton import rclpy_implementation

from haptic_device.nodes.lifecycle import ManagedNode, run
from haptic_device.nodes.messages import LATEST, STREAM, JointState, PointCloud2
from haptic_device.nodes.polled_subscription import PolledSubscription
from haptic_device.realtime.scheduling import go_realtime, lift_interpreter, put_back
from haptic_sim.node.parameters import NODES

LONGEST_WAIT_NS = 20_000_000
PRIORITY = 62


class Way:
    """One direction: what comes on one topic leaves on another when its time has come."""

    def __init__(self, node, source, target, kind, values, seed):
        self._node, message = node, f"sensor_msgs/msg/{kind.__name__}"
        self.subscription = PolledSubscription(node, source, message, STREAM, raw=True)
        self._publisher = node.create_publisher(kind, target, LATEST)
        self._values, self._random, self._number, self._flying = values, random.Random(seed), itertools.count(), []

    @property
    def next_ns(self):
        """When the next message leaves [ns of CLOCK_MONOTONIC]."""
        return self._flying[0][0] if self._flying else 1 << 62

    def carry(self, now_ns):
        """Takes what has come, sends what is due."""
        for sample in self.subscription.take():
            if self._random.random() >= self._values["loss"]:
                for _ in range(1 + (self._random.random() < self._values["duplicates"])):
                    heapq.heappush(self._flying, (now_ns + self._flight_ns(), next(self._number), sample.message))
        while self.next_ns <= now_ns:
            self._publisher.publish(heapq.heappop(self._flying)[2])

    def close(self):
        """Ends both; what is on its way is lost."""
        self.subscription.close()
        self._node.destroy_publisher(self._publisher)

    def _flight_ns(self):
        spread = self._values["jitter"] * (2.0 * self._random.random() - 1.0)
        return max(0, round(0.5e9 * (self._values["delay"] + spread)))


class NetworkEmulator(ManagedNode):
    """Active it carries messages, in a thread of its own."""

    def __init__(self):
        super().__init__("haptic_relay", NODES["haptic_relay"])
        self._stop, self._thread, self._ways = threading.Event(), None, []
        self._lifted: list[int] = []

    def configure(self):
        """Both ways."""
        ways = (
            ("handle", "far_handle", JointState),
            ("far_tool", "tool", JointState),
            ("far_local_contacts", "local_contacts", PointCloud2),
        )
        self._ways = [Way(self, *way, self.values, self.values["seed"] + i) for i, way in enumerate(ways)]

    def activate(self):
        """Begins to carry."""
        self._thread = threading.Thread(target=self._run, name="relay")
        self._thread.start()
        self.get_logger().info(f"carrying between driver and simulation in {self.get_namespace()}")

    def deactivate(self):
        """Carries no more; what is on its way is lost."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
        self._stop.clear()
        self._thread = None
        put_back(self._lifted)
        self._lifted = []

    def cleanup(self):
        """Ends both ways."""
        for way in self._ways:
            way.close()
        self._ways = []

    def _run(self):
        go_realtime("prefer", PRIORITY)
        self._lifted = lift_interpreter("prefer")
        wait_set = rclpy_implementation.WaitSet(3, 0, 0, 0, 0, 0, self.context.handle)
        while not self._stop.is_set():
            now = time.monotonic_ns()
            for way in self._ways:
                way.carry(now)
            wait_set.clear_entities()
            for way in self._ways:
                wait_set.add_subscription(way.subscription.handle)
            due = min(way.next_ns for way in self._ways)
            wait_set.wait(min(LONGEST_WAIT_NS, max(0, due - time.monotonic_ns())))


def main(args: list[str] | None = None) -> int:
    """Runs haptic_relay until SIGINT, SIGTERM or SIGHUP. Exit code 1 on a refusal."""
    return run(NetworkEmulator, "haptic_relay", args)
