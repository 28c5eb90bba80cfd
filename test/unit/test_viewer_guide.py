# SPDX-License-Identifier: Apache-2.0
"""The hand that shows the way: its places in time, what stops it, and what it is asked for."""

import asyncio
import types

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_display.page.commands import CommandHandler
from haptic_display.page.guide import Guide
from haptic_display.page.hand import Hand, Limits
from haptic_display.page.playback import REST, Playback, along, legs

CORNER = ((0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.1, 0.3, 0.0))
PLACE = st.tuples(*[st.floats(-0.1, 0.1)] * 3)


def test_each_part_between_corners_of_60_degrees_has_its_share_of_the_time_and_begins_and_ends_at_rest():
    parts = legs(CORNER)
    assert [part.end for part in parts] == pytest.approx([0.25, 1.0]) and parts[1].start == parts[0].end
    assert along(parts, 0.25) == pytest.approx(CORNER[1])
    assert along(parts, 0.125) == pytest.approx((0.05, 0.0, 0.0)), "half of the way in half of the time"
    assert np.linalg.norm(np.subtract(along(parts, 0.251), CORNER[1])) < 1e-6
    for turn, count in ((np.radians(59.9), 1), (np.radians(60.1), 2)):
        assert len(legs(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0 + np.cos(turn), np.sin(turn), 0.0)))) == count


@given(st.lists(PLACE, min_size=2, max_size=31), st.lists(st.floats(0.0, 1.0), min_size=1))
def test_a_way_goes_from_its_first_to_its_last_place_and_never_leaves_what_it_leads_through(way, shares):
    if all(np.linalg.norm(np.subtract(a, b)) < 1e-9 for a, b in zip(way, way[1:], strict=False)):
        return
    parts = legs(tuple(way))
    assert along(parts, 0.0) == pytest.approx(way[0], abs=1e-9)
    assert along(parts, 1.0) == pytest.approx(way[-1], abs=1e-9)
    low, high = np.min(way, axis=0) - 1e-9, np.max(way, axis=0) + 1e-9
    assert all((low <= along(parts, share)).all() and (along(parts, share) <= high).all() for share in shares)


def test_a_way_that_leads_nowhere_is_refused():
    for way in ((), ((0.0, 0.0, 0.0),), ((0.0, 0.0, 0.0),) * 3):
        with pytest.raises(ValueError, match="shows no way"):
            legs(way)


def played(playback, seconds, begin=0.0):
    """Share after so many seconds, looked at 100 times each."""
    for k in range(1, round(100 * seconds) + 1):
        if playback.state == "playing":
            playback.place(begin + 0.01 * k)
    return playback.share


def test_slow_is_a_quarter_of_the_speed_a_pause_loses_no_time_and_what_was_slept_through_is_not_caught_up():
    playback = Playback()
    playback.begin(CORNER, 10.0)
    playback.go_on(0.0)
    assert played(playback, 2.0) == pytest.approx(0.2)
    playback.slow = True
    assert played(playback, 2.0, 2.0) == pytest.approx(0.25)
    playback.pause()
    playback.go_on(1000.0)
    assert played(playback, 2.0, 1000.0) == pytest.approx(0.3)
    playback.slow = False
    playback.place(1050.0)
    assert playback.share == pytest.approx(0.31), "one look counts a tenth of a second at most"


def test_a_step_is_a_tenth_of_the_whole_and_ten_of_them_are_all():
    playback = Playback()
    playback.begin(CORNER, 1.0)
    for k in range(1, 10):
        playback.step(float(k))
        assert played(playback, 0.5, float(k)) == pytest.approx(0.1 * k) and playback.state == "paused"
    playback.step(10.0)
    assert played(playback, REST, 10.0) == 1.0 and playback.state == "playing", "it rests at the end"
    played(playback, 0.2, 10.0 + REST)
    assert playback.state == "off"


