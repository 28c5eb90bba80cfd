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
from haptic_device.status import LEVELS, number

NAMES = [exchange_names(axes) for axes in (1, 2, 3)] + [truth_names(axes) for axes in (1, 2, 3)]
NAMES += [AXES[:axes] for axes in (1, 2, 3)]
STAMP = 1_700_000_000_123_456_789


def numbers(count, seed=1):
    return np.random.default_rng(seed).normal(size=(3, count))


def message(names, frame="", arrays=None):
    arrays = numbers(len(names)) if arrays is None else arrays
    built = messages.JointState(name=list(names))
    built.header.stamp, built.header.frame_id = messages.to_time(STAMP), frame
    built.position, built.velocity, built.effort = (array.tolist() for array in arrays)
    return built


@pytest.mark.parametrize("frame", ["", "haptic_base", "abc"])
@pytest.mark.parametrize("names", NAMES, ids=len)
def test_a_packed_message_is_what_ros_would_have_written_but_for_padding(names, frame):
    layout = JointLayout(names, frame)
    ours, theirs = layout.pack(STAMP, *numbers(len(names))), serialize_message(message(names, frame))
    assert len(ours) == len(theirs) == layout.size
    counts = layout.fixed.astype(bool)
    counts[4:12] = True
    for offset in layout.offsets:
        counts[offset : offset + 8 * layout.count] = True
    differ = [i for i in range(len(ours)) if ours[i] != theirs[i] and counts[i]]
    assert differ == [] and np.sum(~counts) <= 3 * (len(names) + 2) + 4 * 3


@pytest.mark.parametrize("names", NAMES, ids=len)
def test_ros_reads_what_was_packed_and_what_ros_wrote_is_unpacked(names):
    layout, arrays = JointLayout(names), numbers(len(names))
    read = deserialize_message(layout.pack(STAMP, *arrays), messages.JointState)
    assert read == message(names)
    written = serialize_message(message(names))
    assert layout.matches(written)
    sample = layout.unpack(written)
    assert sample.stamp_ns == STAMP
    assert np.array_equal([sample.position, sample.velocity, sample.effort], arrays)


def test_layouts_of_different_names_frames_or_sizes_do_not_match():
    layouts = [JointLayout(names) for names in NAMES]
    layouts += [JointLayout(NAMES[0], "base"), JointLayout(("y", *NAMES[0][1:]))]
    for layout in layouts:
        data = serialize_message(message(layout.names, "base" if layout is layouts[-2] else ""))
        assert [other.matches(data) for other in layouts] == [other is layout for other in layouts]


@few(60)
@given(st.binary(max_size=600))
def test_no_foreign_bytes_match(data):
    assert not JointLayout(NAMES[2]).matches(data)


@given(st.integers(0, 2**31 * 10**9 - 1))
def test_a_stamp_survives_the_way_there_and_back(stamp):
    layout = JointLayout(("x",))
    assert layout.unpack(layout.pack(stamp, [0.0], [0.0], [0.0])).stamp_ns == stamp
    time = messages.to_time(stamp)
    assert time.sec * 10**9 + time.nanosec == stamp


def test_tail_and_truth_have_their_published_names_in_their_order():
    tail = (
        "layout_version session sequence answered_session answered exchange_method gains_hash stiffness damping "
        "rotational_stiffness rotational_damping contact energy"
    )
    assert exchange_names(2) == ("x", "y", *tail.split())
    assert truth_names(2) == ("x", "y", "motor_x", "motor_y", "energy_given", "time", "motion_done")


