# SPDX-License-Identifier: Apache-2.0
"""Messages byte by byte, against ROS's own serialization."""

import math

import numpy as np
import pytest
from examples import few
from hypothesis import given
from hypothesis import strategies as st
from live_nodes import STRANGE
from rclpy.serialization import deserialize_message, serialize_message

from haptic_device.control import records
from haptic_device.message_fields import AXES, exchange_names, truth_names
from haptic_device.nodes import messages
from haptic_device.recording.layouts import (
    POSE,
    WRENCH,
    CloudLayout,
    JointLayout,
    StampedLayout,
    pose_numbers,
    wrench_numbers,
)
from haptic_device.recording.status import LEVELS, number

NAMES = [exchange_names(axes) for axes in (1, 2, 3)] + [truth_names(axes) for axes in (1, 2, 3)]
NAMES += [AXES[:axes] for axes in (1, 2, 3)]
STAMP = 1_700_000_000_123_456_789


def message(names, frame="", arrays=None):
    built = messages.JointState(name=list(names))
    built.header.stamp, built.header.frame_id = messages.to_time(STAMP), frame
    arrays = np.ones((3, len(names))) if arrays is None else arrays
    built.position, built.velocity, built.effort = (array.tolist() for array in arrays)
    return built


@pytest.mark.parametrize("names", NAMES, ids=len)
def test_a_packed_message_is_what_ros_would_have_written_but_for_padding_and_read_back_from_it(names):
    arrays = np.random.default_rng(1).normal(size=(3, len(names)))
    for frame in ("", "haptic_base", "abc"):
        layout, written = JointLayout(names, frame), serialize_message(message(names, frame, arrays))
        ours = layout.pack(STAMP, *arrays)
        assert len(ours) == len(written) == layout.size
        counts = layout.fixed.astype(bool)
        counts[4:12] = True
        for offset in layout.offsets:
            counts[offset : offset + 8 * layout.count] = True
        assert [i for i in range(len(ours)) if ours[i] != written[i] and counts[i]] == []
        assert np.sum(~counts) <= 3 * (len(names) + 2) + 4 * 3
        assert deserialize_message(ours, messages.JointState) == message(names, frame, arrays)
        sample = layout.unpack(written)
        assert layout.matches(written) and sample.stamp_ns == STAMP
        assert np.array_equal([sample.position, sample.velocity, sample.effort], arrays)


@few(60)
@given(st.binary(max_size=600))
def test_layouts_of_different_names_frames_or_sizes_and_foreign_bytes_do_not_match(data):
    layouts = [JointLayout(names) for names in NAMES]
    layouts += [JointLayout(NAMES[0], "base"), JointLayout(("y", *NAMES[0][1:]))]
    assert not any(layout.matches(data) for layout in layouts)
    for layout in layouts:
        data = serialize_message(message(layout.names, "base" if layout is layouts[-2] else ""))
        assert [other.matches(data) for other in layouts] == [other is layout for other in layouts]


def test_a_trace_describes_itself_and_holds_every_column_of_every_tick():
    rows = np.zeros(5, records.TRACE_ROW)
    rows["tick"], rows["position"] = np.arange(5), np.arange(15).reshape(5, 3)
    packed = CloudLayout(records.TRACE_ROW, "haptic_base").pack(STAMP, rows)
    cloud = deserialize_message(packed, messages.PointCloud2)
    assert messages.to_time(STAMP) == cloud.header.stamp and cloud.header.frame_id == "haptic_base"
    assert (cloud.width, cloud.height, cloud.point_step, cloud.row_step) == (5, 1, rows.itemsize, rows.nbytes)
    kind = [(field.name, "f8", *[(field.count,)] * (field.count > 1)) for field in cloud.fields]
    assert {field.datatype for field in cloud.fields} == {8} and np.dtype(kind) == records.TRACE_ROW
    assert np.frombuffer(bytes(cloud.data), kind).tobytes() == rows.tobytes()


def test_wrench_and_pose_are_planar_and_a_full_turn_is_the_identity():
    for frame in ("haptic_base", "", "abcd"):
        packed = StampedLayout(WRENCH, frame).pack(STAMP, wrench_numbers((1.0, 2.0, 3.0)))
        read = deserialize_message(packed, messages.WrenchStamped)
        force = read.wrench
        assert (force.force.x, force.force.y, force.force.z, force.torque.z) == (1.0, 2.0, 0.0, 3.0)
        assert (read.header.stamp, read.header.frame_id) == (messages.to_time(STAMP), frame)
    for angle, z, w in ((math.pi / 2, math.sqrt(0.5), math.sqrt(0.5)), (4 * math.pi, 0.0, 1.0)):
        packed = StampedLayout(POSE, "haptic_base").pack(STAMP, pose_numbers((0.1, 0.2, angle)))
        pose = deserialize_message(packed, messages.PoseStamped).pose
        assert (pose.position.x, pose.position.y) == (0.1, 0.2)
        assert (pose.orientation.z, abs(pose.orientation.w)) == (pytest.approx(z, abs=1e-12), pytest.approx(w))


def test_a_target_needs_exactly_the_axes_names_and_finite_numbers():
    def target(names, *position):
        return messages.planar_target(messages.JointState(name=names.split(), position=position), ("x", "y"))

    assert target("x y", 1.0, 2.0) == [1.0, 2.0] and target("y x", 1.0, 2.0) == [2.0, 1.0]
    assert target("x", 1.0) is target("x z", 1.0, 2.0) is target("x y", 1.0) is target("") is None
    assert target("x y y", 1.0, 2.0, 3.0) is target("x y theta", 1.0, 2.0, 3.0) is None
    assert target("x y", 1.0, math.nan) is target("x y", math.inf, 0.0) is None


def test_strange_diagnostics_are_read_as_far_as_they_go():
    found = {}
    for each in STRANGE:
        found |= messages.statuses_of(each, STAMP)
    stale = LEVELS.index("STALE")
    levels = {"no\ufffdtext": 0, "seven": stale, "all bits": stale, "[/x]": 0}
    assert {name: said.level for name, said in found.items() if "haptic" not in name} == levels
    assert found["[/x]"].values == {"[/x]": "[/x]"} and found["haptic_driver"].values["fault"] == "overheated"
    assert [number(text) for text in ("2.5", "-1")] == [2.5, -1.0]
    assert all(math.isnan(number(text)) for text in ("", "many", "[/x]"))
