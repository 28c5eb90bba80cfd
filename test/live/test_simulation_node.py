# SPDX-License-Identifier: Apache-2.0
"""haptic_simulation alive between two topics: it answers, loads, pauses, and ends well whatever it does then."""

import contextlib
import signal
import subprocess
import sys
import time

import pytest
from ear import Served
from handle_samples import HOME, MS, handle
from lifecycle_msgs.msg import State, Transition
from live_nodes import Nodes, command
from std_srvs.srv import SetBool, Trigger
from waiting import exit_code, output

from haptic_device.control import exchange_samples
from haptic_device.message_fields import exchange_names
from haptic_device.nodes import messages
from haptic_device.recording.layouts import JointLayout
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

pytestmark = pytest.mark.timeout(600)

NODE, LOAD = "haptic_simulation", "haptic_simulation/load_scene"
SECOND = False, "another scene is being loaded"


class Peer(Served):
    """A device side in this process: sends handle samples, keeps what comes back; `said` [(message, values)]."""

    def __init__(self, domain):
        super().__init__(domain, "peer")
        self.tools, self.said, self.sequence = [], [], 0
        self.handle = self.node.create_publisher(messages.JointState, "handle", messages.LATEST)
        self.layout = JointLayout(exchange_names(3))
        self._tool = self.node.create_subscription(messages.JointState, "tool", self._take, messages.LATEST, raw=True)
        self.node.create_subscription(messages.DiagnosticArray, "/diagnostics", self._hear, 10)

    def _take(self, data):
        self.tools.append(self.layout.unpack(data))

    def _hear(self, array):
        self.said += [
            (status.message, {entry.key: entry.value for entry in status.values})
            for status in array.status
            if status.name == NODE
        ]

    def last(self):
        return self.said[-1:]

    def news(self, what, condition):
        """Values of the next diagnostics for which condition(message, values) holds."""
        begin = len(self.said)
        return self.until(lambda: next((one for one in self.said[begin:] if condition(*one)), None), what)[1]

    def call(self, service):
        """(success, message) of a service without arguments."""
        return self.trigger(service, NODE)

    def pause(self, wanted):
        answer = self.ask(f"{NODE}/pause", SetBool.Request(data=wanted))
        return answer.success, answer.message

    def load_scene(self, name):
        assert self.set("scene", name, NODE) == (True, "")
        return self.answer_of_load(self.send(LOAD, Trigger.Request()))

    def answer_of_load(self, asked):
        """(success, message) of a load that was asked for once: a second is refused while a world is compiled."""
        self.until(asked.poll, "a world is loaded")
        return asked.answer.success, asked.answer.message

    def send_handle(self, position, step=1):
        """One sample of a handle at rest, `step` ms after the one before."""
        self.sequence += step
        stamp_ns = self.sequence * MS
        self.handle.publish(handle(float(self.sequence), position=position, stamp_ns=stamp_ns, speed=0.0))

    def answered(self):
        """Number of the sample that was answered last."""
        return self.tools[-1].position[3 + exchange_samples.ANSWERED] if self.tools else 0.0

    def lead(self, position=HOME, times=1, step=1):
        """Sends samples one by one, each until it is answered or, lost or in a silence, the next has to be sent: with
        more and more patience, so that also on a slow machine none is left to be answered later."""
        self.until(lambda: self.handle.get_subscription_count() and self._tool.get_publisher_count(), "a simulation")
        for _ in range(times):
            self._lead_once(position, step)
        return self.tools[-1]

    def _lead_once(self, position, step):
        self.send_handle(position, step)
        sent, patience = time.monotonic(), 0.05

        def answered():
            nonlocal sent, patience
            if self.answered() == self.sequence:
                return True
            if time.monotonic() > sent + patience:
                self.send_handle(position, step)
                sent, patience = time.monotonic(), 1.5 * patience
            return False

        self.until(answered, "an answer to a handle sample")


@pytest.fixture(scope="module")
def peer(ros_domain):
    with contextlib.closing(Peer(ros_domain)) as peer:
        yield peer


@pytest.fixture(scope="module")
def nodes(ros_domain, tmp_path_factory):
    with Nodes(tmp_path_factory.mktemp("nodes")) as nodes:
        yield nodes


@pytest.fixture
def world(nodes, peer):
    """The node that all share, with the scene `wall` at its start."""
    nodes.have("haptic_simulation", scene="wall")
    assert peer.load_scene("wall")[0]


START = (0.03, 0.0, 0.0)  # of the tool in the scene `wall`


def test_the_node_answers_reports_and_puts_the_tool_back_to_its_start(world, peer):
    known = int(peer.news("any report", lambda message, values: True)["answered"])
    last = peer.lead((0.0, 0.0, 0.0), times=20)
    assert last.position[0] < START[0]
    assert last.stamp_ns == MS * last.position[3 + exchange_samples.ANSWERED]
    peer.news("20 more answers", lambda message, values: int(values["answered"]) >= known + 20)
    peer.news("energy at the tool port", lambda message, values: float(values["tool_port_energy"]) > 0.0)
    assert peer.call("reset_scene")[0]
    assert peer.lead(START).position[:3].tolist() == list(START)


