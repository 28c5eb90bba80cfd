# SPDX-License-Identifier: Apache-2.0
"""What comes from outside may be wrong in any way: files, messages, command lines. A sentence, never a crash."""

import random
from pathlib import Path

import numpy as np
from examples import few
from hypothesis import HealthCheck, given
from hypothesis import strategies as st
from in_process import haptic
from rclpy.serialization import deserialize_message

from fault_injection.flood import mutated
from haptic_device.message_fields import AXES
from haptic_device.nodes import messages
from haptic_device.recording.layouts import JointLayout
from haptic_display.run.config_problems import problems

SHIPPED = sorted((Path(__file__).resolve().parents[2] / "config").rglob("*.yaml"))
MUTATED_FILES = 30
WORDS = (
    *("", ".nan", ".inf", "-1", "0", "1e400", "-1e-400", "99999999999999999999", "y", "~", "%", "ß", "x" * 4000),
    *("[]", "{}", "[[[]]]", "[" * 300, "{a: " * 200, "'", '"', ":", "- ", "*a", "&a", "!!python/x", "ros__parameters:"),
    *("\t", "\x00", "\ud800"),
)
EDIT = st.tuples(st.sampled_from(["word", "cut", "line", "swap", "byte"]), st.floats(0.0, 1.0), st.sampled_from(WORDS))


def edited(text, edits):
    """The text after these edits, each at its share of the length."""
    for kind, place, word in edits:
        at, lines = int(place * len(text)), text.split("\n")
        line = min(int(place * len(lines)), len(lines) - 1)
        if kind == "cut":
            text = text[:at] + text[at + 7 :]
        elif kind == "byte":
            text = text[:at] + word[:1] + text[at + 1 :]
        elif kind == "word":  # in place of the value that begins there
            start = max(text.find(": ", at), 0) + 2
            text = text[:start] + word + text[start + 3 :]
        elif kind == "line":
            text = "\n".join(lines[:line] + lines[line + 1 :])
        else:
            lines[line], lines[-1] = lines[-1], lines[line]
            text = "\n".join(lines)
    return text


@few(MUTATED_FILES, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(SHIPPED), st.lists(EDIT, min_size=1, max_size=4))
def test_a_file_that_somebody_spoilt_is_right_or_refused_in_sentences(tmp_path, path, edits):
    file = tmp_path / "spoilt.yaml"
    file.write_bytes(edited(path.read_text(encoding="utf-8"), edits).encode("utf-8", "surrogatepass"))
    for sentence in problems(file):
        assert sentence and "\n" not in sentence and "Traceback" not in sentence


WISHES = st.sampled_from(["nan", "-1", "0", "1e400", "", "../..", "/dev/null", "--", "x" * 300, "\udcff", "inf", "1e9"])
OPTIONS = ("--seconds", "--rate", "--scene", "--params", "--domain", "--minutes", "--event", "--delay", "--nonsense")


@few(15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(["check", "passivity", "report", "replay", "compare"]), st.data())
def test_a_command_line_of_nonsense_is_refused_in_a_sentence(tmp_path, monkeypatch, name, data):
    monkeypatch.chdir(tmp_path)
    words = data.draw(st.lists(st.one_of(st.sampled_from(OPTIONS), WISHES), min_size=1, max_size=4))
    done = haptic(name, *words)
    assert done.returncode != 0 and "Traceback" not in done.stderr
    assert (done.stdout + done.stderr).strip()
    assert done.returncode == 2 or len(done.stderr.strip().splitlines()) <= 1


def test_ros_itself_survives_spoilt_bytes_and_says_so():
    dice = random.Random(3)
    message = JointLayout(AXES).pack(0, [0.0] * 3, [0.0] * 3, [0.0] * 3)
    for _ in range(1000):
        try:
            target = messages.planar_target(deserialize_message(mutated(message, dice), messages.JointState), AXES)
        except Exception as error:  # what the node's own guard survives
            assert not isinstance(error, MemoryError)
        else:
            assert target is None or np.isfinite(target).all()
