# SPDX-License-Identifier: Apache-2.0
"""The hand that a page leads, which page that is, and when it lets go: a command handler with a made-up device."""

import asyncio
import math
import time
import types

import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.config.description import load_device
from haptic_display.page import messages
from haptic_display.page.commands import EDGE, SLOW, YIELDED, CommandHandler
from haptic_display.page.hand import AFTER, SILENCE, Hand, Limits
from haptic_display.page.settings import DRIVER, SIMULATION
from haptic_display.page.trouble import Trouble

LIMITS = Limits(((-0.1, 0.1), (-0.2, 0.2), (-3.0, 3.0)), speed=1.0, turn=10.0)
FLAT = Limits(LIMITS.workspace[:2], 1.0, 10.0)


def held(place=(0.0, 0.0, 0.0)):
    hand = Hand()
    hand.take(place, 0.0)
    return hand


def test_the_hand_is_led_no_faster_than_its_speed_to_the_last_place_and_jumps_after_no_silence():
    hand, now, places = held(), 0.0, [(0.0, 0.0, 0.0)]
    for x in (0.03, 0.04, 0.06):  # the pointer is faster
        assert hand.aim({"x": x, "y": 0.08, "theta": 1.0}, LIMITS) == ""
        places.append(hand.lead(now := now + 0.01, LIMITS))
    while (place := hand.lead(now := now + 0.01, LIMITS)) is not None:
        places.append(place)
    steps = list(zip(places, places[1:], strict=False))
    assert max(math.dist(a[:2], b[:2]) for a, b in steps) == pytest.approx(0.01 * LIMITS.speed)
    assert max(b[2] - a[2] for a, b in steps) == pytest.approx(0.01 * LIMITS.turn)
    assert places[-1] == (0.06, 0.08, 1.0)
    hand.aim({"x": -0.1, "y": 0.08}, LIMITS)
    assert hand.lead(now + 100.0, LIMITS)[0] >= 0.06 - 0.1 * LIMITS.speed - 1e-9


def test_a_hand_held_still_by_a_live_page_holds_and_one_whose_page_is_silent_lets_go():
    hand, now = held(), 0.0
    hand.aim({"x": 0.05}, LIMITS)
    for heard in range(1, 1000):
        hand.listen(now := now + 0.016, heard)
    hand.listen(now := now + 100.0, heard + 1)
    hand.listen(now := now + 100.0, heard + 1)
    assert hand.goal is not None, "what the viewer itself sleeps through is no silence of a page"
    hand.listen(silent := now + 0.016, heard + 2)
    now = silent
    while now < silent + SILENCE:
        assert hand.goal == (0.05, 0.0, 0.0) and not hand.loose
        hand.listen(now := now + 0.016, heard + 2)
    hand.listen(now + 0.016, heard + 2)
    assert hand.goal is None and hand.loose and hand.lead(now + 0.016, LIMITS) is None


def test_a_hand_that_has_let_go_gives_in_to_the_handle_until_it_has_rested_there_within_the_limits():
    hand, now, handle, target = held((0.05, 0.0, 0.0)), 0.0, 0.0, 0.05
    hand.leader, said = object(), []
    hand.let_go(0.0)
    assert hand.goal is None and hand.leader is None and hand.lead(0.0, LIMITS) is None
    while (place := hand.give_in(now := now + 0.016, (handle, 0.0, 0.0), (target, 0.0, 0.0), LIMITS)) is not None:
        assert place == (handle, 0.0, 0.0), "wherever the handle is, the hand pulls at nothing"
        said.append(now)
        target, handle = handle, max(-0.02, handle - 0.0005)
    assert handle == target == -0.02 and said[-1] > 40 * 0.016
    hand.let_go(now)
    assert hand.give_in(now, (0.101, 0.0, 0.0), (0.05, 0.0, 0.0), LIMITS) == (0.1, 0.0, 0.0)
    assert hand.give_in(now + 2 * AFTER, (0.2, 0.0, 0.0), (0.1, 0.0, 0.0), LIMITS) is None, "at the limit it rests"
    hand.let_go(now)
    hand.take((0.0, 0.0, 0.0), now)
    assert not hand.loose


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_wherever_it_is_dragged_the_hand_stays_in_the_workspace_and_says_so(x):
    hand = held()
    assert bool(hand.aim({"x": x}, LIMITS)) == (abs(x) > 0.1) and -0.1 <= hand.goal[0] <= 0.1
    assert "the device has no theta axis" in hand.aim({"x": x, "theta": 1.0}, FLAT) and hand.goal[2] == 0.0


SPEEDS = (1.0, 15.0)


