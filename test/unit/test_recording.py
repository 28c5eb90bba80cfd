# SPDX-License-Identifier: Apache-2.0
"""Bags: what is written is read, by us and by everyone's readers, whole or cut off; and the figures read from one."""

import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import yaml
from bag_of_a_run import (
    AXES,
    BOOT_TO_EPOCH,
    CLOUD,
    DIAGNOSTICS,
    PERIOD_NS,
    SAID,
    TYPES,
    diagnostics,
    joints,
    swing,
    write_bag,
    write_run,
)
from examples import few
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from haptic_device.analysis.report import summary
from haptic_device.analysis.report.reading import read_run
from haptic_device.analysis.report.table import sections
from haptic_device.control import records
from haptic_device.message_fields import TAIL
from haptic_device.recording import ENTRY_UNITS, TRACE_UNITS, Entries, Joints, load
from haptic_device.recording.layouts import JOINTS, POSE, STRING, WRENCH, CloudLayout, StampedLayout, layout_of
from haptic_device.recording.writer import Bag
from haptic_sim import outcome
from haptic_sim.cli import tables


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("bags") / "run", swing(2000))


def test_rosbags_reads_every_value_that_was_written(run):
    with AnyReader([run]) as reader:
        states = [
            reader.deserialize(data, connection.msgtype)
            for connection, _, data in reader.messages()
            if connection.topic == "/haptic/operator/state"
        ]
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
    rows = swing(2000)[::4]
    assert np.array_equal([state.position[:3] for state in states], rows["position"])
    each = dict.fromkeys(("/haptic/handle", "/haptic/tool", "/haptic/operator/state"), 500)
    assert counts == {"/haptic/trace": 25, **each, "/diagnostics": 2}


