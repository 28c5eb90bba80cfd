# SPDX-License-Identifier: Apache-2.0
"""The simulation's end of the exchange: what it accepts, what it answers, and the live node between two topics."""

import math
import signal
import subprocess
import sys
import threading
import time
import types

import numpy as np
import pytest
import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from live_nodes import LIMIT, Nodes, command
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter as RosParameter
from std_srvs.srv import SetBool, Trigger

from haptic_device.law import exchange
from haptic_device.law import port as law_port
from haptic_device.node import wire
from haptic_sim.compile import compile_scene
from haptic_sim.node import exchange_thread
from haptic_sim.node.declared import PARAMETERS
from haptic_sim.node.exchange_thread import RETURN_NS, ExchangeThread
from haptic_sim.node.port import SILENCE_NS, Port
from haptic_sim.node.simulation import SimulationNode
from haptic_sim.scene import load
from haptic_sim.simulation import Simulation, ToolSample
from haptic_sim.tool_port import port_of

pytestmark = pytest.mark.timeout(600)


HOME = (0.001, 0.11, 0.02)
GAINS = [2000.0, 2.0, 2.0, 0.002]
TOOL = ToolSample((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), (7.0, 8.0, 9.0), True, 0.25)


def handle(sequence=1.0, session=77.0, axes=3, position=HOME, stamp_ns=5_000_000_007, speed=0.5, **tail):
    """Bytes of a handle message; speed [m/s, rad/s] of each axis."""
    entries = dict.fromkeys(exchange.TAIL, 0.0)
    entries.update(layout_version=exchange.LAYOUT_VERSION, session=session, sequence=sequence)
    entries["gains_hash"] = exchange.gains_hash(*GAINS)
    entries["exchange_method"] = float(exchange.PSPM)
    entries.update(zip(exchange.TAIL[exchange.GAIN_0:], GAINS, strict=False))
    entries.update(tail)
    zeros = [0.0] * (axes + len(entries))
    layout = wire.JointLayout(wire.exchange_names(axes))
    return layout.pack(stamp_ns, [*position[:axes], *entries.values()], [*[speed] * axes, *zeros[axes:]], zeros)


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_a_handle_of_any_number_of_axes_is_taken_and_the_rest_stays_at_home(axes):
    question = Port(HOME).take(handle(axes=axes, position=(0.4, 0.5, 0.6)), 0)
    assert question.handle.position == (0.4, 0.5, 0.6)[:axes] + HOME[axes:]
    assert question.handle.velocity == (0.5,) * axes + (0.0,) * (3 - axes)
    assert question.handle.gains == tuple(GAINS)
    assert question.handle.time_ns == 5_000_000_007


REFUSED = [
    ({"position": (math.nan, 0.0, 0.0)}, "NaN or out of range"),
    ({"position": (0.0, 1.1e6, 0.0)}, "NaN or out of range"),
    ({"stiffness": math.nan}, "NaN or out of range"),
    ({"damping": -1.0}, "NaN or out of range"),
    ({"session": math.nan}, "NaN or out of range"),
    ({"layout_version": exchange.LAYOUT_VERSION + 1.0}, "other layout version"),
    ({"exchange_method": 99.0}, "other exchange method"),
    ({"exchange_method": 1.0}, "other exchange method"),
    ({"gains_hash": 1.0}, "other coupling gains"),
]


@pytest.mark.parametrize(("change", "reason"), REFUSED)
def test_a_message_that_cannot_be_meant_is_refused_and_counted(change, reason):
    port = Port(HOME)
    assert port.take(handle(**change), 0) is None
    assert port.refused[reason] == sum(port.refused.values()) == 1
    assert port.take(handle(), 0) is not None