class Page:
    """A page that says something now and then."""

    heard = 0


@pytest.fixture
def handler(monkeypatch):
    """The device's hand is where it is told to be; the handle stays at 0."""
    truth = types.SimpleNamespace(position=[0.0, 0.0, 0.0], target=[0.0, 0.0, 0.0])

    def aim(place):
        truth.target = list(place)

    async def answer(question, **patience):
        return "done"

    node = types.SimpleNamespace(create_publisher=lambda *words: None)
    client = types.SimpleNamespace(node=node, prepare=lambda *services: None, aim=aim, acall=answer)
    scene = types.SimpleNamespace(way=((0.0, 0.0, 0.0), (0.1, 0.0, 0.0)), seconds=1.0)
    state = types.SimpleNamespace(truth=truth, axes=3, to_world=list, said=lambda *words: "engaged", scene=scene)
    state.scene_number = 1
    return CommandHandler(client, state, SPEEDS)


def told(handler, message, page):
    return asyncio.run(handler.do(message, page))


AIM = messages.Aim(x=0.05)


def test_the_first_page_to_aim_leads_until_it_lets_go_or_another_takes_over_from_where_the_hand_is(handler):
    first, second = Page(), Page()
    told(handler, AIM, first)
    with pytest.raises(ValueError, match="another page leads the hand: press Take over"):
        told(handler, messages.Aim(x=-0.05), second)
    told(handler, messages.LetGo(), second)
    assert handler.hand.leader is first and handler.hand.goal == (0.05, 0.0, 0.0), "who does not lead lets nothing go"
    told(handler, messages.LetGo(), first)
    assert handler.hand.leader is None and handler.hand.loose
    told(handler, AIM, second)
    handler.state.truth.target = [0.02, 0.0, 0.0]
    told(handler, messages.TakeOver(), first)
    assert handler.hand.leader is first and handler.hand.goal == (0.02, 0.0, 0.0)
    with pytest.raises(ValueError, match="another page leads"):
        told(handler, AIM, second)
    told(handler, messages.LetGo(), first)
    handler.state.axes = 0
    for message in (AIM, messages.TakeOver()):
        with pytest.raises(ValueError, match="haptic_loopback does not run"):
            told(handler, message, first)
    assert handler.hand.leader is None


def test_a_page_leads_no_hand_to_the_edge_of_the_workspace_but_draws_all_of_it(handler):
    assert handler.workspace is None
    handler.device = load_device("desktop")
    assert handler.workspace == tuple(axis.workspace for axis in handler.device.axes)
    for (low, high), axis in zip(handler.limits.workspace, handler.device.axes, strict=True):
        least, most = axis.workspace
        assert (low, high) == pytest.approx((least + EDGE * (most - least), most - EDGE * (most - least)))


def test_a_hand_has_arrived_when_the_device_says_so_and_not_when_it_was_told(handler):
    handler.hand.goal = (0.01, 0.0, 0.0)
    assert not handler.arrived
    handler.state.truth.target = [0.01, 0.0, 0.0]
    assert handler.arrived
    handler.state.truth = None
    assert not handler.arrived


def test_what_is_saved_is_asked_of_each_node_that_is_heard_and_not_remembered(handler):
    async def answer(question, **patience):
        if DRIVER in question.service:
            return {"coupling.stiffness": 1200.0}
        raise ValueError("haptic_simulation does not answer")

    handler.values, handler.client.acall = {"haptic_loopback": {"device": "desktop"}}, answer
    handler.state.statuses = {DRIVER: None}
    assert asyncio.run(handler.heard()) == {DRIVER: {"coupling.stiffness": 1200.0}}
    for heard, why in (({DRIVER: None, SIMULATION: None}, "simulation does not answer"), ({}, "no node is heard of")):
        handler.state.statuses = heard
        with pytest.raises(ValueError, match=why):
            asyncio.run(handler.heard())


@pytest.mark.parametrize(("apart", "yielded"), ((0.9 * YIELDED, True), (1.1 * YIELDED, False)))
def test_a_hand_has_given_in_when_its_target_is_at_the_handle_where_it_goes_when_it_is_let_go(handler, apart, yielded):
    page = Page()
    told(handler, AIM, page)
    handler.state.truth.target = [0.0, apart, 0.0]
    assert handler.yielded is yielded
    told(handler, messages.LetGo(), page)
    handler.lead(time.monotonic())
    assert handler.state.truth.target == [0.0, 0.0, 0.0] and handler.yielded
    handler.state.truth = None
    assert handler.yielded, "no hand pulls at nothing"


