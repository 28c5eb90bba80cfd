# SPDX-License-Identifier: Apache-2.0
"""Bags as they are read, by us and by everyone's readers; what is refused; and the figures read from one."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import yaml
from bag_of_a_run import AXES, BOOT_TO_EPOCH, PERIOD_NS, SAID, TYPES, diagnostics, joints, swing, write_bag, write_run
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from haptic_device.control import records
from haptic_device.message_fields import TAIL
from haptic_device.nodes.recorded_topics import KNOWN
from haptic_device.recording import Entries, load
from haptic_device.recording.layouts import (
    CLOUD,
    DIAGNOSTICS,
    JOINTS,
    POSE,
    STRING,
    WRENCH,
    CloudLayout,
    StampedLayout,
    layout_of,
)
from haptic_device.recording.writer import Bag
from haptic_display.run.report.quantities import figures
from haptic_display.run.report.run import Run
from haptic_display.run.report.summary import engaged_rows


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("bags") / "run", swing(2000))


def test_other_readers_find_every_value_profile_time_and_sequence_and_metadata_of_version_9(run):
    rows = swing(2000)[::4]
    with AnyReader([run]) as reader:
        told = ((one, reader.deserialize(data, one.msgtype)) for one, _, data in reader.messages())
        states = [message.position[:3] for one, message in told if one.topic == "/haptic/operator/state"]
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
    assert np.array_equal(states, rows["position"])
    each = dict.fromkeys(("/haptic/handle", "/haptic/tool", "/haptic/operator/state"), 500)
    assert counts == {"/haptic/trace": 25, **each, "/diagnostics": 2}
    with open(run / "run_0.mcap", "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        found = list(reader.iter_messages(topics=["/haptic/handle"]))
        assert reader.get_header().profile == "ros2"
        assert any(record.name == "rosbag2" for record in reader.iter_metadata())
    schema, channel, message = found[-1]
    assert (schema.name, schema.encoding, channel.message_encoding) == (JOINTS, "ros2msg", "cdr")
    assert channel.metadata["topic_type_hash"] == TYPES.hash_rihs01(JOINTS)
    assert message.log_time - message.publish_time == 50_000
    assert [item[2].sequence for item in found] == list(range(1, 501))
    information = yaml.safe_load((run / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert (information["version"], information["storage_identifier"]) == (9, "mcap")
    assert information["relative_file_paths"] == ["run_0.mcap"] == [file["path"] for file in information["files"]]
    topics = information["topics_with_message_count"]
    assert information["message_count"] == sum(topic["message_count"] for topic in topics)
    assert {"name", "type", "serialization_format", "offered_qos_profiles", "type_description_hash"} == {
        *topics[0]["topic_metadata"]
    }


def test_a_recording_gives_the_trace_and_each_entry_by_name_and_shows_itself_in_one_line(run):
    recording, rows = load(run), swing(2000)
    assert (recording.namespace, recording.notes, recording.cloud_stamps) == ("/haptic", (), {})
    for name in rows.dtype.names:
        assert np.array_equal(recording.trace[name], rows[name])
    assert np.array_equal(recording.joint("tool").entry("answered"), rows["tool_answered"][::4])
    assert recording.statuses("haptic_simulation")[-1].values == SAID
    first = 100_000  # [ns] after its tick the first sample is received, the block of the last tick with it
    assert recording.seconds == pytest.approx((1999 * PERIOD_NS - first) * 1e-9, rel=1e-12)
    assert f"{recording.seconds:.3f} s" in repr(recording) and len(repr(recording)) < 400


def test_only_what_is_asked_for_is_read_and_in_the_type_asked_for(run):
    wanted = np.dtype([("deadline", "f8"), ("position", "f4", (3,)), ("no_such", "f4")])
    recording = load(run, only={"trace": wanted, "handle": Entries(("stiffness",), ("position",))})
    assert recording.trace.dtype == wanted and set(recording.joints) == {"handle"}
    assert np.array_equal(recording.trace["position"], swing(2000)["position"].astype("f4"))
    assert np.isnan(recording.trace["no_such"]).all() and "trace has no no_such" in recording.notes[0]
    assert recording.joint("handle").names == ("stiffness",)
    assert set(recording.joint("handle").entry("stiffness")) == {1000.0}
    assert recording.counts["/haptic/tool"] == 500
    known = dict.fromkeys(name for name in KNOWN if not name.startswith("/"))  # what the recorder waits for
    assert load(run, only=known).clouds.keys() == {"trace"}


def test_columns_of_older_bags_have_the_names_of_today(tmp_path):
    rows = np.zeros(2, [("tick", "f8"), ("warmth", "f8", (3,)), ("exchange_let_go", "f8")])
    rows["warmth"], rows["exchange_let_go"] = 0.5, (1.0, 2.0)
    trace = load(write_bag(tmp_path / "older", ("/haptic/trace", CLOUD, CloudLayout(rows.dtype).pack(0, rows)))).trace
    assert trace["thermal_load"].tolist() == [[0.5] * 3] * 2
    assert trace["exchange_released"].tolist() == [1.0, 2.0]


def test_counts_beyond_what_a_float32_holds_come_back_exactly(tmp_path):
    rows = np.zeros(3, records.TRACE_ROW)
    counting = [name for name in rows.dtype.names if rows.dtype[name].shape == () and name != "deadline"]
    for name in counting:
        rows[name] = 2**24 + np.arange(1, 4)
    rows["deadline"] = 1e9 * np.arange(1, 4)
    names = (*AXES, *TAIL)
    trace = "/haptic/trace", CLOUD, CloudLayout(rows.dtype).pack(0, rows), 2**24 + 1
    handle = "/haptic/handle", JOINTS, joints(names, np.full(len(names), 2.0**24 + 1), 0), 2**24 + 1
    recording = load(write_bag(tmp_path / "long", trace, handle))
    flat = recording.to_dataframe("trace")
    for name in counting:
        assert recording.trace[name].tolist() == flat[name].tolist() == [2**24 + 1, 2**24 + 2, 2**24 + 3]
    assert recording.joint("handle").entry("sequence").tolist() == [2**24 + 1]
    assert recording.joint("handle").sequence.tolist() == [2**24 + 1]


def test_all_times_meet_on_the_monotonic_clock_and_a_clock_set_meanwhile_moves_no_data(tmp_path, run):
    recording = load(run)
    state = recording.joint("operator/state")
    assert np.array_equal(recording.monotonic(state.stamp), np.round(state.entry("time") * 1e9))
    assert np.array_equal(recording.monotonic(state.stamp), state.stamp - BOOT_TO_EPOCH)
    recording = load(write_run(tmp_path / "run", swing(20000)))
    system, monotonic = recording.pairs
    jump = np.where(monotonic > monotonic[len(monotonic) // 2], 500_000_000, 0)  # a second's half forward, midway
    moved = replace(recording, pairs=(system + jump, monotonic))
    assert np.percentile(np.abs(moved.monotonic(system + jump) - monotonic), 75) < 1_000


def test_rows_missing_from_the_trace_are_counted_and_none_without_a_gap(tmp_path, run):
    rows = swing(400)
    write_run(tmp_path / "gap", np.concatenate([rows[:100], rows[107:]]))
    assert load(tmp_path / "gap").trace_rows_missing == 7
    assert load(run).trace_rows_missing == 0


@given(
    st.lists(st.text("abxyz_θ", min_size=1, max_size=9), min_size=1, max_size=6, unique=True),
    st.lists(st.floats(allow_nan=False), min_size=1, max_size=4),
    st.integers(0, 2**31 * 10**9 - 1),
)
def test_joint_states_of_any_names_and_values_decode_like_the_reference_decoder(names, values, stamp):
    position = np.resize(values, len(names))
    data = [joints(names, position * factor, stamp, effort=position) for factor in (1.0, 0.5)]
    layout = layout_of(JOINTS, data[0])
    stamps, positions, velocities, efforts = layout.arrays(data)
    expected = [TYPES.deserialize_cdr(item, JOINTS) for item in data]
    assert all(map(layout.matches, data)) and layout.names == tuple(names) and list(stamps) == [stamp, stamp]
    assert np.array_equal(positions, [item.position for item in expected])
    assert np.array_equal(efforts, [item.effort for item in expected]) and not velocities.any()


def test_the_options_of_a_message_that_another_writer_has_set_do_not_matter():
    data = joints(("x",), [1.0], 0)
    foreign = data[:2] + b"\x00\x03" + data[4:]  # DDS: how many bytes of padding stand at the end
    for first, second in ((data, foreign), (foreign, data)):
        assert layout_of(JOINTS, first).matches(second)
    assert not layout_of(JOINTS, data).matches(b"\x00\x00" + data[2:])


def stamped(kind, frame, stamp_ns, *numbers):
    """A serialized WrenchStamped or PoseStamped with these numbers after its header."""
    message = TYPES.deserialize_cdr(StampedLayout(kind, frame).pack(stamp_ns, numbers), kind)
    return bytes(TYPES.serialize_cdr(message, kind))


ENCODER = "/haptic/encoder", JOINTS, joints(("x",), [1.0], 0)
CUT = stamped(WRENCH, "", 0, *range(6))[:-8]


@pytest.mark.parametrize("topic, kind, data", [("trace", CLOUD, b""), ("mark", STRING, b""), ("wrench", WRENCH, CUT)])
def test_messages_without_content_and_strange_diagnostics_are_left_out_in_a_sentence(tmp_path, topic, kind, data):
    odd = "/diagnostics", STRING, b"\0\1\0\0\2\0\0\0a\0"
    recording = load(write_bag(tmp_path / "odd", *((f"/haptic/{topic}", kind, data), ENCODER, odd) * 3))
    assert recording.joint("encoder").entry("x").tolist() == [1.0] * 3 and not recording.diagnostics
    assert sum(f"topic {name}" in note for note in recording.notes for name in (f"/haptic/{topic}", topic)) == 1
    assert any("diagnostics is left out: it is std_msgs/msg/String" in note for note in recording.notes)


def test_what_is_no_bag_is_refused_in_a_sentence_that_names_it(tmp_path):
    (tmp_path / "empty.mcap").write_bytes(b"")
    (tmp_path / "text.mcap").write_text("not a bag at all")
    write_bag(tmp_path / "foreign", ("/joint_states", JOINTS, joints(AXES, [1, 2, 3], 0)))
    with pytest.raises(FileNotFoundError, match="does not exist"):
        load(tmp_path / "missing")
    write_run(tmp_path / "corner_run" / "bag", swing(80))
    for name, said in (
        ("empty.mcap", "empty.mcap"),
        ("text.mcap", "text.mcap"),
        ("foreign", "foreign"),
        ("corner_run", rf"holds no \.mcap file.*; did you mean {tmp_path}/corner_run/bag\?$"),
    ):
        with pytest.raises(ValueError, match=said):
            load(tmp_path / name)
    with pytest.raises(ValueError, match="not empty"):
        Bag(tmp_path)
    with pytest.raises(ValueError, match="no_such_msgs/msg/Thing"):
        Bag(tmp_path / "new").add_topic("/thing", "no_such_msgs/msg/Thing", [])


def test_what_a_bag_lacks_is_refused_with_what_it_has(run):
    recording, has = load(run), "under /haptic; it has the JointState topics handle"
    for refused, said in (
        (lambda: load(run, "/hap"), "has no namespace /hap; it has /haptic$"),
        (lambda: load(run, only={"trase": None}), "trase, which bag .* lacks; it has handle, operator/state, tool, tr"),
        (lambda: recording.joint("trace"), f"no JointState topic trace {has}, tool, operator/state and the clouds tr"),
        (lambda: load(run, only={"handle": None}).trace, f"no topic trace {has}$"),
        (lambda: recording.to_dataframe("trace", "excel"), "^library excel is none of pandas, polars$"),
    ):
        with pytest.raises(ValueError, match=said):
            refused()
    recording = load(run, only={"handle": None, "scene/contacts": None})  # as a bag made in lock-step lacks it
    assert set(recording.joints) == {"handle"} and recording.clouds == {} and recording.notes == ()


def test_of_several_devices_in_one_bag_one_is_asked_for_and_has_what_its_own_nodes_have_said(tmp_path):
    messages = []
    for namespace in ("/left", "/right"):
        said = diagnostics("haptic_driver", {"namespace": namespace, "state": f"that of {namespace}"})
        messages += [(f"{namespace}/handle", JOINTS, joints(("x",), [1.0], 1)), ("/diagnostics", DIAGNOSTICS, said)]
    write_bag(tmp_path / "two", *messages)
    with pytest.raises(ValueError, match="/left, /right"):
        load(tmp_path / "two")
    for namespace in ("/left", "/right"):
        [status] = load(tmp_path / "two", namespace).statuses("haptic_driver")
        assert status.values["state"] == f"that of {namespace}"


@pytest.mark.parametrize("frame", ["", "haptic_base"])
def test_wrench_and_pose_come_back_by_the_names_of_their_fields_and_a_part_that_they_lack_is_refused(tmp_path, frame):
    force, pose = np.arange(6) + 0.5, np.arange(7) - 0.25
    messages = [
        (f"/haptic/{topic}", kind, stamped(kind, frame, sequence * 10**9 + 7, *sequence * numbers), sequence)
        for topic, kind, numbers in (("wrench", WRENCH, force), ("pose", POSE, pose))
        for sequence in (1, 2, 3)
    ]
    recording = load(write_bag(tmp_path / "run", *messages))
    wrench, place = recording.joint("wrench"), recording.joint("pose")
    assert wrench.names[2:4] == ("force.z", "torque.x") and place.names[-1] == "orientation.w"
    assert np.array_equal(wrench.effort, np.outer((1, 2, 3), force)) and wrench.position.size == 0
    assert np.array_equal(place.position, np.outer((1, 2, 3), pose)) and place.velocity.size == 0
    assert np.array_equal(place.stamp, [10**9 + 7, 2 * 10**9 + 7, 3 * 10**9 + 7])
    with pytest.raises(ValueError, match=r"^the topic has no position of force\.x; it has effort$"):
        wrench.entry("force.x")


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_a_topic_becomes_a_data_frame_over_the_one_clock(run, library):
    recording, rows = load(run), swing(2000)
    trace = recording.to_dataframe("trace", library)
    assert np.array_equal(trace["position.x"].to_numpy(), rows["position"][:, 0])
    assert np.array_equal(trace["time"].to_numpy(), rows["deadline"] * 1e-9)
    state = recording.to_dataframe("operator/state", library)
    assert np.array_equal(state["x.position"].to_numpy(), rows["position"][::4, 0])
    assert state["time"].to_numpy() == pytest.approx(rows["deadline"][::4] * 1e-9, abs=1e-9)


def test_each_row_of_a_cloud_without_deadlines_has_the_time_of_its_message(tmp_path):
    contact = np.dtype([("body_a", "f8"), ("force_x", "f8")])
    messages = []
    for number, (time, count) in enumerate(((5.0, 2), (5.25, 0), (5.5, 1)), 1):
        stamp = BOOT_TO_EPOCH + round(time * 1e9)
        rows = CloudLayout(contact).pack(stamp, np.full(count, number, contact))
        messages.append(("/haptic/operator/state", JOINTS, joints(("time",), [time], stamp), number, stamp))
        messages.append(("/haptic/scene/contacts", CLOUD, rows, number, stamp))
    recording = load(write_bag(tmp_path / "run", *messages))
    frame = recording.to_dataframe("scene/contacts")
    assert list(frame) == ["time", "body_a", "force_x"]
    assert frame["time"].to_list() == [5.0, 5.0, 5.5] and frame["body_a"].to_list() == [1.0, 1.0, 3.0]
    assert (recording.cloud_stamps["scene/contacts"] - BOOT_TO_EPOCH).tolist() == [5 * 10**9, 5 * 10**9, 55 * 10**8]


def of_rows(run, rows):
    """The figures of a bag as if these were its rows."""
    return figures(Run(replace(load(run), clouds={"trace": rows}), "run"))


def test_figures_of_the_servo_and_of_the_exchange_are_those_of_the_run(run):
    rows = swing(1000)
    rows["missed"][500:], rows["lateness"][-1] = 3, 70e-6
    servo = of_rows(run, rows)["servo"]
    assert servo["rate_hz"] == pytest.approx(1e9 / PERIOD_NS) and (servo["ticks"], servo["missed"]) == (1000, 3)
    assert servo["lateness_us"]["p50"] == pytest.approx(8) and servo["lateness_us"]["max"] == pytest.approx(70)
    found = of_rows(run, swing(2000))
    exchange, energy = found["exchange"], found["energy_j"]
    assert (exchange["sent"], exchange["answered"]) == (500, 499)  # the last one's answer lies beyond the end
    assert exchange["rate_hz"] == pytest.approx(1000, rel=2e-3) and exchange["age_ms"]["p50"] == pytest.approx(1.5)
    assert energy["given_to_operator_max"] == 0.0 and energy["given_to_operator_end"] == pytest.approx(-0.499)
    assert energy["tool_port_end"] == 0.125
    rows["engage"] = 0
    with pytest.raises(ValueError, match="0 with the motor engaged"):
        engaged_rows(rows)


def test_forces_of_handle_and_tool_differ_by_exactly_what_age_explains_and_a_wrong_sign_is_not_explained(run):
    rows = swing(2000)
    found = of_rows(run, rows)["residual"]
    assert found["rms_n"] > 0.1
    assert found["explained_by_age_n"] == pytest.approx(found["rms_n"], rel=1e-9)
    assert found["unexplained_n"] < 1e-9
    rows["tool_effort"] *= -1
    found = of_rows(run, rows)["residual"]
    assert found["unexplained_n"] > found["explained_by_age_n"]


_WITHOUT_ROS = """
import sys

SRV = ("rclpy", "rpyutils", "rcl_interfaces", "builtin_interfaces", "std_srvs", "lifecycle_msgs")
MSGS = ("sensor_msgs", "std_msgs", "geometry_msgs", "diagnostic_msgs", "visualization_msgs")
sys.modules |= dict.fromkeys(SRV + MSGS)  # none can be imported
import haptic_device.recording.layouts
assert {"mcap", "rosbags", "yaml"}.isdisjoint(sys.modules), "who only packs messages needs no reader"
from haptic_display.run.report import page
from haptic_device.recording import load
from haptic_display.cli.main import main

page.FIGURES = page.FIGURES[:1]
assert load(sys.argv[1]).to_dataframe("trace")["position.x"].std() > 0
sys.argv[1:] = ["report", sys.argv[1], "--out", sys.argv[2]]
main()
"""


def test_a_bag_is_read_and_reported_where_nothing_of_ros_can_be_imported(run, tmp_path):
    words = [sys.executable, "-c", _WITHOUT_ROS, str(run), str(tmp_path / "report")]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=100)
    assert ended.returncode == 0, ended.stderr
    assert (tmp_path / "report" / "report.html").read_text(encoding="utf-8").count("data:image/png;base64,") == 1