def test_other_axis_names_and_foreign_bytes_are_refused():
    port, names = Port(HOME), ("x", "z", "theta", *exchange.TAIL)
    other = wire.JointLayout(names).pack(0, *[[0.0] * 16] * 3)
    assert len(other) == len(handle())
    assert [port.take(data, 0) for data in (other, b"", b"\0" * len(other), handle()[:-1])] == [None] * 4
    assert port.refused["other axis names or size"] == 4


def test_repeated_and_late_messages_are_refused():
    port = Port(HOME)
    taken = [port.take(handle(sequence), 0) is not None for sequence in (5.0, 5.0, 4.0, 6.0)]
    assert taken == [True, False, False, True]
    assert port.refused["late or repeated"] == 2


def test_a_second_device_is_heard_only_after_the_first_has_gone_silent():
    port = Port(HOME)
    assert port.take(handle(100.0, session=1.0), 0).new_session
    assert port.take(handle(1.0, session=2.0), SILENCE_NS - 1) is None
    assert port.refused["second publisher"] == 1
    assert not port.take(handle(101.0, session=1.0), SILENCE_NS - 1).new_session
    assert port.take(handle(1.0, session=2.0), 2 * SILENCE_NS - 1).new_session


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_the_answer_names_the_sample_it_answers_and_carries_its_stamp_and_gains(axes):
    port = Port(HOME)
    port.take(handle(41.0, axes=axes), 0)
    layout = wire.JointLayout(wire.exchange_names(axes))
    answers = [layout.unpack(port.answer(port.take(handle(sequence, axes=axes), 0), TOOL)) for sequence in (42.0, 43.0)]
    assert answers[0].stamp_ns == 5_000_000_007
    assert answers[0].position[:axes].tolist() == list(TOOL.position[:axes])
    assert answers[0].velocity[:axes].tolist() == list(TOOL.velocity[:axes])
    assert answers[0].effort[:axes].tolist() == list(TOOL.force_on_tool[:axes])
    tail = dict(zip(exchange.TAIL, answers[1].position[axes:], strict=True))
    assert (tail["answered_session"], tail["answered"], tail["sequence"]) == (77.0, 43.0, 2.0)
    assert (tail["session"], tail["gains_hash"], tail["damping"]) == (port.session, exchange.gains_hash(*GAINS), 2.0)
    assert (tail["contact"], tail["energy"], tail["layout_version"]) == (1.0, 0.25, exchange.LAYOUT_VERSION)


MS = 1_000_000  # [ns]


@pytest.fixture
def answering(monkeypatch):
    """What the exchange thread does with a sample, without the thread: answer(milliseconds) is whether the sample of
    that time is answered; `thread`, `grant(wish)`, and `load(scene)`."""
    clock, tools = types.SimpleNamespace(ns=0), []
    clocks = types.SimpleNamespace(monotonic_ns=lambda: clock.ns, perf_counter_ns=lambda: clock.ns)
    monkeypatch.setattr(exchange_thread, "time", clocks)
    monkeypatch.setattr(exchange_thread, "is_for", lambda simulation: False)
    thread = object.__new__(ExchangeThread)
    thread.simulation, thread.port = Simulation(load("wall"), port=port_of("pspm")), Port((0.03, 0.0, 0.0))
    thread._publisher, thread._near_publisher = types.SimpleNamespace(publish=tools.append), None
    thread._showing = types.SimpleNamespace(is_due=lambda *_: False, show=lambda *_: None)
    thread._wish, thread._granted, thread._granting = None, threading.Event(), threading.Lock()
    thread._at_once, thread._handle, thread.failure = None, None, ""
    thread._silent_until_ns, thread._returned_ns, thread.paused = 0, 0, False
    thread.answered, thread.compute_ns = 0, []

    def answer(milliseconds, position=(0.02, 0.0, 0.0)):
        clock.ns, before = milliseconds * MS, thread.answered
        thread._answer(handle(float(milliseconds), position=position, stamp_ns=clock.ns))
        return thread.answered > before

    def grant(wish):
        thread._wish = wish
        thread._grant()

    def another(scene):
        grant(lambda: thread._exchange_world(Simulation(load(scene), port=port_of("pspm"))))

    return types.SimpleNamespace(answer=answer, load=another, grant=grant, thread=thread)


