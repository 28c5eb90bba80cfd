# SPDX-License-Identifier: Apache-2.0
"""The recorded topics: which there are, what never came of each, and the QoS that joins its publishers."""

from collections import deque
from dataclasses import dataclass, field

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from haptic_device.nodes.messages import STATE, TRACE
from haptic_device.nodes.polled_subscription import PolledSubscription
from haptic_device.nodes.transforms import TFMessage
from haptic_device.recording.layouts import CLOUD, DIAGNOSTICS, JOINTS, POSE, STRING, WRENCH
from haptic_device.sequence_gaps import UNKNOWN, SequenceGaps

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
    "joint_states": JOINTS,
    "/diagnostics": DIAGNOSTICS,
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
    yet), and the gaps in its publisher's numbers."""

    subscription: PolledSubscription
    latched: bool = False
    channel: int = 0
    publishers: int = 0
    gaps: SequenceGaps = field(default_factory=SequenceGaps)

    def restart(self) -> None:
        """Makes it ready for another bag."""
        self.channel, self.gaps = 0, SequenceGaps()

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
        for topic, type_name in KNOWN.items():
            offered = _QOS.get(topic)
            reliability = offered.reliability if offered else ReliabilityPolicy.BEST_EFFORT
            durability = offered.durability if offered else DurabilityPolicy.VOLATILE
            self._join(topic, type_name, QoSProfile(depth=depth, reliability=reliability, durability=durability))

    def discover(self, depth: int) -> None:
        """Joins what else there is by now, and counts the publishers of each."""
        node = self._node
        for topic, type_names in node.get_topic_names_and_types():
            if topic in self.tracks:
                track = self.tracks[topic]
                track.publishers = max(track.publishers, node.count_publishers(topic))
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
                deque(track.subscription.take(), maxlen=0)

    def close(self) -> None:
        """Leaves all."""
        for track in self.tracks.values():
            track.subscription.close()
        self.tracks.clear()

    def _join(self, topic, type_name, qos):
        subscription = PolledSubscription(self._node, topic, type_name, qos, raw=True)
        self.tracks[subscription.topic] = Track(subscription, qos.durability == DurabilityPolicy.TRANSIENT_LOCAL)

    def _join_discovered(self, topic, type_name, qos):
        try:
            self._join(topic, type_name, qos)
        except (ImportError, AttributeError, ValueError) as error:
            self.refuse(topic, f"topic {topic} is not recorded: its type {type_name} is not installed ({error})")


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
