# SPDX-License-Identifier: Apache-2.0
"""haptic_recorder: every topic of the system, as it came, into a rosbag2 folder."""

import signal
import sys
import time
from pathlib import Path

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import Node, State, TransitionCallbackReturn
from rclpy.qos import QoSProfile, ReliabilityPolicy

from haptic_device.node.bag import Bag
from haptic_device.node.lifecycle import begin_ros
from haptic_device.node.params import declare
from haptic_device.node.recorder_parameters import PARAMETERS
from haptic_device.node.tap import Sample, Tap
from haptic_device.node.track import Track, joining_qos, offered_qos
from haptic_device.node.wire import TRACE, DiagnosticArray, diagnostics

_JOINTS = "sensor_msgs/msg/JointState"
KNOWN = {  # joined before their publishers exist, so that no first message is missed
    "encoder": _JOINTS,
    "motor": _JOINTS,
    "handle": _JOINTS,
    "tool": _JOINTS,
    "operator/state": _JOINTS,
    "operator/target": _JOINTS,
    "trace": "sensor_msgs/msg/PointCloud2",
    "wrench": "geometry_msgs/msg/WrenchStamped",
    "pose": "geometry_msgs/msg/PoseStamped",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
_DISCOVERY_PERIOD = 0.5  # s
_DIAGNOSTICS_PERIOD = 0.5  # s
_SECOND = 1_000_000_000


class Recorder(Node):
    """Lifecycle node: configured it listens, active it writes; every activation is a bag of its own."""

    def __init__(self):
        super().__init__("haptic_recorder", namespace="/haptic")
        self.parameters = declare(self, PARAMETERS)
        self.tracks: dict[str, Track] = {}
        self.bag: Bag | None = None
        self._unknown: set[str] = set()
        self._next_discovery = self._next_flush = 0
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_timer(_DIAGNOSTICS_PERIOD, self._report)

    def on_configure(self, state: State) -> TransitionCallbackReturn:
        """Joins the known topics."""
        for topic, type_name in KNOWN.items():
            reliability = TRACE.reliability if topic == "trace" else ReliabilityPolicy.BEST_EFFORT
            self._join(topic, type_name, QoSProfile(depth=self.parameters["queue"], reliability=reliability))
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: State) -> TransitionCallbackReturn:
        """Opens a new bag; refuses a folder that holds something."""
        try:
            self.bag = Bag(self._folder())
        except (ValueError, OSError) as error:
            self.get_logger().error(f"cannot record: {error}")
            return TransitionCallbackReturn.FAILURE
        self.get_logger().info(f"recording to {self.bag.folder}")
        return super().on_activate(state)

    def on_deactivate(self, state: State) -> TransitionCallbackReturn:
        """Writes what has come and closes the bag."""
        self.finish()
        return super().on_deactivate(state)

    def on_cleanup(self, state: State) -> TransitionCallbackReturn:
        """Leaves all topics."""
        for track in self.tracks.values():
            track.tap.close()
        self.tracks.clear()
        return TransitionCallbackReturn.SUCCESS

    def look(self) -> None:
        """Takes what has come since the last look; to be called every `look_period`."""
        if self.tracks and time.monotonic_ns() >= self._next_discovery:
            self._next_discovery = time.monotonic_ns() + int(_DISCOVERY_PERIOD * _SECOND)
            self._discover()
        for track in self.tracks.values():
            self._take(track)
        if self.bag and time.monotonic_ns() >= self._next_flush:
            self._next_flush = time.monotonic_ns() + int(self.parameters["flush_period"] * _SECOND)
            self.bag.flush()

    def finish(self) -> None:
        """Closes the bag, if one is open, with everything that has arrived."""
        if self.bag is None:
            return
        for track in self.tracks.values():
            self._take(track)
        bag, self.bag = self.bag, None
        bag.close({"namespace": self.get_namespace(), **self._losses()})
        for track in self.tracks.values():
            track.restart()
        self.get_logger().info(f"{bag.messages} messages in {bag.folder}")

    def _losses(self) -> dict[str, str]:
        return {f"lost {topic}": track.losses for topic, track in self.tracks.items() if track.channel}

    def _report(self) -> None:
        level = "warn" if any(track.lost and track.publishers <= 1 for track in self.tracks.values()) else "ok"
        state = f"recording to {self.bag.folder}" if self.bag else "not recording"
        values = {"messages": self.bag.messages if self.bag else 0, **self._losses()}
        now = self.get_clock().now().nanoseconds
        self._diagnostics.publish(diagnostics(now, self.get_name(), "", level, state, values))

    def _folder(self) -> Path:
        return Path(self.parameters["bag"] or time.strftime("haptic_bags/%Y%m%d-%H%M%S")).absolute()

    def _join(self, topic: str, type_name: str, qos: QoSProfile) -> None:
        tap = Tap(self, topic, type_name, qos, raw=True)
        self.tracks[tap.topic] = Track(tap)

    def _discover(self) -> None:
        prefix = self.get_namespace().rstrip("/") + "/"
        for topic, type_names in self.get_topic_names_and_types():
            if not topic.startswith(prefix) and topic not in self.tracks:
                continue
            publishers = self.get_publishers_info_by_topic(topic)
            if topic in self.tracks:
                self.tracks[topic].publishers = max(self.tracks[topic].publishers, len(publishers))
            elif publishers and topic not in self._unknown:
                self._join_discovered(topic, type_names[0], publishers)

    def _join_discovered(self, topic: str, type_name: str, publishers: list) -> None:
        try:
            self._join(topic, type_name, joining_qos(publishers, self.parameters["queue"]))
        except (ImportError, AttributeError, ValueError) as error:
            self._unknown.add(topic)
            self.get_logger().warning(f"topic {topic} is not recorded: its type {type_name} is not installed ({error})")

    def _take(self, track: Track) -> None:
        for sample in track.tap.take():
            if self.bag is None or track.tap.topic in self._unknown:
                continue
            track.channel = track.channel or self._channel(track)
            if track.channel:
                self._write(track, sample)

    def _write(self, track: Track, sample: Sample) -> None:
        track.count(sample.sequence)
        self.bag.write(track.channel, sample.message, sample.received, sample.published, sample.sequence)

    def _channel(self, track: Track) -> int:
        offered = offered_qos(self.get_publishers_info_by_topic(track.tap.topic))
        try:
            return self.bag.add_topic(track.tap.topic, track.tap.type_name, offered)
        except ValueError as error:
            self._unknown.add(track.tap.topic)
            self.get_logger().warning(f"{error}; it is not recorded")
            return 0


def _record_until_told(node: Recorder, told: list) -> None:
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    if node.parameters["autostart"]:
        node.trigger_configure()
        if node.trigger_activate() != TransitionCallbackReturn.SUCCESS:
            raise ValueError("haptic_recorder could not start recording; the reason stands above")
    while not told:
        node.look()
        executor.spin_once(timeout_sec=node.parameters["look_period"])


def main(args: list[str] | None = None) -> int:
    """Runs haptic_recorder until SIGINT or SIGTERM; the bag is complete when it returns. Exit code 1 on a refusal."""
    told: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda received, frame: told.append(received))
    try:
        begin_ros(args)
        node = Recorder()
        _record_until_told(node, told)
        node.finish()
    except (ValueError, OSError) as error:
        print(f"haptic_recorder: {error}", file=sys.stderr)
        return 1
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