def test_another_world_is_hidden_by_a_silence_and_its_gains_return_from_nothing(answering):
    loaded, back = 10, 10 + exchange_thread.SILENCE_NS // MS
    assert all(answering.answer(time) for time in range(1, loaded + 1))
    answering.load("corner")
    assert not any(answering.answer(time) for time in range(loaded + 1, back))
    stiffness = []
    for time_ms in range(back, back + RETURN_NS // MS):
        assert answering.answer(time_ms)
        stiffness.append(answering.thread.simulation._coupled.stiffness)
    assert stiffness == sorted(stiffness)
    assert 0.0 < stiffness[0] < 0.01 * GAINS[0] and stiffness[-1] == GAINS[0]


@pytest.mark.parametrize("how", ["load", "reset"])
def test_each_world_begins_with_its_budget_so_that_the_pull_is_that_of_the_first(answering, how):
    """The handle stays 6 mm behind the wall, and the tool comes to it from its start again and again."""
    began, pulls, thread = 0, [], answering.thread
    lasts = (exchange_thread.SILENCE_NS + RETURN_NS) // MS + 200
    for _ in range(13):
        answering.load("wall") if how == "load" else answering.grant(thread.simulation.reset)
        for time_ms in range(began + 1, began + lasts):
            answering.answer(time_ms, (-0.006, 0.0, 0.0))
        pulls.append(thread.simulation.method.force_on_tool[0])
        began += lasts
    assert pulls[0] < -1.0
    assert pulls == pytest.approx([pulls[0]] * len(pulls), rel=0.02)


def test_a_load_that_was_refused_because_nothing_answered_in_time_does_not_come_about_later(answering):
    thread = answering.thread
    assert "did not answer" in thread.load(Simulation(load("corner"), port=port_of("pspm")), patience=0.0)
    thread._grant()  # as soon as it looks
    assert thread.simulation.scene.name == "wall"


def test_a_world_that_is_being_built_leaves_the_pull_of_the_one_that_runs_as_it_is(answering):
    node, thread = object.__new__(SimulationNode), answering.thread
    node.simulation, node.told = thread.simulation, ()
    values = {parameter.name: parameter.default for parameter in PARAMETERS} | {"scene": "wall"}
    for time_ms in range(1, 400):
        answering.answer(time_ms, (-0.006, 0.0, 0.0))
    before = thread.simulation.port.memory.copy()
    node._world(values)
    assert np.array_equal(thread.simulation.port.memory, before) and before[law_port.PULL] > 1.0
    answering.answer(400, (-0.006, 0.0, 0.0))
    assert thread.simulation.port.memory[law_port.PULL] == pytest.approx(before[law_port.PULL], rel=0.02)


class Peer:
    """A device side in this process: sends handle samples, keeps what comes back; `said` [(message, values)]."""

    def __init__(self, node):
        self.node, self.tools, self.said, self.sequence = node, [], [], 0
        self.executor = SingleThreadedExecutor(context=node.context)
        self.executor.add_node(node)
        self.handle = node.create_publisher(wire.JointState, "handle", wire.LATEST)
        self.layout = wire.JointLayout(wire.exchange_names(3))
        node.create_subscription(wire.JointState, "tool", self._take, wire.LATEST, raw=True)
        node.create_subscription(wire.DiagnosticArray, "/diagnostics", self._hear, 10)
        self.reset, self.load = (node.create_client(Trigger, f"haptic_simulation/{name}_scene")
                                 for name in ("reset", "load"))
        self.pause = node.create_client(SetBool, "haptic_simulation/pause")
        self.set = node.create_client(SetParameters, "haptic_simulation/set_parameters")

    def _take(self, data):
        self.tools.append(self.layout.unpack(data))

    def _hear(self, array):
        self.said += [(status.message, {entry.key: entry.value for entry in status.values})
                      for status in array.status if status.name == "haptic_simulation"]

    def _comes(self, condition, seconds):
        end = time.monotonic() + seconds
        while not (found := condition()) and time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.02)
        return found

    def until(self, what, condition):
        found = self._comes(condition, LIMIT)
        assert found, f"this did not come: {what}; last said: {self.said[-1:]}"
        return found

    def news(self, what, condition):
        """Values of the next diagnostics for which condition(message, values) holds."""
        begin = len(self.said)
        return self.until(what, lambda: next((one for one in self.said[begin:] if condition(*one)), None))[1]

    def call(self, client, request):
        self.until(f"the service {client.srv_name}", client.service_is_ready)
        answer = client.call_async(request)
        self.until(f"an answer of {client.srv_name}", answer.done)
        return answer.result()

    def want_scene(self, name):
        wish = RosParameter("scene", value=name).to_parameter_msg()
        return self.call(self.set, SetParameters.Request(parameters=[wish])).results[0]

    def load_scene(self, name):
        assert self.want_scene(name).successful
        return self.call(self.load, Trigger.Request())

    def send(self, position, step=1):
        """One sample of a handle at rest, `step` ms after the one before."""
        self.sequence += step
        stamp_ns = self.sequence * MS
        self.handle.publish(handle(float(self.sequence), position=position, stamp_ns=stamp_ns, speed=0.0))

    def answered(self):
        """Number of the sample that was answered last."""
        return self.tools[-1].position[3 + exchange.ANSWERED] if self.tools else 0.0

    def ask(self, position=HOME, times=1, step=1):
        """Sends samples one by one, each until it is answered or, lost or in a silence, the next has to be sent: with
        more and more patience, so that also on a slow machine none is left to be answered later."""
        for _ in range(times):
            patience = 0.05
            self.send(position, step)
            while not self._comes(lambda: self.answered() == self.sequence, patience):
                assert patience < LIMIT, f"no handle sample was answered; last said: {self.said[-1:]}"
                patience *= 1.5
                self.send(position, step)
        return self.tools[-1]


