# SPDX-License-Identifier: Apache-2.0
"""What the driver tells of its ticks: each at most once on a topic, with stamps that differ as the deadlines do; on a
machine that is too busy, by a clock that goes on only where it publishes or sleeps."""

import struct
import threading

import numpy as np
import pytest
from fake_node import Node, Said
from lockstep_systems import device, values
from waiting import until

from haptic_device.config.description import load_device
from haptic_device.config.drives import drives_at
from haptic_device.control import controller_config, records
from haptic_device.nodes.telemetry import MOST_ROWS, Telemetry
from haptic_device.realtime import clock, seqlock
from haptic_device.realtime.null_device import NullDevice
from haptic_device.realtime.servo_thread import RING_ROWS, ServoThread
from haptic_device.realtime.tick_replay import SNAPSHOT
from haptic_device.recording.layouts import JOINTS, POSE, WRENCH, layout_of

EACH_TICK = ("encoder", "motor", "wrench", "pose", "joint_states")


def stamps(said):
    """Of these messages [ns]."""
    return [s * 10**9 + ns for s, ns in (struct.unpack_from("<iI", data, 4) for data in said)]


def idle(rate, pose_rate, described=None):
    """A servo that does not run itself, and the driver's values."""
    given = values("haptic_driver", publish__rate=float(rate), publish__pose_rate=float(pose_rate))
    settings = controller_config.settings_from(described or device(damping=3.0), given)
    servo = ServoThread(NullDevice(), settings, None, "off")
    servo.snapshot = lambda: np.zeros(1, SNAPSHOT)
    return servo, given


def put(servo, row):
    """A row into the ring, if it has room."""
    words, rows = servo.ring.words, servo.ring.rows
    if (slot := seqlock.ring_slot(words, len(rows))) >= 0:
        rows[slot] = row[0]
        seqlock.ring_push(words)


SECOND, BEGIN, PERIOD = 10**9, 10**12, 200_000  # [ns] the servo's ticks
BUSY = {"trace": 80_000_000}  # [ns] that it takes to publish; a block of so many rows comes in 51 ms
FREE = {"trace": 1_000_000}
OTHERS = 50_000  # [ns] any other message
RATE, POSE_RATE, SECONDS = 500, 100, 6


class Costly(Said):
    """A publisher that takes time."""

    def publish(self, data):
        self.append(data)
        self.machine.published(self.topic)


class Machine(Node):
    """A node, a servo and a clock: ticks are done as time passes, on the page of a servo that does not run itself."""

    def __init__(self, patch, costs):
        super().__init__()
        self.costs, self.now, self.ticks, self.order, self.let_go = costs, BEGIN, 0, [], threading.Event()
        self.held, self.end, self.serves = threading.Event(), BEGIN + SECONDS * SECOND, True
        self.servo, given = idle(RATE, POSE_RATE)
        patch.setattr(clock, "now_ns", lambda scratch: self.now)
        patch.setattr(clock, "sleep_until", self.sleep_until)
        self.telemetry = Telemetry(self, self.servo, device(damping=3.0), given, self.clock.stamp)
        self.telemetry.start()

    def create_publisher(self, kind, topic, qos):
        publisher = self.said.setdefault(topic, Costly())
        publisher.machine, publisher.topic = self, topic
        return publisher

    def published(self, topic):
        self.order.append(topic)
        self.go_on(self.now + self.costs.get(topic, OTHERS))

    def sleep_until(self, deadline, scratch):
        self.order.append("rest")
        self.go_on(max(deadline, self.now))
        if self.now >= self.end:
            self.held.set()
            self.let_go.wait()

    def go_on(self, now):
        """Time passes up to now, and ticks are done in it."""
        self.now, row = now, np.zeros(1, records.TRACE_ROW)
        while self.serves and BEGIN + self.ticks * PERIOD <= now:
            row["tick"], row["deadline"] = self.ticks, BEGIN + self.ticks * PERIOD
            self.ticks += 1
            put(self.servo, row)
        if self.ticks and row["deadline"][0]:
            self.servo.row.put(row)

    def count(self, *topics):
        return [len(self.said[topic]) for topic in topics]


