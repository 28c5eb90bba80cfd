# SPDX-License-Identifier: Apache-2.0
"""haptic_recorder: every topic of the system, as it came, into a rosbag2 folder."""

if __name__ == "__main__":  # before the imports, which take seconds
    from haptic_device.process import start

    raise SystemExit(start(__spec__.name))

import shutil
import time
from itertools import count, islice
from pathlib import Path

from std_srvs.srv import Trigger

from haptic_device.config.parameters import RECORDER
from haptic_device.config.yaml_reader import dump
from haptic_device.nodes import FIRST_ROW
from haptic_device.nodes.bag_attachments import YAML, files_of, parameter_file, trial_of
from haptic_device.nodes.lifecycle import ManagedNode, run, sentence_of
from haptic_device.nodes.messages import TRACE, String
from haptic_device.nodes.parameter_client import ParameterClient
from haptic_device.nodes.polled_subscription import Sample
from haptic_device.nodes.recorded_topics import RecordedTopics, Track
from haptic_device.nodes.ros_parameters import on_change
from haptic_device.os_errors import in_words
from haptic_device.realtime import scheduling
from haptic_device.recording import provenance
from haptic_device.recording.writer import Bag

_DISCOVERY_PERIOD = 0.5  # s
_SERVE_PERIOD = 0.1  # s
_SECOND = 1_000_000_000
_MEGA = 1_000_000
_MOST = 500  # messages of one topic at a look: one that has fallen behind must not keep the others waiting
PRIORITY = 10  # below everything that moves the handle, above everything that only computes


