# SPDX-License-Identifier: Apache-2.0
"""`haptic record` on a recorder that the test makes up: its length counts from the first row."""

import signal
import types

import pytest
from made_up_clock import Clock

from haptic_device.nodes import FIRST_ROW
from haptic_display.cli import record

EMPTY = "rosbag2_bagfile_information: {topics_with_message_count: [], custom_data: {}}"


@pytest.fixture
def recorded(tmp_path, monkeypatch, capsys):
    """recorded(seconds, first, interrupted) gives what the command said, and when it ended the recorder [s].

    The recorder prints a line after 5 s, and the first row comes at `first`; Ctrl-C at `interrupted`."""
    clock = Clock().put(monkeypatch, record)
    clock.strftime, out = lambda form: "now", tmp_path / "out"

    class Recorder:
        """In place of the nodes."""

        def __init__(self, logs):
            self.began, self.ended, self.first, self.interrupted = clock.now, 0.0, None, None

        def __enter__(self):
            return self

        def __exit__(self, *exception):
            self.ended = self.ended or clock.now - self.began

        def start(self, program):
            (out / "bag").mkdir(parents=True)
            (out / "bag" / "metadata.yaml").write_text(EMPTY)
            self.first, self.interrupted = wish

        def printed(self, name):
            told, elapsed = "recording to bag\n", clock.now - self.began
            told = told if elapsed >= 5.0 else ""
            return f"{told}{FIRST_ROW}" if self.first is not None and elapsed >= self.first else told

        def check(self):
            if self.interrupted is not None and clock.now - self.began >= self.interrupted:
                signal.raise_signal(signal.SIGINT)
            return {name: (self.printed(name).splitlines() or [""])[-1] for name in ("haptic_recorder",)}

    def command(seconds=None, first=None, interrupted=None, **trial):
        nonlocal wish
        wish, made = (first, interrupted), []
        monkeypatch.setattr(record, "Nodes", lambda logs: made.append(Recorder(logs)) or made[0])
        try:
            record.record(out, seconds, **trial)
            said = capsys.readouterr().err
        except ValueError as error:
            said = f"refused: {error}; {capsys.readouterr().err}"
        return types.SimpleNamespace(said=said.strip(), ended=made[0].ended if made else None)

    wish = (None, None)
    return command


@pytest.mark.parametrize("first", [6.0, 40.0])
def test_so_many_seconds_are_those_from_the_first_row_on(recorded, tmp_path, first):
    found, bag = recorded(seconds=4.0, first=first), tmp_path / "out" / "bag"
    assert first + 4.0 <= found.ended <= first + 4.0 + 4 * record.LOOK_PERIOD
    assert found.said.splitlines() == [f"recording to {bag}", f"next: haptic report {bag}"]


@pytest.mark.parametrize("early", [True, False])
def test_a_first_row_is_waited_for_from_the_recorders_last_word_on_so_long_and_no_longer(recorded, early):
    limit = 5.0 + record.HEARING
    found = recorded(seconds=4.0, first=limit - 1.0 if early else limit + 1.0)
    assert ("nothing was heard of /haptic in domain" in found.said) is not early
    assert found.ended == pytest.approx(limit + 3.0 if early else limit, abs=1.0)


def test_a_field_without_a_value_is_refused_before_anything_is_written(recorded, tmp_path):
    assert recorded(field=["hand"]).said == "refused: trial.fields has 'hand'; write name=value;"
    assert not (tmp_path / "out").exists()
    assert recorded(seconds=4.0, first=6.0, field=["hand=left", "note="]).said.startswith("recording to ")
