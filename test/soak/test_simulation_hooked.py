# SPDX-License-Identifier: Apache-2.0
"""haptic_simulation with hooks in it: a load that takes long, and an exchange that an exception ends."""

import contextlib
import signal
import sys

import pytest
from ear import LOAD, SIMULATION, Peer
from lifecycle_msgs.msg import State, Transition
from std_srvs.srv import Trigger
from waiting import exit_code

pytestmark = pytest.mark.timeout(600)

SECOND = False, "another scene is being loaded"
START = (0.03, 0.0, 0.0)  # of the tool in the scene `wall`
HOOKED = """
import sys, time
from pathlib import Path
from haptic_sim.node import simulation
from haptic_sim.exchange.endpoint import ExchangeEndpoint
plain, count, answer = simulation.ensure_compiled, [], ExchangeEndpoint.answer

def have(*names, **options):
    count.append(names)
    while len(count) == 2 and not Path("compiled").exists():  # the first load after the start compiles so long
        if options.get("told"):
            raise KeyboardInterrupt
        time.sleep(0.01)
    plain(*names, **options)

def failing(end, *given):
    if Path("fail").exists():
        raise KeyError("nobody\\nforesaw this")
    return answer(end, *given)

simulation.ensure_compiled, ExchangeEndpoint.answer = have, failing
sys.exit(simulation.main())
"""


@pytest.fixture
def peer(ros_domain):
    with contextlib.closing(Peer(ros_domain)) as peer:
        yield peer


@pytest.fixture
def hooked(peer, start, tmp_path):
    """A node in a folder: its first load takes until `compiled` is there; with `fail` its exchange comes to an end."""
    words = [sys.executable, "-c", HOOKED, "--ros-args", "-r", "__ns:=/haptic", "-p", "scene:=wall"]
    with open(tmp_path / "log", "w") as log:
        node = start(words, cwd=tmp_path, stdout=log, stderr=log)
    node.folder = tmp_path
    peer.lead(START, times=5)
    peer.until(lambda: peer.client.service(LOAD).ready, f"the service {LOAD}")
    return node


def test_while_a_world_is_compiled_the_node_goes_on_serving_and_takes_no_second(hooked, peer):
    assert peer.set("scene", "corner", SIMULATION)[0]
    loaded = peer.send(LOAD, Trigger.Request())
    peer.until(lambda: peer.call("load_scene") == SECOND, "the refusal of a second")
    assert peer.pause(False)[0]
    assert peer.call("reset_scene")[0]
    assert peer.lead(START, times=5).position[:3].tolist() == list(START)
    assert peer.news("how it goes meanwhile", lambda message, values: True)["scene"] == "wall"
    assert not loaded.poll()
    (hooked.folder / "compiled").touch()
    assert peer.answer_of_load(loaded) == (True, "scene is corner")
    peer.news("the other scene", lambda message, values: values["scene"] == "corner")
    assert peer.load_scene("wall") == (True, "scene is wall")


def test_a_node_that_is_cleaned_up_while_a_world_is_compiled_takes_no_world(hooked, peer):
    loaded = peer.send(LOAD, Trigger.Request())
    peer.until(lambda: peer.call("load_scene") == SECOND, "the refusal of a second")
    peer.change(SIMULATION, Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE)
    peer.change(SIMULATION, Transition.TRANSITION_CLEANUP, State.PRIMARY_STATE_UNCONFIGURED)
    (hooked.folder / "compiled").touch()
    assert peer.answer_of_load(loaded) == (False, "the node was cleaned up meanwhile: nothing was changed")
    assert peer.call("reset_scene") == (False, "there is no scene that answers")


def test_told_to_end_while_a_world_is_compiled_the_node_ends_well(hooked, peer):
    peer.send(LOAD, Trigger.Request())
    peer.until(lambda: peer.call("load_scene") == SECOND, "the refusal of a second")
    hooked.send_signal(signal.SIGTERM)
    assert exit_code(hooked) == 0
    said = (hooked.folder / "log").read_text()
    assert "Traceback" not in said and "Exception" not in said, said


def test_an_exchange_that_an_exception_ends_is_said_to_have_ended_and_answers_and_claims_nothing(hooked, peer):
    (hooked.folder / "fail").touch()
    (hooked.folder / "compiled").touch()
    sentence = "the exchange has ended by KeyError: 'nobody\\nforesaw this'"

    def told():
        peer.send_handle(START)
        peer.look(0.02)
        return [one for one in peer.said if one[0] == sentence]

    peer.until(told, "the error")
    answers = len(peer.tools)
    for answer in (peer.call("load_scene"), peer.call("reset_scene"), peer.pause(True)):
        assert answer == (False, sentence)
    peer.until(lambda: len(told()) >= 3, "two more reports")
    assert len(peer.tools) == answers
    hooked.send_signal(signal.SIGTERM)
    assert exit_code(hooked) == 0
    said = (hooked.folder / "log").read_text()
    assert said.count(sentence) == 1 and "Traceback" not in said, said