def test_a_scene_that_cannot_be_read_is_refused_and_another_starts_from_its_own_home(world, peer):
    taken, reason = peer.set("scene", "nowhere", NODE)
    assert not taken and "nowhere is neither a file nor a name" in reason
    assert peer.load_scene("corner") == (True, "scene is corner")
    assert peer.lead((0.03, 0.04, 0.0)).position[:3].tolist() == [0.03, 0.04, 0.0]
    peer.until(lambda: peer.lead((0.02, 0.04, 0.0)).position[0] < 0.03, "the tool leaves its home")
    assert peer.tools[-1].position[0] > 0.02


def test_paused_the_world_says_nothing_and_then_goes_on_from_where_it_was(world, peer):
    there = (0.02, 0.0, 0.0)
    place = peer.lead(there, times=100, step=10).position[0]
    assert place == pytest.approx(there[0], abs=1e-6)
    assert peer.pause(True) == (True, "paused")
    answers, begin = len(peer.tools), len(peer.said)

    def told_twice():
        """Samples that would move the tool, until the node has said twice that it is paused."""
        peer.send_handle((0.0, 0.0, 0.0))
        peer.look(0.02)
        return [message for message, _ in peer.said[begin:]].count("paused") >= 2

    peer.until(told_twice, "two reports of the pause")
    assert len(peer.tools) == answers
    assert peer.pause(False)[0]
    assert peer.lead(there, times=5).position[0] == pytest.approx(place, abs=1e-6)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_told_to_end_the_node_says_how_things_then_stand_and_ends_well(nodes, peer, number):
    nodes.lack("haptic_simulation")
    process = nodes.start("haptic_simulation", scene="peg_in_hole")
    peer.lead(times=5)
    before = len(peer.said)
    process.send_signal(number)
    peer.until(lambda: peer.said[before:] and int(peer.said[-1][1]["answered"]) >= 5, "the last word")
    assert exit_code(process) == 0
    _, values = peer.said[-1]
    assert float(values["result.insertion_fraction"]) == pytest.approx(-0.5, abs=0.01)
    assert {"max_contact_force", "max_penetration", "refused", "rejoined", "sub_steps"} <= values.keys()
    reduced = reduce_scene(load("peg_in_hole"))
    assert (values["method"], values["why"]) == (reduced.method, reduced.reasons[0])
    assert "Traceback" not in process.log.read_text()


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

reset = simulation.Simulation.reset

def failing_reset(world):
    if Path("fail_reset").exists():
        raise KeyError("nobody\\nforesaw this")
    reset(world)

simulation.ensure_compiled, ExchangeEndpoint.answer, simulation.Simulation.reset = have, failing, failing_reset
sys.exit(simulation.main())
"""


@pytest.fixture
def hooked(nodes, peer, start, tmp_path):
    """A node in a folder: its first load takes until `compiled` is there; with `fail` its exchange comes to an end,
    with `fail_reset` by a reset."""
    nodes.lack("haptic_simulation")
    words = [sys.executable, "-c", HOOKED, "--ros-args", "-r", "__ns:=/haptic", "-p", "scene:=wall"]
    with open(tmp_path / "log", "w") as log:
        node = start(words, cwd=tmp_path, stdout=log, stderr=log)
    node.folder = tmp_path
    peer.lead(START, times=5)
    peer.until(lambda: peer.client.service(LOAD).ready, f"the service {LOAD}")
    return node


def test_while_a_world_is_compiled_the_node_goes_on_serving_and_takes_no_second(hooked, peer):
    assert peer.set("scene", "corner", NODE)[0]
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
    peer.change(NODE, Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE)
    peer.change(NODE, Transition.TRANSITION_CLEANUP, State.PRIMARY_STATE_UNCONFIGURED)
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


def test_a_reset_that_an_exception_ends_is_refused_with_the_sentence_and_nothing_answers_any_more(hooked, peer):
    (hooked.folder / "fail_reset").touch()
    sentence = "the exchange has ended by KeyError: 'nobody\\nforesaw this'"
    assert peer.call("reset_scene") == (False, sentence)
    answers = len(peer.tools)
    for _ in range(20):
        peer.send_handle(START)
        peer.look(0.02)
    assert len(peer.tools) == answers and peer.pause(True) == (False, sentence)


BAD = [
    ({"scene": "nowhere"}, ["nowhere", "peg_in_hole"]),
    ({"sub_step": 1.0}, ["sub_step", "1.0 s", "at most"]),
    ({"scen": "wall"}, ["scen is not", "did you mean scene"]),
]


def test_a_bad_parameter_ends_the_node_with_one_sentence(start):
    """Each in a node of its own, all at the same time."""
    pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
    ended = [start(command("haptic_simulation", **parameters), **pipes) for parameters, _ in BAD]
    for process, (_, words) in zip(ended, BAD, strict=True):
        said = output(process)[1].strip().splitlines()[-1]
        assert process.returncode == 1
        assert said.startswith("haptic_simulation: ")
        assert all(word in said for word in words), said
