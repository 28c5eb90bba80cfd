# SPDX-License-Identifier: Apache-2.0
"""The recorded topics: which there are, what never came of each, and the QoS that joins its publishers."""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from haptic_device.nodes.messages import STATE, STREAM, TRACE
from haptic_device.nodes.polled_subscription import PolledSubscription, Sample
from haptic_device.nodes.transforms import TFMessage
from haptic_device.recording.layouts import CLOUD, DIAGNOSTICS, JOINTS, POSE, STRING, WRENCH
from haptic_device.recording.sequence_gaps import UNKNOWN, SequenceGaps

KNOWN = {  # joined before their publishers exist, so that no first message is missed
    **dict.fromkeys(("encoder", "motor", "handle", "tool", "joint_states"), JOINTS),
    **dict.fromkeys(("operator/state", "operator/target"), JOINTS),
    **dict.fromkeys(("local_contacts", "trace", "snapshot"), CLOUD),
    **{"mark": STRING, "wrench": WRENCH, "pose": POSE, "/diagnostics": DIAGNOSTICS},
    "/parameter_events": "rcl_interfaces/msg/ParameterEvent",
    **(dict.fromkeys(("/tf", "/tf_static"), "tf2_msgs/msg/TFMessage") if TFMessage else {}),
}
_QOS = {"snapshot": STATE, "/tf_static": STATE}  # these and the ones below; the others: best effort
_QOS |= dict.fromkeys(("trace", "mark", "joint_states", "/parameter_events", "/tf"), TRACE)

_CHATTER = ("/diagnostics", "/parameter_events", "/rosout", "/transition_event")  # of any node, also the recorder's own
_CHATTER += ("/mark", "/markers", "/operator/target")  # of who looks on or commands
_SECOND = 1_000_000_000


@dataclass
class Track:
    """A topic's subscription, whether its last messages are kept for late joiners, its channel in the bag (0: none
    yet), and the gaps in its publisher's numbers.

    stranger: the sentence on publishers of another type, whose messages cannot be recorded; "" if there were none.
    """

    subscription: PolledSubscription
    latched: bool = False
    channel: int = 0
    publishers: int = 0
    gaps: SequenceGaps = field(default_factory=SequenceGaps)
    stranger: str = ""
    _left: deque[Sample] = field(default_factory=deque)
    _joined_again: bool = False

    def take(self) -> Iterator[Sample]:
        """Everything that waits, oldest first."""
        while self._left:
            yield self._left.popleft()
        yield from self.subscription.take()

    def count(self, sequence: int) -> None:
        """Counts what was lost before this message, by the number that its publisher gave it."""
        if self._joined_again and sequence:  # a publisher that is new begins with 1
            self.gaps.lost, self.gaps.last = self.gaps.lost + sequence - 1, 0
        self._joined_again = False
        self.gaps.count(sequence)

    def join_again(self, join: Callable[[], PolledSubscription]) -> None:
        """Goes on with another subscription; what waits in this one is kept."""
        self._left.extend(self.subscription.take())
        self.subscription.close()
        self.subscription, self._joined_again = join(), self.gaps.last > 0

    def restart(self) -> None:
        """Makes it ready for another bag."""
        self.channel, self.gaps, self._joined_again = 0, SequenceGaps(), False

    @property
    def losses(self) -> str:
        """How many messages were lost, as text; the numbers of several publishers cannot be told apart."""
        return str(self.gaps.lost) if self.publishers <= 1 else UNKNOWN


