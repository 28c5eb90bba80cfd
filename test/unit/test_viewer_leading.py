# SPDX-License-Identifier: Apache-2.0
"""Which page leads the hand, and when it lets go: a command handler with a device that is made up."""

import asyncio
import time
import types

import pytest

from haptic_sim.viewer import messages
from haptic_sim.viewer.commands import SLOW, YIELDED, CommandHandler
from haptic_sim.viewer.hand import SILENCE
from haptic_sim.viewer.trouble import Trouble

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


def test_the_first_page_to_aim_leads_until_it_lets_go_and_the_next_is_refused_meanwhile(handler):
    first, second = Page(), Page()
    told(handler, AIM, first)
    assert handler.hand.leader is first and handler.hand.goal == (0.05, 0.0, 0.0)
    with pytest.raises(ValueError, match="another page leads the hand: press Take over"):
        told(handler, messages.Aim(x=-0.05), second)
    assert handler.hand.leader is first and handler.hand.goal == (0.05, 0.0, 0.0)
    told(handler, messages.LetGo(), second)
    assert handler.hand.leader is first, "who does not lead lets nothing go"
    told(handler, messages.LetGo(), first)
    assert handler.hand.leader is None and handler.hand.loose
    told(handler, messages.Aim(x=-0.05), second)
    assert handler.hand.leader is second and not handler.hand.loose


def test_a_page_that_takes_over_leads_from_where_the_hand_is_and_the_other_no_more(handler):
    first, second = Page(), Page()
    told(handler, AIM, first)
    handler.state.truth.target = [0.02, 0.0, 0.0]
    told(handler, messages.TakeOver(), second)
    assert handler.hand.leader is second and handler.hand.goal == (0.02, 0.0, 0.0)
    with pytest.raises(ValueError, match="another page leads"):
        told(handler, AIM, first)


def test_without_a_hand_nobody_leads_and_whoever_wants_to_is_told(handler):
    handler.state.axes = 0
    for message in (AIM, messages.TakeOver()):
        with pytest.raises(ValueError, match="haptic_loopback does not run"):
            told(handler, message, Page())
    assert handler.hand.leader is None


def test_a_hand_that_is_let_go_is_at_the_handle_at_the_next_look(handler):
    page = Page()
    told(handler, AIM, page)
    handler.state.truth.target = [0.05, 0.0, 0.0]
    assert not handler.yielded
    told(handler, messages.LetGo(), page)
    handler.lead(time.monotonic())
    assert handler.state.truth.target == [0.0, 0.0, 0.0] and handler.yielded


@pytest.mark.parametrize(("apart", "yielded"), ((0.9 * YIELDED, True), (1.1 * YIELDED, False)))
def test_a_hand_has_given_in_when_its_target_is_at_the_handle(handler, apart, yielded):
    handler.state.truth.target = [0.0, apart, 0.0]
    assert handler.yielded is yielded
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
    now = 1e6
    for _ in range(round((SILENCE + 1.0) / 0.1)):
        handler.lead(now := now + 0.1)
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