class Commands:
    """Of a viewer whose scene begins again at once, unless `meanwhile` does something."""

    check_wanted = CommandHandler.check_wanted

    def __init__(self, meanwhile=lambda: None):
        self.hand, self.meanwhile = Hand(), meanwhile
        self.driving, self.held_off, self.fault = True, False, ""
        self.limits = Limits(((-1.0, 1.0),) * 3, 1.0, 1.0)
        scene = types.SimpleNamespace(way=CORNER, seconds=1.0)
        self.state = types.SimpleNamespace(axes=3, scene=scene, scene_number=1)
        self.scenes, self.begun = self, 0

    async def start_again(self):
        self.begun += 1
        self.meanwhile()

    def aim(self, place):
        if self.hand.goal is None:
            self.hand.take((0.0, 0.0, 0.0), 0.0)

    def let_go(self):
        self.hand.let_go(0.0)


def guided(**given):
    commands = Commands(**given)
    return commands, Guide(commands)


def do(guide, *acts):
    for act in acts:
        asyncio.run(guide.do(act))


def led(guide, begin, since, until):
    """The guide, looked at 100 times a second."""
    for k in range(round(100 * since), round(100 * until)):
        guide.lead(begin + 0.01 * k)


def test_play_begins_the_scene_again_leads_the_hand_and_goes_on_after_a_pause_until_it_pulls_at_nothing():
    commands, guide = guided()
    do(guide, "play")
    led(guide, guide.playback._looked, 0.0, 0.3)
    assert 0.0 < commands.hand.goal[1] < 0.3 and guide.said["state"] == "playing"
    do(guide, "pause", "play")
    assert commands.begun == 1 and guide.said["state"] == "playing"
    begin = guide.playback._looked
    led(guide, begin, 0.0, 1.2)
    assert commands.hand.goal == pytest.approx(CORNER[-1])
    led(guide, begin, 1.2, 1.8)
    assert guide.said["state"] == "off" and commands.hand.goal is None and commands.hand.loose


def test_the_guide_stops_for_good_when_somebody_leads_the_hand_while_the_scene_begins_again():
    commands, guide = guided()
    commands.meanwhile = guide.stop
    do(guide, "play")
    assert guide.said == {"state": "off", "share": 0.0, "slow": False}


@pytest.mark.parametrize("acts", [["play"], ["play", "pause"]], ids=["playing", "paused"])
@pytest.mark.parametrize("reason", ["fault", "let go", "another scene", "a stop"])
def test_the_guide_ends_at_a_fault_with_another_scene_and_when_the_hand_has_let_go_which_pulls_at_nothing(reason, acts):
    commands, guide = guided()
    do(guide, *acts)
    commands.fault = "velocity" if reason == "fault" else ""
    commands.state.scene_number += reason == "another scene"
    if reason in ("let go", "a stop"):
        (commands.let_go if reason == "let go" else guide.stop)()
    guide.lead(0.0)
    assert guide.said["state"] == "off" and commands.hand.loose and commands.hand.goal is None


@pytest.mark.parametrize(
    ("is_so", "said"),
    [
        ({"fault": "estop", "driving": False}, "fault estop is latched; call ~/reset first"),
        ({"held_off": True}, "press Engage"),
        ({"driving": False}, "the motor is off: press Engage first"),
    ],
)
def test_the_guide_switches_no_motor_on(is_so, said):
    commands, guide = guided()
    vars(commands).update(is_so)
    with pytest.raises(ValueError, match=said):
        do(guide, "play")
    assert commands.begun == 0 and commands.hand.goal is None and guide.said["state"] == "off"


def test_a_scene_that_cannot_begin_again_is_refused_and_can_be_tried_again():
    def refuse():
        raise ValueError("the scene is being changed already")

    commands, guide = guided(meanwhile=refuse)
    with pytest.raises(ValueError, match="being changed already"):
        do(guide, "play")
    commands.meanwhile = lambda: None
    do(guide, "step", "slow")
    assert guide.said == {"state": "playing", "share": 0.0, "slow": True}
    do(guide, "fast")
    assert not guide.said["slow"]
    commands.state.scene = None
    guide.stop()
    with pytest.raises(ValueError, match="no scene"):
        do(guide, "play")