@pytest.fixture(scope="module")
def peer(ros_domain):
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain)
    node = rclpy.create_node("peer", namespace="/haptic", context=context)
    yield Peer(node)
    node.destroy_node()
    rclpy.shutdown(context=context)


@pytest.fixture(scope="module")
def nodes(ros_domain, tmp_path_factory):
    with Nodes(tmp_path_factory.mktemp("nodes")) as nodes:
        yield nodes


@pytest.fixture
def world(nodes, peer):
    """The node that all share, with the scene `wall` at its start."""
    nodes.have("haptic_simulation", scene="wall")
    assert peer.load_scene("wall").success


START = (0.03, 0.0, 0.0)  # of the tool in the scene `wall`


def test_the_node_answers_reports_and_puts_the_tool_back_to_its_start(world, peer):
    known = int(peer.news("any report", lambda message, values: True)["answered"])
    last = peer.ask((0.0, 0.0, 0.0), times=20)
    assert last.position[0] < START[0]
    assert last.stamp_ns == MS * last.position[3 + exchange.ANSWERED]
    peer.news("20 more answers", lambda message, values: int(values["answered"]) >= known + 20)
    peer.news("energy at the tool port", lambda message, values: float(values["tool_port_energy"]) > 0.0)
    assert peer.call(peer.reset, Trigger.Request()).success
    assert peer.ask(START).position[:3].tolist() == list(START)