def test_an_e_stop_of_any_page_lets_the_hand_go_and_disable_does_not(handler):
    page = Page()
    told(handler, AIM, page)
    told(handler, messages.Trigger(service="disable"), page)
    assert handler.hand.leader is page
    told(handler, messages.Trigger(service="estop"), Page())
    assert handler.hand.leader is None and handler.hand.loose and handler.held_off


def test_a_page_that_has_fallen_silent_leads_no_more(handler):
    told(handler, AIM, Page())
    for k in range(round(10.0 * SILENCE) + 10):
        handler.lead(1e6 + 0.1 * k)
    assert handler.hand.leader is None


def test_while_a_scene_changes_no_page_leads_and_the_hand_is_slow(handler):
    first, second = Page(), Page()
    told(handler, AIM, first)
    assert (handler.limits.speed, handler.limits.turn) == SPEEDS
    handler.state.truth.target, found = [0.05, 0.0, 0.0], []  # it takes a while to give in

    async def live():
        changing = asyncio.create_task(handler.do(messages.StartScene(), second))
        await asyncio.sleep(0.0)
        found.append((handler.hand.leader, handler.limits.speed, handler.limits.turn))
        for message in (AIM, messages.TakeOver()):
            with pytest.raises(ValueError, match="wait: the hand goes to where the scene begins"):
                await handler.do(message, first)
        changing.cancel()

    asyncio.run(live())
    assert found == [(None, *SLOW)]
    told(handler, AIM, first)
    assert handler.hand.leader is first


SHOW = messages.ShowWay(act="play")


@pytest.fixture
def shown(handler):
    """With the guide at work, for a page."""
    handler.hand.take((0.0, 0.0, 0.0), time.monotonic())
    handler.guide.playback.begin(handler.state.scene.way, 10.0)
    handler.guide._scene = handler.state.scene_number
    handler.guide.playback.go_on(time.monotonic())
    handler.pages.keeper = Page()
    return handler


@pytest.mark.parametrize("ended_by", [messages.LetGo(), messages.TakeOver(), AIM, messages.Trigger(service="disable")])
def test_the_guide_ends_when_any_page_does_something_else_with_hand_or_motor(shown, ended_by):
    told(shown, ended_by, Page())
    assert shown.guide.said["state"] == "off"
    assert (shown.hand.goal is None) == isinstance(ended_by, messages.LetGo | messages.Trigger)


@pytest.mark.parametrize("message", [AIM, SHOW])
def test_a_page_that_may_not_lead_ends_nothing_and_is_not_the_one_that_is_listened_for(handler, message):
    first, second = Page(), Page()
    told(handler, AIM, first)
    handler.guide.playback.begin(handler.state.scene.way, 10.0)
    with pytest.raises(ValueError, match="another page leads the hand"):
        told(handler, message, second)
    assert handler.pages.keeper is first and handler.guide.said["state"] == "paused"


@pytest.mark.parametrize("message", [AIM, SHOW, messages.TakeOver(), messages.StartScene(), messages.Mend(title="x")])
def test_while_motor_and_hand_are_driven_the_next_waits_and_ends_nothing(handler, message):
    keeper = handler.pages.keeper = Page()
    with handler.alone("the nodes start"), pytest.raises(ValueError, match="^wait: the nodes start$"):
        told(handler, message, Page())
    assert handler.pages.keeper is keeper and handler.hand.goal is None


def test_a_hand_that_no_page_leads_may_be_let_go_but_not_while_it_is_led_to_where_it_must_be(handler):
    handler.aim({"x": 0.05})
    with handler.alone("the hand goes to where the scene begins"):
        told(handler, messages.LetGo(), Page())
        assert handler.hand.goal == (0.05, 0.0, 0.0)
    told(handler, messages.LetGo(), Page())
    assert handler.hand.goal is None and handler.hand.loose


def test_whether_the_motor_was_on_is_remembered_from_before_a_node_ended(handler):
    said = {"state": "engaged", "fault": ""}
    handler.state.said = lambda node, entry, otherwise="": said.get(entry, otherwise)
    ended = Trouble("The device has ended", "", "", "", ("haptic_loopback",))
    for trouble, state, drove in (
        (None, "engaged", True),
        (Trouble("Device does not answer", "", "", "", fault="device_silent"), "fault", True),
        (ended, "fault", True),
        (None, "idle", False),
        (ended, "idle", False),
        (None, "engaged", True),
        (Trouble("Emergency stop", "", "", "", fault="estop"), "fault", False),
    ):
        handler.troubles.trouble, said["state"] = trouble, state
        handler.lead(time.monotonic())
        assert handler.drove is drove, trouble