@pytest.fixture(params=[FREE], ids=["free"])
def machine(request):
    """A machine that has published for SECONDS of its time, and stands still there."""
    with pytest.MonkeyPatch.context() as patch:
        machine = Machine(patch, request.param)
        try:
            until(machine.held.is_set, "the end of its time")
            yield machine
        finally:
            machine.serves = False
            machine.let_go.set()
            machine.telemetry.stop()


overloaded = pytest.mark.parametrize("machine", [BUSY], indirect=True, ids=["busy"])


def test_where_there_is_time_for_all_each_tick_is_told_once_with_one_stamp_and_nothing_is_left_out(machine):
    assert machine.telemetry.left_out() == {"skipped": 0.0, "dropped": 0.0}
    assert machine.count(*EACH_TICK) == [SECONDS * RATE] * 2 + [SECONDS * POSE_RATE] * 3
    found = stamps(machine.said["encoder"])
    assert set(np.diff(found) % PERIOD) == {0} and min(np.diff(found)) > 0
    assert found == stamps(machine.said["motor"])
    assert set(stamps(machine.said["pose"])) < set(found)


@overloaded
def test_each_stream_has_its_share_of_a_busy_machine_the_trace_gives_way_first_and_the_rest_is_counted(machine):
    half = SECONDS * RATE // 2, SECONDS * POSE_RATE // 2
    assert all(0.7 * half[0] < count for count in machine.count("encoder", "motor"))
    assert all(0.7 * half[1] < count for count in machine.count("wrench", "pose", "joint_states"))
    assert machine.count("snapshot")[0] >= SECONDS - 1
    trace = SECONDS * SECOND / BUSY["trace"]
    assert 0.4 * trace < machine.count("trace")[0] <= 0.5 * trace + 1
    left_out, skipped = machine.telemetry.left_out(), machine.telemetry.skipped
    assert left_out["dropped"] > 0.0 and left_out["skipped"] > 0.0
    waiting = SECONDS * (RATE + POSE_RATE) - sum(machine.count("encoder", "pose")) - skipped
    assert 0 <= waiting <= BUSY["trace"] * (RATE + POSE_RATE) / SECOND  # those of the turn that is to come


@overloaded
def test_stop_returns_from_a_ring_that_fills_too_fast(machine):
    before = machine.count("trace")[0]
    machine.let_go.set()
    machine.telemetry.stop()
    assert 0 < machine.count("trace")[0] - before <= RING_ROWS // MOST_ROWS
    assert machine.servo.ring.dropped > 0


def told(data, kind=JOINTS):
    """Names, position, velocity, effort of a message."""
    layout = layout_of(kind, data)
    _, *parts = layout.arrays([data])
    return [list(layout.names), *(part[0].tolist() for part in parts)]


def test_a_linkage_tells_its_joints_and_torques_by_name_and_its_handle_where_the_joints_put_it():
    described, place, node, row = load_device("serial_2r"), [0.02, 0.08, 0.0], Node(), np.zeros(1, records.TRACE_ROW)
    servo, given = idle(RATE, POSE_RATE, described)
    hardware, angles = servo.settings.get()["hardware"][0], drives_at(described, place)
    row["counts"][0, :2] = ((angles + hardware["zero"]) / hardware["position_per_count"].clip(1e-9))[:2]
    row["torque"], row["motor"], row["force_on_handle"] = (0.3, -0.2, 0.0), (3.0, -2.0, 0.0), (5.0, 6.0, 0.0)
    row["deadline"], row["latched"] = BEGIN, BEGIN
    servo.row.put(row)
    telemetry = Telemetry(node, servo, described, given, node.clock.stamp)
    telemetry.start()
    until(lambda: node.said["motor"] and node.said["joint_states"], "a tick")
    telemetry.stop()
    names, position, *_ = told(node.said["encoder"][0])
    assert names == ["shoulder", "elbow"] and position == pytest.approx(angles[:2], abs=1e-9)
    assert told(node.said["motor"][0]) == [names, [3.0, -2.0], [0.0, 0.0], [0.3, -0.2]]
    assert told(node.said["pose"][0], POSE)[1] == pytest.approx([*place, 0.0, 0.0, 0.0, 1.0], abs=1e-9)
    assert told(node.said["wrench"][0], WRENCH)[3][:2] == [5.0, 6.0]
    assert told(node.said["joint_states"][0])[3] == [0.3, -0.2, 0.0]  # nothing drives the pivot