def test_a_scene_that_cannot_be_read_is_refused_and_another_starts_from_its_own_home(world, peer):
    refused = peer.want_scene("nowhere")
    assert not refused.successful
    assert "nowhere is neither a file nor a name" in refused.reason
    answered = peer.load_scene("corner")
    assert (answered.success, answered.message) == (True, "scene is corner")
    assert peer.ask((0.03, 0.04, 0.0)).position[:3].tolist() == [0.03, 0.04, 0.0]
    peer.until("the tool leaves its home", lambda: peer.ask((0.02, 0.04, 0.0)).position[0] < 0.03)
    assert peer.tools[-1].position[0] > 0.02


def test_paused_the_world_says_nothing_and_then_goes_on_from_where_it_was(world, peer):
    there = (0.02, 0.0, 0.0)
    place = peer.ask(there, times=100, step=10).position[0]
    assert place == pytest.approx(there[0], abs=1e-6)
    assert peer.call(peer.pause, SetBool.Request(data=True)).message == "paused"
    answers, begin = len(peer.tools), len(peer.said)

    def told_twice():
        """Samples that would move the tool, until the node has said twice that it is paused."""
        peer.send((0.0, 0.0, 0.0))
        peer.executor.spin_once(timeout_sec=0.02)
        return [message for message, _ in peer.said[begin:]].count("paused") >= 2

    peer.until("two reports of the pause", told_twice)
    assert len(peer.tools) == answers
    assert peer.call(peer.pause, SetBool.Request(data=False)).success
    assert peer.ask(there, times=5).position[0] == pytest.approx(place, abs=1e-6)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_told_to_end_the_node_says_how_things_then_stand_and_ends_well(nodes, peer, number):
    nodes.lack("haptic_simulation")
    process = nodes.start("haptic_simulation", scene="peg_in_hole")
    peer.ask(times=5)
    before = len(peer.said)
    process.send_signal(number)
    peer.until("the last word", lambda: peer.said[before:] and int(peer.said[-1][1]["answered"]) >= 5)
    assert process.wait(LIMIT) == 0
    _, values = peer.said[-1]
    assert float(values["result.insertion_fraction"]) == pytest.approx(-0.5, abs=0.01)
    assert {"max_contact_force", "max_penetration", "refused", "rejoined", "sub_steps"} <= values.keys()
    compiled = compile_scene(load("peg_in_hole"))
    assert (values["method"], values["why"]) == (compiled.method, compiled.reasons[0])
    assert "Traceback" not in process.log.read_text()


HOOKED = """
import sys, time
from pathlib import Path
from haptic_sim.node import exchange_thread, simulation
plain, count, answer = simulation.have, [], exchange_thread.Port.answer

def have(*names, **options):
    count.append(names)
    while len(count) == 2 and not Path("compiled").exists():  # the first load after the start compiles so long
        if options.get("told"):
            raise KeyboardInterrupt
        time.sleep(0.01)
    plain(*names, **options)

def failing(port, *given):
    if Path("fail").exists():
        raise KeyError("nobody\\nforesaw this")
    return answer(port, *given)

simulation.have, exchange_thread.Port.answer = have, failing
exchange_thread.is_for = lambda world: False
sys.exit(simulation.main())
"""


@pytest.fixture
def hooked(nodes, peer, start, tmp_path):
    """A node in a folder: its first load takes until `compiled` is there; with `fail` its exchange comes to an end."""
    nodes.lack("haptic_simulation")
    words = [sys.executable, "-c", HOOKED, "--ros-args", "-r", "__ns:=/haptic", "-p", "scene:=wall"]
    with open(tmp_path / "log", "w") as log:
        node = start(words, cwd=tmp_path, stdout=log, stderr=log)
    node.folder = tmp_path
    peer.ask(START, times=5)
    peer.until("the service", peer.load.service_is_ready)
    return node