class Recorder(ManagedNode):
    """Configured it listens, active it writes; every activation is a bag of its own."""

    def __init__(self):
        super().__init__("haptic_recorder", RECORDER)
        trial_of(self.values)
        on_change(self, RECORDER, trial_of, self.take_values)
        self.topics = RecordedTopics(self)
        self.bag: Bag | None = None
        self._fresh: dict[str, bytes] = {}  # attachments that the present bag does not hold yet
        self._next_discovery = self._next_flush = self._marks = 0
        self._next_serve, self._heard = 0.0, False
        self._parameter_client = ParameterClient(self, self._on_answer)
        self._mark = self.create_publisher(String, "mark", TRACE)
        self.create_service(Trigger, "~/mark", self._on_mark)
        self._realtime = scheduling.go_realtime(self.values["realtime"], PRIORITY)
        scheduling.lift_threads(self.values["realtime"], PRIORITY)
        self._realtime = scheduling.stay_on_one_core(self._realtime)

    def configure(self) -> None:
        """Joins the known topics."""
        self.topics.join_known(self.values["queue"])

    def activate(self) -> None:
        """Opens a new bag; refuses a folder that holds something, and a disk that is nearly full: it stays inactive."""
        self.refusal = ""
        try:
            self.bag = self._open()
        except (ValueError, OSError) as error:
            raise ValueError(f"cannot record: {in_words(error)}") from None
        self.topics.skip()  # a bag begins when it is opened
        self._parameter_client.again()  # parameters and scene may be others than in the bag before
        self._next_discovery, self._heard = 0, False
        self.get_logger().info(f"recording to {self.bag.folder}")

    def deactivate(self) -> None:
        """Writes what has come and closes the bag, if one is open."""
        self._close_bag()

    def cleanup(self) -> None:
        """Leaves all topics."""
        self.topics.close()

    def serve(self, executor) -> None:
        """Looks at the topics, and seldom at services and timers: a look at those costs as much as fifty messages."""
        try:
            self.look()
        except Exception as error:  # nobody foresaw it
            self._close_bag(sentence_of(error)) if self.bag else self.survive(error)
        time.sleep(self.values["look_period"])
        if time.monotonic() > self._next_serve:
            self._next_serve = time.monotonic() + _SERVE_PERIOD
            super().serve(executor, 0.0)

    def look(self) -> None:
        """Takes what has come since the last look; to be called every `look_period`."""
        now = time.monotonic_ns()
        if self.topics.tracks and now >= self._next_discovery:
            self._next_discovery = now + int(_DISCOVERY_PERIOD * _SECOND)
            self.topics.discover(self.values["queue"])
            self._parameter_client.look()
        try:
            for track in self.topics.tracks.values():
                self._take(track, _MOST)
            self._attach_fresh()
            if self.bag and now >= self._next_flush:
                self._next_flush = now + int(self.values["flush_period"] * _SECOND)
                self.bag.flush()
                self._watch_disk()
        except OSError as error:
            self._end(f"the bag could not be written: {in_words(error)}")

    def _close_bag(self, reason: str = "") -> None:
        """Ends the bag, if one is open, with everything that has arrived; reason as of `_end`."""
        if self.bag is None:
            return
        try:
            for track in self.topics.tracks.values():
                self._take(track)
        except OSError as error:
            reason = f"the bag could not be written: {in_words(error)}"
        except Exception as error:  # what has been taken is in the bag, which ends well without the rest
            reason = sentence_of(error)
        self._end(reason)

    def _open(self) -> Bag:
        folder, given = self._folder(), self.values
        folder.mkdir(parents=True, exist_ok=True)
        needed, free = given["disk_reserve"] * _MEGA, shutil.disk_usage(folder).free
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
        if free < self.values["disk_reserve"] * _MEGA:
            reserve = self.values["disk_reserve"]
            self._end(f"the disk has {free / _MEGA:.0f} MB left, disk_reserve is {reserve:g} MB")

    def _end(self, reason: str) -> None:
        """Ends the bag; reason: why by itself, "" if it was told to."""
        bag, self.bag, facts = self.bag, None, {}
        try:
            facts = self._facts()
        except Exception as error:  # the bag ends well without them
            reason = reason or sentence_of(error)
        try:
            bag.close(facts)
            kept = f"{bag.messages} messages are kept in {bag.folder}"
        except Exception as error:
            cure = f"haptic report reads what is there; for other tools: ros2 bag reindex -s mcap {bag.folder}"
            kept = f"{bag.folder} could not be ended ({in_words(error)}): {cure}"
            reason = reason or "its end failed"
        finally:
            for track in self.topics.tracks.values():
                track.restart()
        if reason:
            self.fail(f"recording stopped: {reason}; {kept}")
        else:
            self.get_logger().info(kept)

    def _facts(self) -> dict[str, str]:
        return {"namespace": self.get_namespace(), **trial_of(self.values), **self._losses()}

    def _losses(self) -> dict[str, str]:
        tracks = self.topics.tracks.items()
        others = {f"not recorded {topic}": track.stranger for topic, track in tracks if track.stranger}
        return {f"lost {topic}": track.losses for topic, track in tracks if track.channel} | others

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
            response.message = self.failure or self.refusal or "not recording"
        else:
            self._mark.publish(String(data=f"mark {self._marks}"))
        return response

    def diagnose(self) -> None:
        """Says whether it records, and what was lost."""
        lossy = any(track.gaps.lost and track.publishers <= 1 for track in self.topics.tracks.values())
        strangers = any(track.stranger for track in self.topics.tracks.values())
        state = f"recording to {self.bag.folder}" if self.bag else self.refusal or "not recording"
        values = {
            "messages": self.bag.messages if self.bag else 0,
            "cpu_s": f"{time.process_time():.3f}",
            "realtime": self._realtime,
            **self._losses(),
        }
        self.say_status("warn" if lossy or strangers or self.refusal else "ok", state, values)

    def _folder(self) -> Path:
        """As named; else by the time, with a number behind it where that second has a bag already."""
        if self.values["bag"]:
            return Path(self.values["bag"]).absolute()
        first = Path(time.strftime("haptic_bags/%Y%m%d-%H%M%S")).absolute()
        names = (first if number == 1 else first.with_name(f"{first.name}-{number}") for number in count(1))
        return next(folder for folder in names if not folder.exists())

    def _take(self, track: Track, most: int | None = None) -> None:
        for sample in islice(track.take(), most):
            if self.bag is None or track.subscription.topic in self.topics.refused:
                continue
            track.channel = track.channel or self._channel(track.subscription)
            if track.channel:
                self._write(track, sample)

    def _write(self, track: Track, sample: Sample) -> None:
        track.count(sample.sequence)
        self.bag.write(track.channel, sample.message, sample.received, sample.published, sample.sequence)
        if not self._heard and self.topics.is_of_the_system(track.subscription.topic):
            self._heard = True
            self.get_logger().info(f"{FIRST_ROW}, of {track.subscription.topic}")

    def _channel(self, subscription) -> int:
        topic = subscription.topic
        try:
            return self.bag.add_topic(topic, subscription.type_name, self.topics.offered_qos(topic))
        except ValueError as error:
            self.topics.refuse(topic, f"{error}; it is not recorded")
            return 0


def main(args: list[str] | None = None) -> int:
    """Runs haptic_recorder until SIGINT, SIGTERM or SIGHUP; every way out ends the bag.

    Exit code 1 on a refusal, or if recording ended by itself.
    """
    return run(Recorder, "haptic_recorder", args)
