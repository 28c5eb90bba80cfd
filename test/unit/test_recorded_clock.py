# SPDX-License-Identifier: Apache-2.0
"""Recordings in which the system clock was set, numbers are missing or two sessions are mixed: told, and read right."""

import numpy as np
import pytest
from bag_of_a_run import BOOT_TO_EPOCH, ROW, SECOND, cloud, diagnostics, joints, string, swing, write_bag, write_run
from examples import few
from hypothesis import given
from hypothesis import strategies as st
from stored_bags import records_of
from stored_bags import write as write_file

from haptic_device.recording import load
from haptic_device.recording.layouts import CLOUD, DIAGNOSTICS, JOINTS, STRING
from haptic_display.run.report import page as pages
from haptic_display.run.report.reading import read_run
from haptic_display.run.report.verdict import WARN, verdict

LENGTH, DROPPED = 13.8, 180  # [s] of the recording, rows that the driver dropped in it
SLOW = 200  # [Hz] of handle and of the stranger's topic


def recorded(folder, steps=(), ours=True, order=lambda messages: range(len(messages))):
    """A bag of 13.8 s; steps: (when [s], by how much [s]) of the system clock. ours: with stamps that do not step.

    At 0, 1, … 13 s and the end the driver's status, between these the simulation's; a mark each second and a half.
    """

    def wall(time):  # in tenths of a millisecond, so that no rounding is in the way
        return BOOT_TO_EPOCH + round(time * 1e4) * 100_000 + sum(round(by * SECOND) for at, by in steps if time > at)

    messages = []

    def put(time, topic, kind, data, number):
        messages.append((time, f"/haptic/{topic}" if topic != "diagnostics" else "/diagnostics", kind, data, number))

    for number in range(1, round(LENGTH * SLOW) + 2):
        time = (number - 1) / SLOW
        stamp = BOOT_TO_EPOCH + round(time * 1e4) * 100_000
        put(time, "handle", JOINTS, joints(("x",), [time], stamp if ours else wall(time)), number)
        put(time, "joint_states", JOINTS, joints(("x",), [time], wall(time)), number)
        if ours and number % 4 == 1:
            rows = np.zeros(1, ROW)
            rows["deadline"] = stamp - BOOT_TO_EPOCH
            put(time, "trace", CLOUD, cloud(rows), number // 4 + 1)
    times = [*range(14), LENGTH]
    for number, time in enumerate(times, 1):
        count = round(DROPPED * time / LENGTH)
        put(time, "diagnostics", DIAGNOSTICS, diagnostics("haptic_driver", {"trace_dropped": str(count)}), number)
        put(time, "diagnostics", DIAGNOSTICS, diagnostics("haptic_simulation", {"waited_s": str(time)}), 40 + number)
    for number, time in enumerate(np.arange(0.75, LENGTH, 1.5), 1):
        put(time, "mark", STRING, string(str(time)), number)
    messages.sort(key=lambda message: message[0])
    messages = [messages[place] for place in order(messages)]
    return write_bag(folder, *((*message, wall(time)) for time, *message in messages))


def assert_true(recording):
    """Every time of it is that of a clock that was not set."""
    assert recording.seconds == pytest.approx(LENGTH, abs=2e-9) and recording.left_out == {"trace rows": DROPPED}
    assert recording.grown("haptic_simulation", "waited_s") == pytest.approx(LENGTH, abs=1e-9)
    for topic in ("handle", "joint_states"):
        joint = recording.joint(topic)
        assert np.array_equal(joint.sequence, np.arange(1, len(joint.sequence) + 1))
        for times in (joint.stamp, joint.received, joint.published):
            assert (times - BOOT_TO_EPOCH) * 1e-9 == pytest.approx(joint.entry("x"), abs=1e-6)
    assert [(mark.time - BOOT_TO_EPOCH) * 1e-9 for mark in recording.marks] == pytest.approx(
        [float(mark.text) for mark in recording.marks], abs=1e-6
    )


def test_a_clock_that_goes_back_two_seconds_leaves_every_time_and_count_true_and_is_told(tmp_path):
    recording = load(recorded(tmp_path / "back", [(6.3, -2.0)]))
    assert_true(recording)
    assert recording.notes == (
        "6.300 s after the first message the system clock was set back by 2.000 s: times count on without it",
    )
    frame = recording.columns("joint_states")
    assert np.abs(frame["time"] - frame["x.position"]).max() < 1e-6  # of 2761 rows none is 2 s wrong


def test_a_clock_that_nobody_sets_is_not_told_of(tmp_path):
    recording = load(recorded(tmp_path / "steady"))
    assert_true(recording)
    assert recording.notes == ()


@few(25)
@given(
    at=st.integers(2, 11).flatmap(lambda s: st.integers(s * 1000, s * 1000 + 999)),
    size=st.sampled_from([-1, 1]).flatmap(lambda way: st.integers(110, 9000).map(lambda ms: way * ms)),
)
def test_a_step_of_any_size_and_place_either_way_is_told_with_its_size_and_moves_no_sample(tmp_path_factory, at, size):
    at, size = at * 1e-3 + 0.0002, size * 1e-3
    recording = load(recorded(tmp_path_factory.mktemp("any") / "bag", [(at, size)]))
    [note] = recording.notes
    assert f"was set {'back' if size < 0 else 'forward'} by {abs(size):.3f} s" in note
    assert recording.seconds == pytest.approx(LENGTH, abs=1e-6)
    for topic in ("handle", "joint_states"):
        joint = recording.joint(topic)
        for times in (joint.stamp, joint.received, joint.published):
            assert (times - BOOT_TO_EPOCH) * 1e-9 == pytest.approx(joint.entry("x"), abs=1e-6)
    assert recording.left_out == {"trace rows": DROPPED}


@pytest.mark.parametrize(("size", "told"), [(-0.11, 1), (-0.09, 0), (0.11, 1), (0.09, 0)])
def test_a_step_is_told_from_a_tenth_of_a_second_on(tmp_path, size, told):
    assert len(load(recorded(tmp_path / "bag", [(6.3, size)])).notes) == told


def test_several_steps_are_told_each_with_its_place(tmp_path):
    recording = load(recorded(tmp_path / "bag", [(3.0, 1.5), (8.0, -2.5)]))
    assert_true(recording)
    first, second = recording.notes
    assert first.startswith("3.000 s after") and "set forward by 1.500 s" in first
    assert second.startswith("8.000 s after") and "set back by 2.500 s" in second


def test_a_clock_set_back_is_found_where_all_stamps_follow_it(tmp_path):
    recording = load(recorded(tmp_path / "bag", [(6.3, -2.0)], ours=False))
    assert_true(recording)
    assert "set back by 2.000 s" in recording.notes[0]


def test_a_bag_that_a_tool_sorted_by_the_stepped_clock_is_told_to_be_without_order(tmp_path):
    folder = recorded(tmp_path / "bag", [(6.3, -2.0)])
    file = next(folder.glob("*.mcap"))
    messages, attachments = records_of(file)
    messages.sort(key=lambda one: one[2].log_time)
    write_file(file, messages, attachments)
    assert "two publishers, or none in its order: numbers alternate in handle" in load(folder).notes[0]


@few(20)
@given(late=st.floats(0.05, 4.0), begin=st.floats(2.0, 6.0), only=st.booleans())
def test_messages_that_come_late_all_at_once_or_one_alone_are_no_step(tmp_path_factory, late, begin, only):
    """A recorder that stands still, or one message that the network held back."""
    messages = []
    for number in range(1, 2401):
        time = number / SLOW
        held = begin <= time < begin + (1.0 / SLOW if only else late)
        came = begin + late if held else time
        data = joints(("x",), [time], BOOT_TO_EPOCH + round(time * SECOND))
        messages.append(("/haptic/handle", JOINTS, data, number, BOOT_TO_EPOCH + round(came * SECOND)))
    messages.sort(key=lambda message: message[-1])
    assert load(write_bag(tmp_path_factory.mktemp("late") / "bag", *messages)).notes == ()


@pytest.mark.parametrize("size", [-2.0, 2.0])
def test_a_step_is_found_where_no_message_has_a_number(tmp_path, size):
    folder = recorded(tmp_path / "bag", [(6.3, size)])
    file = next(folder.glob("*.mcap"))
    messages, attachments = records_of(file)
    for _, _, message in messages:
        message.sequence = 0
    write_file(file, messages, attachments)
    recording = load(folder)
    assert recording.seconds == pytest.approx(LENGTH, abs=2e-9)
    assert recording.notes[0].startswith("6.300 s after") and "by 2.000 s" in recording.notes[0]


def broken(rows, column, ticks):
    """Blocks of the trace in which these ticks of a column are NaN."""
    rows = rows.copy()
    rows[column][ticks] = np.nan
    return rows


def test_values_that_are_no_numbers_are_noted_with_column_and_count_and_their_rows_kept(tmp_path):
    rows = broken(swing(800), "margin", [3, 5, 7])
    recording = load(write_run(tmp_path / "run", rows))
    assert recording.notes == ("trace column margin is no number in 3 of 800 ticks, which are kept",)
    assert len(recording.trace) == 800 and np.isnan(recording.trace["margin"]).all(axis=1).sum() == 3


def joined(folder, *runs):
    """The messages of several bags in one."""
    found = [message for run in runs for message in records_of(next(run.glob("*.mcap")))[0]]
    folder.mkdir()
    write_file(folder / "joined.mcap", found, [])
    return folder


def test_a_namespace_that_is_recorded_twice_is_told_in_one_sentence(tmp_path):
    one, two = (write_run(tmp_path / name, swing(800)) for name in ("one", "two"))
    notes = load(joined(tmp_path / "both", one, two)).notes
    assert [note for note in notes if "two publishers" in note] == [
        "/haptic has messages of two publishers, or none in its order: "
        "numbers alternate in trace, handle, tool, operator/state"
    ]
    assert load(one).notes == ()


@pytest.mark.parametrize("restarts", [3, 4])
def test_a_publisher_that_begins_anew_up_to_three_times_is_no_second_one(tmp_path, restarts):
    numbers = [number for _ in range(restarts + 1) for number in range(1, 51)]
    messages = (("/haptic/handle", JOINTS, joints(("x",), [1.0], 0), one, i) for i, one in enumerate(numbers))
    assert bool(load(write_bag(tmp_path / "bag", *messages)).notes) == (restarts > 3)


def test_a_report_of_a_run_with_a_stepped_clock_says_so_and_not_that_it_is_good(tmp_path, monkeypatch):
    monkeypatch.setattr(pages, "FIGURES", pages.FIGURES[:1])
    run = read_run(recorded(tmp_path / "back", [(6.3, -2.0)]))
    page = pages.write_report([run], tmp_path / "page").read_text("utf-8")
    assert page.count("the system clock was set back by 2.000 s") >= 2 and "<strong>Good" not in page
    assert verdict(run).level == WARN and [time for time, _ in run.marks] == pytest.approx(
        [float(text) for _, text in run.marks], abs=1e-3
    )
