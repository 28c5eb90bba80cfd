# SPDX-License-Identifier: Apache-2.0
"""haptic_recorder: every topic of the system, as it came, into a rosbag2 folder."""

import shutil
import sys
import time
from itertools import islice
from pathlib import Path

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import Node, State, TransitionCallbackReturn
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_srvs.srv import Trigger

from haptic_device import provenance
from haptic_device.nodes.bag_attachments import YAML, files_of, parameter_file, trial_of
from haptic_device.nodes.lifecycle import begin_ros, hear_the_end
from haptic_device.nodes.messages import STATE, TRACE, DiagnosticArray, String, diagnostics
from haptic_device.nodes.parameter_client import ParameterClient
from haptic_device.nodes.participant_id import own_participant_id
from haptic_device.nodes.polled_subscription import PolledSubscription, Sample
from haptic_device.nodes.recorded_topic import Track, joining_qos, offered_qos
from haptic_device.nodes.recorder_parameters import PARAMETERS
from haptic_device.nodes.ros_parameters import declare, on_change
from haptic_device.realtime import scheduling
from haptic_device.recording.layouts import CLOUD, JOINTS, POSE, STRING, WRENCH
from haptic_device.recording.layouts import DIAGNOSTICS as STATUSES
from haptic_device.recording.metadata import dump
from haptic_device.recording.writer import RESERVE_BYTES, Bag

KNOWN = {  # joined before their publishers exist, so that no first message is missed
    "encoder": JOINTS,
    "motor": JOINTS,
    "handle": JOINTS,
    "tool": JOINTS,
    "local_contacts": CLOUD,
    "operator/state": JOINTS,
    "operator/target": JOINTS,
    "trace": CLOUD,
    "snapshot": CLOUD,
    "mark": STRING,
    "wrench": WRENCH,
    "pose": POSE,
    "/diagnostics": STATUSES,
    "/parameter_events": "rcl_interfaces/msg/ParameterEvent",
}
_QOS = {"trace": TRACE, "snapshot": STATE, "mark": TRACE, "/parameter_events": TRACE}  # the others: best effort
_DISCOVERY_PERIOD = 0.5  # s
_DIAGNOSTICS_PERIOD = 0.5  # s
_SPIN_PERIOD = 0.1  # s
_SECOND = 1_000_000_000
_MEGA = 1_000_000
_MOST = 500  # messages of one topic at a look: one that has fallen behind must not keep the others waiting
PRIORITY = 10  # below everything that moves the handle, above everything that only computes