class RecordedTopics:
    """The topics of a node's namespace and those that are KNOWN, joined as their publishers come: `tracks` by name.

    refused: topics that cannot be recorded, each said once.
    """

    def __init__(self, node):
        self._node, self.tracks, self.refused = node, {}, set()
        self._prefix = node.get_namespace().rstrip("/") + "/"

    def join_known(self, depth: int) -> None:
        """Joins those that are known, with queues of this depth."""
        for topic, kind in KNOWN.items():
            qos = _QOS.get(topic, STREAM)
            self._join(topic, kind, QoSProfile(depth=depth, reliability=qos.reliability, durability=qos.durability))

    def discover(self, depth: int) -> None:
        """Joins what else there is by now, and joins again where a publisher does not reach us; counts publishers."""
        node = self._node
        for topic, type_names in node.get_topic_names_and_types():
            if topic in self.tracks:
                track, publishers = self.tracks[topic], node.count_publishers(topic)
                track.publishers = max(track.publishers, publishers)
                if publishers > track.subscription.matched:
                    self._reach(topic, track, depth)
                continue
            new = topic.startswith(self._prefix) and topic not in self.refused
            if new and (publishers := node.get_publishers_info_by_topic(topic)):
                self._join_discovered(topic, type_names[0], joining_qos(publishers, depth))

    def is_of_the_system(self, topic: str) -> bool:
        """Whether what comes on it shows that the recorded system is there, and not only some node."""
        return topic.startswith(self._prefix) and not topic.endswith(_CHATTER)

    def refuse(self, topic: str, sentence: str) -> None:
        """Records no more of this topic, and says why."""
        self.refused.add(topic)
        self._node.get_logger().warning(sentence)

    def offered_qos(self, topic: str) -> list[dict]:
        """QoS profiles of the publishers of a topic, in the words of rosbag2's metadata version 9."""
        return [_record(info.qos_profile) for info in self._node.get_publishers_info_by_topic(topic)]

    def skip(self) -> None:
        """Passes over what waits, but for what is kept for late joiners."""
        for track in self.tracks.values():
            if not track.latched:
                deque(track.take(), maxlen=0)

    def close(self) -> None:
        """Leaves all."""
        for track in self.tracks.values():
            track.subscription.close()
        self.tracks.clear()

    def _reach(self, topic, track, depth):
        """Joins a topic again where the QoS of a publisher does not fit; says where one has another type."""
        publishers = self._node.get_publishers_info_by_topic(topic)
        ours = [info for info in publishers if info.topic_type == track.subscription.type_name]
        others = sorted({info.topic_type for info in publishers} - {track.subscription.type_name})
        if others and not track.stranger:
            track.stranger = f"{', '.join(others)} is not recorded: the topic is {track.subscription.type_name}"
            self._node.get_logger().warning(f"topic {topic}: {track.stranger}")
        if any(not _fits(info.qos_profile, track.subscription.qos) for info in ours):
            self._join_again(topic, track, joining_qos(ours, depth))

    def _join_again(self, topic, track, qos):
        type_name = track.subscription.type_name
        track.join_again(lambda: PolledSubscription(self._node, topic, type_name, qos, raw=True))
        track.latched = qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
        kind = f"{qos.reliability.name} {qos.durability.name}".lower().replace("_", " ")
        self._node.get_logger().warning(
            f"topic {topic} has a publisher of another QoS now and is joined again, {kind}: "
            "what was published before that is not in the bag"
        )

    def _join(self, topic, type_name, qos):
        subscription = PolledSubscription(self._node, topic, type_name, qos, raw=True)
        self.tracks[subscription.topic] = Track(subscription, qos.durability == DurabilityPolicy.TRANSIENT_LOCAL)

    def _join_discovered(self, topic, type_name, qos):
        try:
            self._join(topic, type_name, qos)
        except (ImportError, AttributeError, ValueError) as error:
            self.refuse(topic, f"topic {topic} is not recorded: its type {type_name} is not installed ({error})")


def _fits(offered: QoSProfile, wanted: QoSProfile) -> bool:
    """Whether a publisher of the one reaches a subscription of the other."""
    reliable = offered.reliability == ReliabilityPolicy.RELIABLE or wanted.reliability != ReliabilityPolicy.RELIABLE
    latched = offered.durability == DurabilityPolicy.TRANSIENT_LOCAL
    return reliable and (latched or wanted.durability != DurabilityPolicy.TRANSIENT_LOCAL)


def joining_qos(publishers: list, depth: int) -> QoSProfile:
    """The strongest QoS that all these publishers (endpoint infos) match."""
    reliable = all(info.qos_profile.reliability == ReliabilityPolicy.RELIABLE for info in publishers)
    latched = all(info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for info in publishers)
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def _record(qos: QoSProfile) -> dict:
    return {
        "history": qos.history.name.lower(),
        "depth": qos.depth,
        "reliability": qos.reliability.name.lower(),
        "durability": qos.durability.name.lower(),
        "deadline": _duration(qos.deadline),
        "lifespan": _duration(qos.lifespan),
        "liveliness": qos.liveliness.name.lower(),
        "liveliness_lease_duration": _duration(qos.liveliness_lease_duration),
        "avoid_ros_namespace_conventions": qos.avoid_ros_namespace_conventions,
    }


def _duration(duration) -> dict:
    seconds, nanoseconds = divmod(duration.nanoseconds, _SECOND)
    return {"sec": seconds, "nsec": nanoseconds}
