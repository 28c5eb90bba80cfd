# SPDX-License-Identifier: Apache-2.0
"""One recorded topic: the count of what never came, and the QoS that joins its publishers, as a bag names it."""

from dataclasses import dataclass, field

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from haptic_device.nodes.polled_subscription import PolledSubscription
from haptic_device.sequence_gaps import UNKNOWN, SequenceGaps

_SECOND = 1_000_000_000


@dataclass
class Track:
    """A topic's tap, its channel in the bag (0: none yet), and what its publisher's numbers skipped."""

    tap: PolledSubscription
    channel: int = 0
    publishers: int = 0
    skipped: SequenceGaps = field(default_factory=SequenceGaps)

    def restart(self) -> None:
        """Makes it ready for another bag."""
        self.channel, self.skipped = 0, SequenceGaps()

    @property
    def losses(self) -> str:
        """How many messages were lost, as text; the numbers of several publishers cannot be told apart."""
        return str(self.skipped.lost) if self.publishers <= 1 else UNKNOWN


def joining_qos(publishers: list, depth: int) -> QoSProfile:
    """The strongest QoS that all these publishers (endpoint infos) match."""
    reliable = all(info.qos_profile.reliability == ReliabilityPolicy.RELIABLE for info in publishers)
    latched = all(info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for info in publishers)
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def offered_qos(publishers: list) -> list[dict]:
    """The publishers' QoS profiles in the words of rosbag2's metadata version 9."""
    return [_record(info.qos_profile) for info in publishers]


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