class Recorder(Node):
    """Lifecycle node: configured it listens, active it writes; every activation is a bag of its own."""

    def __init__(self):
        super().__init__("haptic_recorder", namespace="/haptic")
        self.parameters = declare(self, PARAMETERS)
        trial_of(self.parameters)
        on_change(self, PARAMETERS, self._on_parameters)
        self.tracks: dict[str, Track] = {}
        self.bag: Bag | None = None
        self.stopped = ""  # why recording ended by itself
        self._fresh: dict[str, bytes] = {}  # attachments that the present bag does not hold yet
        self._unknown: set[str] = set()
        self._next_discovery = self._next_flush = self._marks = 0
        self._inquiry = ParameterClient(self, self._on_answer)
        self._mark = self.create_publisher(String, "mark", TRACE)
        self.create_service(Trigger, "~/mark", self._on_mark)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._realtime = scheduling.go_realtime(self.parameters["realtime"], PRIORITY)
        scheduling.lift_threads(self.parameters["realtime"], PRIORITY)
        self._realtime = scheduling.stay_on_one_core(self._realtime)
        self.create_timer(_DIAGNOSTICS_PERIOD, self._report)

    def on_configure(self, state: State) -> TransitionCallbackReturn:
        """Joins the known topics."""
        for topic, type_name in KNOWN.items():
            offered = _QOS.get(topic)
            reliability = offered.reliability if offered else ReliabilityPolicy.BEST_EFFORT
            durability = offered.durability if offered else DurabilityPolicy.VOLATILE
            depth = self.parameters["queue"]
            self._join(topic, type_name, QoSProfile(depth=depth, reliability=reliability, durability=durability))
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: State) -> TransitionCallbackReturn:
        """Opens a new bag; refuses a folder that holds something, and a disk that is nearly full."""
        try:
            self.bag = self._open()
        except (ValueError, OSError) as error:
            self.stopped = f"cannot record: {error}"
            self.get_logger().error(self.stopped)
            return TransitionCallbackReturn.FAILURE
        self.stopped = ""
        self._inquiry.again()  # parameters and scene may be others than in the bag before
        self._next_discovery = 0
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

    def on_shutdown(self, state: State) -> TransitionCallbackReturn:
        """Writes what has come, closes the bag and leaves all topics, from any state."""
        self.finish()
        return self.on_cleanup(state)

    on_error = on_shutdown

    def look(self) -> None:
        """Takes what has come since the last look; to be called every `look_period`."""
        now = time.monotonic_ns()
        if self.tracks and now >= self._next_discovery:
            self._next_discovery = now + int(_DISCOVERY_PERIOD * _SECOND)
            self._discover()
            self._inquiry.look()
        try:
            for track in self.tracks.values():
                self._take(track, _MOST)
            self._attach_fresh()
            if self.bag and now >= self._next_flush:
                self._next_flush = now + int(self.parameters["flush_period"] * _SECOND)
                self.bag.flush()
                self._watch_disk()
        except OSError as error:
            self._end(f"the bag could not be written: {error.strerror}")

    def finish(self) -> None:
        """Closes the bag, if one is open, with everything that has arrived."""
        if self.bag is None:
            return
        reason = ""
        try:
            for track in self.tracks.values():
                self._take(track)
        except OSError as error:
            reason = f"the bag could not be written: {error.strerror}"
        except Exception as error:  # what has been taken is in the bag, which ends well without the rest
            reason = f"{type(error).__name__}: {error}"
        self._end(reason)

    def _open(self) -> Bag:
        folder, given = self._folder(), self.parameters
        folder.mkdir(parents=True, exist_ok=True)
        needed, free = int(given["disk_reserve"] * _MEGA) + RESERVE_BYTES, shutil.disk_usage(folder).free
        if free < needed:
            raise ValueError(f"{folder} has {free / _MEGA:.0f} MB free; disk_reserve needs {needed / _MEGA:.0f} MB")
        bag = Bag(folder, int(given["split.size"] * _MEGA), given["split.duration"])
        now = time.time_ns()
        made = {"trial.yaml": dump(trial_of(given)).encode(), "made.yaml": dump(provenance.facts()).encode()}
        for name, content in made.items():
            bag.attach(name, YAML, content, now)
        self._fresh = {}
        return bag

    def _watch_disk(self) -> None:
        free = shutil.disk_usage(self.bag.folder).free
        if free < self.parameters["disk_reserve"] * _MEGA:
            reserve = self.parameters["disk_reserve"]
            self._end(f"the disk has {free / _MEGA:.0f} MB left, disk_reserve is {reserve:g} MB")

    def _end(self, reason: str) -> None:
        """Ends the bag; reason: why by itself, "" if it was told to."""
        bag, self.bag, facts = self.bag, None, {}
        try:
            facts = self._facts()
        except Exception as error:  # the bag ends well without them
            reason = reason or f"{type(error).__name__}: {error}"
        try:
            bag.close(facts)
            kept = f"{bag.messages} messages are kept in {bag.folder}"
        except Exception as error:
            why = getattr(error, "strerror", None) or error
            kept = f"{bag.folder} could not be ended ({why}): haptic recover {bag.folder}"
            reason = reason or "its end failed"
        finally:
            for track in self.tracks.values():
                track.restart()
        if reason:
            self.stopped = f"recording stopped: {reason}; {kept}"
            self.get_logger().error(self.stopped)
        else:
            self.get_logger().info(kept)

    def _facts(self) -> dict[str, str]:
        return {"namespace": self.get_namespace(), **trial_of(self.parameters), **self._losses()}

    def _losses(self) -> dict[str, str]:
        return {f"lost {topic}": track.losses for topic, track in self.tracks.items() if track.channel}

    def _on_parameters(self, values: dict) -> None:
        trial_of(values)
        self.parameters = values

    def _on_answer(self, node: str, values: dict) -> None:
        """Attaches a node's parameters, and the files that they name."""
        self._fresh[f"parameters/{node}.yaml"] = parameter_file(self.get_namespace(), node, values)
        self._fresh |= files_of(values)

    def _attach_fresh(self) -> None:
        fresh, self._fresh = self._fresh, {}
        for name, content in fresh.items() if self.bag else ():
            self.bag.attach(name, YAML, content, time.time_ns())

    def _on_mark(self, request, response):
        """A numbered marker, for buttons; texts come by the topic."""
        self._marks += 1
        response.success, response.message = self.bag is not None, f"mark {self._marks}"
        if self.bag is None:
            response.message = self.stopped or "not recording"
        else:
            self._mark.publish(String(data=f"mark {self._marks}"))
        return response

    def _report(self) -> None:
        lossy = any(track.skipped.lost and track.publishers <= 1 for track in self.tracks.values())
        level = "error" if self.stopped else "warn" if lossy else "ok"
        state = f"recording to {self.bag.folder}" if self.bag else self.stopped or "not recording"
        values = {
            "messages": self.bag.messages if self.bag else 0,
            "cpu_s": f"{time.process_time():.3f}",
            "realtime": self._realtime,
            **self._losses(),
        }
        now = self.get_clock().now().nanoseconds
        self._diagnostics.publish(diagnostics(now, self.get_name(), "", level, state, values))

    def _folder(self) -> Path:
        return Path(self.parameters["bag"] or time.strftime("haptic_bags/%Y%m%d-%H%M%S")).absolute()

    def _join(self, topic: str, type_name: str, qos: QoSProfile) -> None:
        tap = PolledSubscription(self, topic, type_name, qos, raw=True)
        self.tracks[tap.topic] = Track(tap)

    def _discover(self) -> None:
        prefix = self.get_namespace().rstrip("/") + "/"
        for topic, type_names in self.get_topic_names_and_types():
            if not topic.startswith(prefix) and topic not in self.tracks:
                continue
            if topic in self.tracks:
                track = self.tracks[topic]
                track.publishers = max(track.publishers, self.count_publishers(topic))
            elif topic not in self._unknown and (publishers := self.get_publishers_info_by_topic(topic)):
                self._join_discovered(topic, type_names[0], publishers)

    def _join_discovered(self, topic: str, type_name: str, publishers: list) -> None:
        try:
            self._join(topic, type_name, joining_qos(publishers, self.parameters["queue"]))
        except (ImportError, AttributeError, ValueError) as error:
            self._unknown.add(topic)
            self.get_logger().warning(f"topic {topic} is not recorded: its type {type_name} is not installed ({error})")

    def _take(self, track: Track, most: int | None = None) -> None:
        for sample in islice(track.tap.take(), most):
            if self.bag is None or track.tap.topic in self._unknown:
                continue
            track.channel = track.channel or self._channel(track)
            if track.channel:
                self._write(track, sample)

    def _write(self, track: Track, sample: Sample) -> None:
        track.skipped.count(sample.sequence)
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
            raise ValueError(node.stopped)
    next_spin = 0.0
    while not told:
        node.look()
        if node.stopped and node.parameters["autostart"]:
            raise ValueError(node.stopped)
        time.sleep(node.parameters["look_period"])
        if time.monotonic() > next_spin:  # services and timers; each look at them costs as much as fifty messages
            next_spin = time.monotonic() + _SPIN_PERIOD
            executor.spin_once(timeout_sec=0.0)


def main(args: list[str] | None = None) -> int:
    """Runs haptic_recorder until SIGINT, SIGTERM or SIGHUP; every way out ends the bag.

    Exit code 1 on a refusal, or if recording ended by itself.
    """
    told = hear_the_end()
    try:
        with own_participant_id("haptic_recorder"):
            begin_ros(args)
            node = Recorder()
        try:
            _record_until_told(node, told)
        finally:
            node.finish()
    except (ValueError, OSError) as error:
        print(f"haptic_recorder: {error}", file=sys.stderr)
        return 1
    finally:
        rclpy.try_shutdown()
    return 1 if node.stopped else 0


if __name__ == "__main__":
    sys.exit(main())
