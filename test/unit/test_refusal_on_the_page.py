# SPDX-License-Identifier: Apache-2.0
"""The page on passivity explains a refusal with the numbers that the command prints."""

import re
from pathlib import Path

import pytest
from in_process import haptic

PAGE = Path(__file__).parents[2] / "docs/theory/passivity.md"
POINT = """\
/**/haptic_driver:
  ros__parameters:
    device: desktop
    servo: {{rate: {rate}}}
    wall: {{normals: [0.0, 1.0], offsets: [-0.02], stiffness: [{stiffness}], damping: [0.0]}}
"""


@pytest.fixture
def checked(tmp_path):
    """What `haptic check` says of a wall of this stiffness [N/m] on the desktop device at this rate [Hz]."""

    def check(stiffness, rate=4000.0, lateness=0.0):
        file = tmp_path / "point.yaml"
        file.write_text(POINT.format(rate=rate, stiffness=stiffness), encoding="utf-8")
        done = haptic("check", str(file), "--lateness", str(lateness))
        return " ".join((done.stdout + done.stderr).split())

    return check


@pytest.fixture
def page():
    return PAGE.read_text(encoding="utf-8")


def test_the_sentence_of_the_refusal_is_the_one_that_the_command_prints(page, checked):
    (sentence,) = re.findall(r"^wall\.stiffness .*$", page, re.MULTILINE)
    assert sentence in checked(30000.0)


def test_the_limit_on_the_page_is_refused_and_a_little_less_is_not(page, checked):
    limit = float(re.search(r"= (\d+)\$ N/m", page)[1])
    assert "needs b >" in checked(limit) and "needs b >" not in checked(0.999 * limit)


def test_the_limit_of_late_forces_is_the_one_on_the_page(page, checked):
    late, limit = re.search(r"([\d.]+) ms late, the limit is (\d+) N/m", page).groups()
    said = (
        re.escape(f"under {limit} N/m ")
        + r"\(\d+ N/m with this coupling\) "
        + re.escape(f"where forces act {late} ms late")
    )
    assert re.search(said, checked(30000.0, lateness=float(late)))


def test_the_same_wall_passes_at_the_higher_rate_of_the_page(page, checked):
    rate = 1e3 * float(re.search(r"at (\d+) kHz the same wall needs 1\.875 N s/m", page)[1])
    assert "needs b >" not in checked(30000.0, rate=rate)