def test_while_a_world_is_compiled_the_node_goes_on_serving_and_takes_no_second(hooked, peer):
    assert peer.want_scene("corner").successful
    loaded = peer.load.call_async(Trigger.Request())
    peer.until("the refusal of a second", lambda: not peer.call(peer.load, Trigger.Request()).success)
    assert peer.call(peer.load, Trigger.Request()).message == "another scene is being loaded"
    assert peer.call(peer.pause, SetBool.Request(data=False)).success
    assert peer.call(peer.reset, Trigger.Request()).success
    assert peer.ask(START, times=5).position[:3].tolist() == list(START)
    assert peer.news("how it goes meanwhile", lambda message, values: True)["scene"] == "wall"
    assert not loaded.done()
    (hooked.folder / "compiled").touch()
    peer.until("an answer", loaded.done)
    assert (loaded.result().success, loaded.result().message) == (True, "scene is corner")
    peer.news("the other scene", lambda message, values: values["scene"] == "corner")
    assert peer.load_scene("wall").message == "scene is wall"


def test_a_node_that_is_cleaned_up_while_a_world_is_compiled_takes_no_world(hooked, peer):
    states = peer.node.create_client(ChangeState, "haptic_simulation/change_state")
    loaded = peer.load.call_async(Trigger.Request())
    peer.until("the refusal of a second", lambda: not peer.call(peer.load, Trigger.Request()).success)
    for number in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP):
        assert peer.call(states, ChangeState.Request(transition=Transition(id=number))).success
    (hooked.folder / "compiled").touch()
    peer.until("an answer", loaded.done)
    assert (loaded.result().success, loaded.result().message) == (
        False, "the node was cleaned up meanwhile: nothing was changed"
    )  # fmt: skip
    assert peer.call(peer.reset, Trigger.Request()).message == "there is no scene that answers"


def test_told_to_end_while_a_world_is_compiled_the_node_ends_well(hooked, peer):
    peer.load.call_async(Trigger.Request())
    peer.until("the refusal of a second", lambda: not peer.call(peer.load, Trigger.Request()).success)
    hooked.send_signal(signal.SIGTERM)
    assert hooked.wait(LIMIT) == 0
    said = (hooked.folder / "log").read_text()
    assert "Traceback" not in said and "Exception" not in said, said


def test_an_exchange_that_an_exception_ends_is_said_to_have_ended_and_answers_and_claims_nothing(hooked, peer):
    (hooked.folder / "fail").touch()
    (hooked.folder / "compiled").touch()
    sentence = "the exchange has ended by KeyError: 'nobody\\nforesaw this'"

    def told():
        peer.send(START)
        peer.executor.spin_once(timeout_sec=0.02)
        return [one for one in peer.said if one[0] == sentence]

    peer.until("the error", told)
    answers = len(peer.tools)
    for client, request in ((peer.load, Trigger.Request()), (peer.reset, Trigger.Request()),
                            (peer.pause, SetBool.Request(data=True))):
        answer = peer.call(client, request)
        assert (answer.success, answer.message) == (False, sentence)
    peer.until("two more reports", lambda: len(told()) >= 3)
    assert len(peer.tools) == answers
    hooked.send_signal(signal.SIGTERM)
    assert hooked.wait(LIMIT) == 0
    said = (hooked.folder / "log").read_text()
    assert said.count(sentence) == 1 and "Traceback" not in said, said


BAD = [({"scene": "nowhere"}, ["nowhere", "peg_in_hole"]), ({"sub_step": 1.0}, ["sub_step", "1.0 s", "at most"]),
       ({"scen": "wall"}, ["scen is not", "did you mean scene"])]  # fmt: skip


def test_a_bad_parameter_ends_the_node_with_one_sentence(start):
    """Each in a node of its own, all at the same time."""
    pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
    ended = [start(command("haptic_simulation", **parameters), **pipes) for parameters, _ in BAD]
    for process, (_, words) in zip(ended, BAD, strict=True):
        said = process.communicate(timeout=LIMIT)[1].strip().splitlines()[-1]
        assert process.returncode == 1
        assert said.startswith("haptic_simulation: ")
        assert all(word in said for word in words), said