def test_a_trace_describes_itself_and_holds_every_column_of_every_tick():
    rows = np.zeros(5, records.TRACE_ROW)
    rows["tick"], rows["position"] = np.arange(5), np.arange(15).reshape(5, 3)
    packed = CloudLayout(records.TRACE_ROW, "haptic_base").pack(STAMP, rows)
    cloud = deserialize_message(packed, messages.PointCloud2)
    assert messages.to_time(STAMP) == cloud.header.stamp and cloud.header.frame_id == "haptic_base"
    assert (cloud.row_step, cloud.is_dense, cloud.is_bigendian) == (rows.nbytes, True, False)
    assert (cloud.width, cloud.height, cloud.point_step) == (5, 1, records.TRACE_ROW.itemsize)
    assert {field.datatype for field in cloud.fields} == {8}
    kind = np.dtype(
        [(field.name, "f8", (field.count,)) if field.count > 1 else (field.name, "f8") for field in cloud.fields]
    )
    assert kind == records.TRACE_ROW
    assert np.frombuffer(bytes(cloud.data), kind).tobytes() == rows.tobytes()


def test_wrench_and_pose_are_planar_and_a_full_turn_is_the_identity():
    for frame in ("haptic_base", "", "abcd"):
        packed = StampedLayout(WRENCH, frame).pack(STAMP, wrench_numbers((1.0, 2.0, 3.0)))
        read = deserialize_message(packed, messages.WrenchStamped)
        force = read.wrench
        assert (force.force.x, force.force.y, force.force.z, force.torque.z) == (1.0, 2.0, 0.0, 3.0)
        assert (read.header.stamp, read.header.frame_id) == (messages.to_time(STAMP), frame)
    poses = StampedLayout(POSE, "haptic_base")
    packed = poses.pack(STAMP, pose_numbers((0.1, 0.2, math.pi / 2)))
    quarter = deserialize_message(packed, messages.PoseStamped).pose
    assert (quarter.position.x, quarter.position.y) == (0.1, 0.2)
    assert quarter.orientation.z == pytest.approx(math.sqrt(0.5)) == quarter.orientation.w
    packed = poses.pack(STAMP, pose_numbers((0.0, 0.0, 4 * math.pi)))
    turned = deserialize_message(packed, messages.PoseStamped).pose.orientation
    assert (abs(turned.w), turned.z) == (pytest.approx(1.0), pytest.approx(0.0, abs=1e-12))


def test_a_target_needs_exactly_the_axes_names_and_finite_numbers():
    def target(names, position):
        return messages.planar_target(messages.JointState(name=names, position=position), ("x", "y"))

    assert target(["x", "y"], [1.0, 2.0]) == [1.0, 2.0]
    assert target(["y", "x"], [1.0, 2.0]) == [2.0, 1.0]
    for names, position in [
        (["x"], [1.0]),
        (["x", "z"], [1.0, 2.0]),
        (["x", "y"], [1.0]),
        (["x", "y", "y"], [1.0, 2.0, 3.0]),
        ([], []),
        (["x", "y"], [1.0, math.nan]),
        (["x", "y"], [math.inf, 0.0]),
        (["x", "y", "theta"], [1.0, 2.0, 3.0]),
    ]:
        assert target(names, position) is None


def test_diagnostics_carry_level_name_and_values_as_text():
    array = messages.diagnostics(
        STAMP, "haptic_driver", "desktop", "warn", "no simulation", {"missed": 3, "state": "idle"}
    )
    [status] = array.status
    assert (status.name, status.hardware_id, status.message) == ("haptic_driver", "desktop", "no simulation")
    assert status.level == b"\x01"
    assert {entry.key: entry.value for entry in status.values} == {"missed": "3", "state": "idle"}


def test_strange_diagnostics_are_read_as_far_as_they_go():
    found = {}
    for message in STRANGE:
        found |= messages.statuses_of(message, STAMP)
    assert {name: said.level for name, said in found.items() if "haptic" not in name} == {
        "no\ufffdtext": 0,
        "seven": LEVELS.index("STALE"),
        "all bits": LEVELS.index("STALE"),
        "[/x]": 0,
    }
    assert found["[/x]"].values == {"[/x]": "[/x]"} and found["haptic_driver"].values["fault"] == "overheated"


@pytest.mark.parametrize(("text", "value"), [("2.5", 2.5), ("-1", -1.0), ("", None), ("many", None), ("[/x]", None)])
def test_a_value_that_says_no_number_is_nan(text, value):
    assert math.isnan(number(text)) if value is None else number(text) == value