def test_the_mcap_library_finds_profile_schemas_times_and_sequences(run):
    with open(run / "run_0.mcap", "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        found = list(reader.iter_messages(topics=["/haptic/handle"]))
        schema, channel, message = found[-1]
        assert (schema.name, schema.encoding, channel.message_encoding) == (JOINTS, "ros2msg", "cdr")
        assert channel.metadata["topic_type_hash"] == TYPES.hash_rihs01(JOINTS)
        assert message.log_time - message.publish_time == 50_000
        assert [item[2].sequence for item in found] == list(range(1, 501))
        assert any(record.name == "rosbag2" for record in reader.iter_metadata())


def test_metadata_has_every_field_of_rosbag2_version_9(run):
    information = yaml.safe_load((run / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert information["version"] == 9 and information["storage_identifier"] == "mcap"
    assert information["relative_file_paths"] == ["run_0.mcap"] == [file["path"] for file in information["files"]]
    assert information["message_count"] == sum(t["message_count"] for t in information["topics_with_message_count"])
    topic = information["topics_with_message_count"][0]["topic_metadata"]
    assert set(topic) == {"name", "type", "serialization_format", "offered_qos_profiles", "type_description_hash"}
    assert {"duration", "starting_time", "compression_format", "compression_mode", "custom_data", "ros_distro"} <= set(
        information
    )


def test_a_recording_gives_the_trace_and_each_entry_by_name(run):
    recording, rows = load(run), swing(2000)
    assert recording.namespace == "/haptic" and recording.notes == ()
    for name in rows.dtype.names:
        assert np.array_equal(recording.trace[name], rows[name])
    assert np.array_equal(recording.joint("tool").entry("answered"), rows["tool_answered"][::4])
    assert recording.statuses("haptic_simulation")[-1].values == SAID


def test_a_recording_shows_itself_in_one_line_and_so_does_a_topic_of_it(run):
    recording = load(run)
    shown, last = repr(recording), len(recording.trace) - 1
    assert len(shown) < 400 and "\n" not in shown and str(run) in shown and "/haptic" in shown
    assert f"trace {recording.counts['/haptic/trace']}" in shown and f"{recording.seconds:.3f} s" in shown
    first = 100_000  # [ns] after its tick the first sample is received, the block of the last tick with it
    assert recording.seconds == pytest.approx((last * PERIOD_NS - first) * 1e-9, rel=1e-12)
    assert repr(recording.joint("handle")).startswith(f"Joints({len(recording.joint('handle').stamp)} messages of x, y")


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


def test_reading_is_not_loaded_by_who_only_packs_messages():
    code = "import sys, haptic_device.recording.layouts; print({'mcap', 'rosbags', 'yaml'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "set()\n", done.stderr


def test_all_times_meet_on_the_monotonic_clock(run):
    recording = load(run)
    state = recording.joint("operator/state")
    truth = np.round(state.entry("time") * 1e9)
    assert np.array_equal(recording.monotonic(state.stamp), truth)
    assert np.array_equal(recording.monotonic(state.stamp), state.stamp - BOOT_TO_EPOCH)


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


def test_a_writer_killed_leaves_all_that_was_flushed_readable_and_nothing_half(tmp_path):
    """What stands in the file, while what the writer has not flushed is its own."""
    bag = Bag(tmp_path / "writing")
    channel = bag.add_topic("/haptic/encoder", JOINTS, [])
    for number in range(1, 351):
        bag.write(channel, joints(("x",), [number], number), number, number, number)
        if number % 100 == 0:
            bag.flush()
    shutil.copytree(tmp_path / "writing", tmp_path / "killed")
    bag.close({})
    recording = load(tmp_path / "killed")
    assert recording.joint("encoder").entry("x").tolist() == list(range(1, 301))
    assert "ends without its index" in recording.notes[0] and not (tmp_path / "killed" / "metadata.yaml").exists()


@few(12)
@given(st.floats(0, 1, exclude_max=True))
def test_a_bag_cut_anywhere_gives_its_whole_blocks_or_one_sentence(run, fraction):
    data = (run / "run_0.mcap").read_bytes()
    cut = run.parent / "cut.mcap"
    cut.write_bytes(data[: int(fraction * len(data))])
    try:
        recording = load(cut)
    except ValueError as error:
        assert str(cut) in str(error) and "\n" not in str(error)
        return
    whole = swing(2000)["tick"]
    if "trace" in recording.clouds:
        assert np.array_equal(recording.trace["tick"], whole[: len(recording.trace)])


def test_damage_in_a_chunk_keeps_what_stands_before_it(run, tmp_path):
    data = bytearray((run / "run_0.mcap").read_bytes())
    with open(run / "run_0.mcap", "rb") as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[1]
    middle = chunk.chunk_start_offset + chunk.chunk_length // 2
    data[middle] ^= 0xFF
    (tmp_path / "damaged.mcap").write_bytes(data)
    recording = load(tmp_path / "damaged.mcap")
    assert 0 < len(recording.trace) < 2000 and "is damaged" in recording.notes[0]


def test_what_is_no_bag_is_refused_in_a_sentence_that_names_it(tmp_path):
    (tmp_path / "empty.mcap").write_bytes(b"")
    (tmp_path / "text.mcap").write_text("not a bag at all")
    (tmp_path / "folder").mkdir()
    write_bag(tmp_path / "silent")
    write_bag(tmp_path / "foreign", ("/joint_states", JOINTS, joints(AXES, [1, 2, 3], 0)))
    with pytest.raises(FileNotFoundError, match="does not exist"):
        load(tmp_path / "missing")
    for name in ("empty.mcap", "text.mcap", "folder", "silent", "foreign"):
        with pytest.raises(ValueError, match=name):
            load(tmp_path / name)


@pytest.mark.parametrize("topic, type_name", [("handle", JOINTS), ("trace", CLOUD), ("mark", STRING)])
def test_messages_without_content_and_strange_diagnostics_are_left_out_in_a_sentence(tmp_path, topic, type_name):
    said = []
    for number in range(1, 4):
        said.append((f"/haptic/{topic}", type_name, b"", number, number))
        said.append(("/haptic/encoder", JOINTS, joints(("x",), [number], 0), number, number))
        said.append(("/diagnostics", STRING, b"\0\1\0\0\2\0\0\0a\0", number, number))
    recording = load(write_bag(tmp_path / "odd", *said))
    assert recording.joint("encoder").entry("x").tolist() == [1, 2, 3] and not recording.diagnostics
    assert sum(f"topic {name}" in note for note in recording.notes for name in (f"/haptic/{topic}", topic)) == 1
    assert any("diagnostics is left out: it is std_msgs/msg/String" in note for note in recording.notes)


def test_several_devices_in_one_bag_need_a_namespace(tmp_path):
    sides = [(f"/{side}/encoder", JOINTS, joints(("x",), [side == "left"], 0)) for side in ("left", "right")]
    write_bag(tmp_path / "two", *sides)
    with pytest.raises(ValueError, match="/left, /right"):
        load(tmp_path / "two")
    assert load(tmp_path / "two", "/right").joint("encoder").entry("x")[0] == 0


@pytest.mark.parametrize(("namespace", "said"), [("/left", "/left"), ("haptic", "haptic"), ("/hap", "/hap")])
def test_a_namespace_that_a_bag_lacks_is_refused_with_those_that_it_has(run, namespace, said):
    with pytest.raises(ValueError, match=f"has no namespace {said}; it has /haptic$"):
        load(run, namespace)


def test_a_topic_that_only_asks_for_is_refused_where_neither_bag_nor_project_has_it(run):
    with pytest.raises(
        ValueError, match="only names trase, which bag .* lacks; it has handle, operator/state, tool, trace"
    ):
        load(run, only={"trase": None, "handle": None})
    recording = load(run, only={"handle": None, "scene/contacts": None})  # as a bag made in lock-step lacks it
    assert set(recording.joints) == {"handle"} and recording.clouds == {} and recording.notes == ()
    for wrong in (["trace"], "trace"):
        with pytest.raises(TypeError, match="only is a (list|str), not a mapping of topics such as {'trace': None}"):
            load(run, only=wrong)


def test_every_topic_that_the_recorder_waits_for_may_be_asked_for(run):
    from haptic_device.nodes.recorded_topics import KNOWN

    asked = dict.fromkeys(name for name in KNOWN if not name.startswith("/"))
    assert load(run, only=asked).clouds.keys() == {"trace"}


def test_a_topic_that_a_bag_lacks_is_refused_with_all_that_it_has(run):
    recording = load(run)
    has = "under /haptic; it has the JointState topics handle, tool, operator/state and the clouds trace$"
    for refused, said in (
        (lambda: recording.joint("trace"), "no JointState topic trace"),
        (lambda: recording.to_dataframe("wall"), "no topic wall"),
        (lambda: load(run, only={"handle": None}).trace, "no topic trace"),
    ):
        with pytest.raises(ValueError, match=said) as caught:
            refused()
    assert str(caught.value).endswith("it has the JointState topics handle")
    with pytest.raises(ValueError, match=has):
        recording.joint("trace")
    with pytest.raises(ValueError, match="^library excel is none of pandas, polars$"):
        recording.to_dataframe("trace", "excel")


def test_a_bag_refuses_a_folder_in_use_and_a_type_it_cannot_describe(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(ValueError, match="not empty"):
        Bag(tmp_path)
    with pytest.raises(ValueError, match="no_such_msgs/msg/Thing"):
        Bag(tmp_path / "new").add_topic("/thing", "no_such_msgs/msg/Thing", [])


def test_servo_figures_count_missed_ticks_and_turn_seconds_into_microseconds():
    rows = swing(1000)
    rows["missed"][500:] = 3
    rows["lateness"][-1] = 70e-6
    figures = summary.servo_figures(rows)
    assert figures["rate_hz"] == pytest.approx(1e9 / PERIOD_NS) and (figures["ticks"], figures["missed"]) == (1000, 3)
    assert figures["lateness_us"]["p50"] == pytest.approx(8) and figures["lateness_us"]["max"] == pytest.approx(70)


def test_an_unanswered_handle_sample_is_sent_but_not_answered(run):
    recording = load(run)
    figures = summary.exchange_figures(recording, recording.trace)
    assert (figures["sent"], figures["answered"]) == (500, 499)  # the last one's answer lies beyond the end
    assert figures["rate_hz"] == pytest.approx(1000, rel=2e-3) and figures["age_ms"]["p50"] == pytest.approx(1.5)


def test_forces_of_handle_and_tool_differ_by_exactly_what_age_explains(run):
    figures = summary.residual_figures(load(run), swing(2000))
    assert figures["rms_n"] > 0.1
    assert figures["explained_by_age_n"] == pytest.approx(figures["rms_n"], rel=1e-9)
    assert figures["unexplained_n"] < 1e-9


def test_a_force_with_the_wrong_sign_cannot_be_explained_by_age(run):
    rows = swing(2000)
    rows["tool_effort"] *= -1
    figures = summary.residual_figures(load(run), rows)
    assert figures["unexplained_n"] > figures["explained_by_age_n"]


def test_energy_figures_are_those_of_the_truth(run):
    figures = summary.energy_figures(load(run), swing(2000))
    assert figures["given_to_operator_max"] == 0.0 and figures["given_to_operator_end"] == pytest.approx(-0.499)
    assert figures["tool_port_end"] == 0.125


def test_what_a_scene_measures_is_told_by_its_last_and_its_greatest_value(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(SAID, "result.pressed", "0.1")
    recording = load(write_run(tmp_path / "run", swing(2000)))
    times, none = np.arange(3), np.zeros((3, 1))
    shown = Joints(("result.pressed",), times, times, times, times, np.array([[0.0], [3.25], [np.nan]]), none, none)
    recording = replace(recording, joints=recording.joints | {"scene/state": shown})
    found = outcome.figures(recording, 0.0)
    assert (found["result"], found["result_greatest"]) == ({"pressed": 0.1}, {"pressed": 3.25})
    tables.print_outcome({"scene": "wall", "done": True, "why": "", **found, "bag": None, "report": None})
    said = capsys.readouterr().out
    assert "last 0.1, greatest 3.25" in said and "result_greatest" not in said


def test_demo_and_report_have_the_same_words_and_numbers_for_the_strongest_forces(run, capsys):
    recording = load(run)
    figures = outcome.figures(recording, 0.0)
    tables.print_outcome({"scene": "wall", "done": True, "why": "", **figures, "bag": None, "report": None})
    said = capsys.readouterr().out
    told = sections(read_run(run))["Contact"]
    assert figures["contact"]["max_force_n"] == 2.5 and told["strongest contact"] == "2.5 N"
    rows = summary.engaged_rows(recording.trace)
    strongest = np.hypot(*rows["force_on_handle"][:, :2].T).max()
    assert figures["contact"]["max_on_hand_n"] == strongest and told["strongest on the hand"] == f"{strongest:.3g} N"
    for words in ("strongest contact", "strongest on the hand", "deepest overlap"):
        assert words in told and words in said


def test_of_the_folder_of_a_run_the_bag_in_it_is_named(tmp_path):
    write_run(tmp_path / "corner_run" / "bag", swing(80))
    with pytest.raises(ValueError, match=rf"holds no \.mcap file.*; did you mean {tmp_path}/corner_run/bag\?$"):
        load(tmp_path / "corner_run")
    (tmp_path / "other" / "bag").mkdir(parents=True)
    with pytest.raises(ValueError, match=r"so it is no bag of this kind$"):
        load(tmp_path / "other")


def test_demo_and_report_have_the_same_energy_given_to_the_tool_and_tell_it_from_that_of_the_samples(run, capsys):
    figures = outcome.figures(load(run), 0.0)
    tables.print_outcome({"scene": "wall", "done": True, "why": "", **figures, "bag": None, "report": None})
    told, name = sections(read_run(run))["Energy"], "given to the tool, at the end"
    assert figures["energy_j"]["tool_port_end"] == 0.125 and told[name] == "125 mJ"
    [said] = [line for line in capsys.readouterr().out.splitlines() if f"energy {name}" in line]
    assert told[name] in said
    assert told["given to the tool, by the samples at the servo, end"] == "0 J"  # the tool of this bag stands still


def test_a_motor_that_never_engaged_has_no_figures():
    rows = swing(10)
    rows["engage"] = 0
    with pytest.raises(ValueError, match="0 with the motor engaged"):
        summary.engaged_rows(rows)


def test_the_picture_of_a_run_is_of_readable_size_and_shows_all_its_panels(run, tmp_path, monkeypatch):
    from matplotlib.image import imread

    from haptic_device.analysis.report import figures
    from haptic_device.analysis.report.run import Run

    drawn = []
    with monkeypatch.context() as open_still:
        open_still.setattr(figures.pyplot, "close", drawn.append)
        figures.draw_picture(Run(load(run), "a swing"), tmp_path / "report.png")
    height, width, _ = imread(tmp_path / "report.png").shape
    assert height > 1000 and width > 800
    said = [text.get_text() for axes in drawn[0].axes for text in axes.texts]
    figures.pyplot.close(drawn[0])
    assert [text for text in said if "not shown" in text] == []


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_a_topic_becomes_a_data_frame_over_the_one_clock(run, library):
    pytest.importorskip(library)
    recording, rows = load(run), swing(2000)
    trace = recording.to_dataframe("trace", library)
    assert np.array_equal(trace["position.x"].to_numpy(), rows["position"][:, 0])
    assert np.array_equal(trace["time"].to_numpy(), rows["deadline"] * 1e-9)
    state = recording.to_dataframe("operator/state", library)
    assert np.array_equal(state["x.position"].to_numpy(), rows["position"][::4, 0])
    assert state["time"].to_numpy() == pytest.approx(rows["deadline"][::4] * 1e-9, abs=1e-9)


def test_each_row_of_a_cloud_without_deadlines_has_the_time_of_its_message(tmp_path):
    contact = np.dtype([("body_a", "f8"), ("force_x", "f8")])
    times, messages = (5.0, 5.25, 5.5), []
    for number, (time, count) in enumerate(zip(times, (2, 0, 1), strict=True), 1):
        stamp = BOOT_TO_EPOCH + round(time * 1e9)
        rows = np.full(count, number, contact)
        state = joints(("time",), [time], stamp)
        messages += [
            ("/haptic/operator/state", JOINTS, state, number, stamp),
            ("/haptic/scene/contacts", CLOUD, CloudLayout(contact).pack(stamp, rows), number, stamp),
        ]
    recording = load(write_bag(tmp_path / "run", *messages))
    frame = recording.to_dataframe("scene/contacts")
    assert list(frame) == ["time", "body_a", "force_x"] and len(frame) == len(recording.clouds["scene/contacts"]) == 3
    assert frame["time"].to_list() == [5.0, 5.0, 5.5] and frame["body_a"].to_list() == [1.0, 1.0, 3.0]
    assert (recording.cloud_stamps["scene/contacts"] - BOOT_TO_EPOCH).tolist() == [5 * 10**9, 5 * 10**9, 55 * 10**8]


def test_rows_with_deadlines_of_their_own_take_no_time_of_a_message(run):
    assert load(run).cloud_stamps == {}


def test_every_column_of_the_trace_has_its_unit_or_counts():
    from haptic_device.control.records import TRACE_ROW

    plain = {name for name in TRACE_ROW.names if name not in TRACE_UNITS}
    counted = "tick missed parameter_version command counts device_status tool_session tool_sequence tool_answered"
    counted += " tool_contact contact_set handle_sequence engage exchange_fade exchange_shortened exchange_released"
    counted += " cancellation_fade injections state fault thermal_load withheld"
    counted += " local local_fallbacks local_stays local_pivots"
    assert plain == set(counted.split())


def test_every_entry_of_a_joint_state_is_an_axis_or_has_its_unit_or_counts():
    from haptic_device.message_fields import exchange_names, truth_names

    others = {*exchange_names(3), *truth_names(3)} - {*AXES, *(f"motor_{axis}" for axis in AXES)}
    counted = "layout_version session sequence answered_session answered exchange_method gains_hash contact motion_done"
    assert others - set(ENTRY_UNITS) == set(counted.split())
    assert (ENTRY_UNITS["energy_given"], ENTRY_UNITS["stiffness"], ENTRY_UNITS["damping"]) == ("J", "N/m", "N s/m")


def stamped(kind, frame, stamp_ns, *numbers):
    """A serialized WrenchStamped or PoseStamped with these numbers after its header."""
    message = TYPES.deserialize_cdr(StampedLayout(kind, frame).pack(stamp_ns, numbers), kind)
    return bytes(TYPES.serialize_cdr(message, kind))


def test_a_bag_of_two_displays_gives_each_what_its_own_nodes_have_said(tmp_path):
    messages = []
    for namespace in ("/left", "/right"):
        said = diagnostics("haptic_driver", {"namespace": namespace, "state": f"that of {namespace}"})
        messages += [(f"{namespace}/handle", JOINTS, joints(("x",), [1.0], 1)), ("/diagnostics", DIAGNOSTICS, said)]
    write_bag(tmp_path / "two", *messages)
    for namespace in ("/left", "/right"):
        [status] = load(tmp_path / "two", namespace).statuses("haptic_driver")
        assert status.values["state"] == f"that of {namespace}"


@pytest.mark.parametrize("frame", ["", "haptic_base", "a"])
def test_wrench_and_pose_come_back_by_the_names_of_their_fields(tmp_path, frame):
    force, pose = np.arange(6) + 0.5, np.arange(7) - 0.25
    bag = Bag(tmp_path / "run")
    for topic, kind, numbers in (("wrench", WRENCH, force), ("pose", POSE, pose)):
        channel = bag.add_topic(f"/haptic/{topic}", kind, [])
        for sequence in (1, 2, 3):
            bag.write(channel, stamped(kind, frame, sequence * 10**9 + 7, *sequence * numbers), 1, 1, sequence)
    state = joints(("time",), [1.0], 0)
    bag.write(bag.add_topic("/haptic/operator/state", JOINTS, []), state, 1, BOOT_TO_EPOCH + 10**9, 1)
    bag.close({})
    recording = load(tmp_path / "run")
    wrench, place = recording.joint("wrench"), recording.joint("pose")
    assert wrench.names[2:4] == ("force.z", "torque.x") and place.names[-1] == "orientation.w"
    assert np.array_equal(wrench.effort, np.outer((1, 2, 3), force)) and wrench.position.size == 0
    assert np.array_equal(place.position, np.outer((1, 2, 3), pose)) and place.velocity.size == 0
    assert np.array_equal(place.stamp, [10**9 + 7, 2 * 10**9 + 7, 3 * 10**9 + 7])
    assert set(recording.columns("wrench")) == {"time", *(f"{name}.effort" for name in wrench.names)}


def test_a_part_that_a_topic_lacks_is_refused_with_those_that_it_has(tmp_path):
    wrench = "/haptic/wrench", WRENCH, stamped(WRENCH, "", 0, *range(6))
    pose = "/haptic/pose", POSE, stamped(POSE, "", 0, *range(7))
    recording = load(write_bag(tmp_path / "run", wrench, pose))
    with pytest.raises(ValueError, match=r"^the topic has no position of force\.x; it has effort$"):
        recording.joint("wrench").entry("force.x")
    assert recording.joint("wrench").entry("force.x", "effort").tolist() == [0.0]
    for part in ("velocity", "effort", "force"):
        with pytest.raises(ValueError, match=rf"^the topic has no {part} of position\.x; it has position$"):
            recording.joint("pose").entry("position.x", part)
    with pytest.raises(ValueError, match="no entry force; it has force.x, force.y"):
        recording.joint("wrench").entry("force", "effort")


def test_a_wrench_cut_off_is_left_out_and_the_rest_is_read(tmp_path):
    cut = "/haptic/wrench", WRENCH, stamped(WRENCH, "", 0, *range(6))[:-8]
    recording = load(write_bag(tmp_path / "run", cut, ("/haptic/encoder", JOINTS, joints(("x",), [1.0], 0))))
    assert set(recording.joints) == {"encoder"} and "topic /haptic/wrench is left out" in recording.notes[0]


_WITHOUT_ROS = """
import sys

ROS = ("rclpy", "rpyutils", "rosidl", "ament", "builtin_interfaces", "rcl_interfaces")

class NoRos:
    def find_spec(self, name, path=None, target=None):
        top = name.split(".")[0]
        if top.startswith(ROS) or top.endswith(("_msgs", "_srvs")):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, NoRos())
for name in ("rclpy", "sensor_msgs"):
    try:
        __import__(name)
    except ModuleNotFoundError:
        continue
    sys.exit(f"{name} can be imported all the same")
from haptic_device.analysis.report import page
from haptic_device.recording import load
from haptic_sim.cli.main import main

page.FIGURES = page.FIGURES[:2]
recording = load(sys.argv[1])
assert recording.to_dataframe("trace")["position.x"].std() > 0 and recording.joint("handle").entry("stiffness")[0] > 0
sys.argv[1:] = ["report", sys.argv[1], "--out", sys.argv[2]]
main()
"""


def test_a_bag_is_read_and_reported_where_nothing_of_ros_can_be_imported(run, tmp_path):
    words = [sys.executable, "-c", _WITHOUT_ROS, str(run), str(tmp_path / "report")]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=100)
    assert ended.returncode == 0, ended.stderr
    assert (tmp_path / "report" / "report.html").read_text(encoding="utf-8").count("data:image/png;base64,") == 2


def test_only_what_is_asked_for_is_read_and_in_the_type_asked_for(run):
    wanted = np.dtype([("deadline", "f8"), ("position", "f4", (3,)), ("no_such", "f4")])
    recording = load(run, only={"trace": wanted, "handle": Entries(("stiffness",), ("position",))})
    rows = swing(2000)
    assert recording.trace.dtype == wanted and set(recording.joints) == {"handle"}
    assert np.array_equal(recording.trace["position"], rows["position"].astype("f4"))
    assert np.isnan(recording.trace["no_such"]).all() and "trace has no no_such" in recording.notes[0]
    assert recording.joint("handle").names == ("stiffness",)
    assert set(recording.joint("handle").entry("stiffness")) == {1000.0}
    assert recording.counts["/haptic/tool"] == 500


def test_a_clock_that_was_set_meanwhile_moves_no_data(tmp_path):
    recording = load(write_run(tmp_path / "run", swing(20000)))
    system, monotonic = recording.pairs
    jump = np.where(monotonic > monotonic[len(monotonic) // 2], 500_000_000, 0)  # a second's half forward, midway
    moved = replace(recording, pairs=(system + jump, monotonic))
    error = moved.monotonic(system + jump) - monotonic
    assert np.percentile(np.abs(error), 75) < 1_000
