# SPDX-License-Identifier: Apache-2.0
"""The simulation's end of the exchange: what it accepts, what it answers, and the live node between two topics."""

import math
import signal
import subprocess
import sys
import time

import pytest
import rclpy
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter as RosParameter
from std_srvs.srv import SetBool, Trigger

from haptic_device.law import exchange
from haptic_device.node import wire
from haptic_sim.node.port import SILENCE_NS, Port
from haptic_sim.simulation import ToolSample

pytestmark = pytest.mark.live

HOME = (0.001, 0.11, 0.02)
GAINS = [2000.0, 2.0, 2.0, 0.002]
TOOL = ToolSample((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), (7.0, 8.0, 9.0), True, 0.25)


def handle(sequence=1.0, session=77.0, axes=3, position=HOME, stamp_ns=5_000_000_007, **tail):
    """Bytes of a handle message."""
    entries = dict.fromkeys(exchange.TAIL, 0.0)
    entries.update(layout_version=exchange.LAYOUT_VERSION, session=session, sequence=sequence)
    entries["gains_hash"] = exchange.gains_hash(*GAINS)
    entries["exchange_method"] = float(exchange.PSPM)
    entries.update(zip(exchange.TAIL[exchange.GAIN_0:], GAINS, strict=False))
    entries.update(tail)
    zeros = [0.0] * (axes + len(entries))
    layout = wire.JointLayout(wire.exchange_names(axes))
    return layout.pack(stamp_ns, [*position[:axes], *entries.values()], [*[0.5] * axes, *zeros[axes:]], zeros)


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


class Peer:
    """A device side in this process: sends handle samples, keeps what comes back."""

    def __init__(self, node):
        self.node, self.tools, self.said = node, [], []
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

    def _hear(self, message):
        self.said += [{entry.key: entry.value for entry in status.values} for status in message.status
                      if status.name == "haptic_simulation"]

    def until(self, condition, seconds=20.0):
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, "what was waited for did not come"
            self.executor.spin_once(timeout_sec=0.02)

    def call(self, client, request):
        done = client.call_async(request)
        self.until(done.done)
        return done.result()

    def want_scene(self, name):
        wish = RosParameter("scene", value=name).to_parameter_msg()
        return self.call(self.set, SetParameters.Request(parameters=[wish])).results[0]

    def ask(self, sequence, position=HOME):
        """Send handle samples under the next numbers until one is answered; the last number."""
        before, end = len(self.tools), time.monotonic() + 20.0
        while len(self.tools) == before:
            assert time.monotonic() < end, "no handle sample was answered"
            sequence += 1
            stamp_ns = int(sequence * 1_000_000)
            self.handle.publish(handle(float(sequence), position=position, stamp_ns=stamp_ns))
            patience = time.monotonic() + 0.1
            while len(self.tools) == before and time.monotonic() < patience:
                self.executor.spin_once(timeout_sec=0.02)
        return sequence


@pytest.fixture
def peer(ros_domain):
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain)
    node = rclpy.create_node("peer", namespace="/haptic", context=context)
    yield Peer(node)
    node.destroy_node()
    rclpy.shutdown(context=context)


def simulation(start, **parameters):
    given = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
    command = [sys.executable, "-m", "haptic_sim.node.simulation", "--ros-args", *given]
    return start(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_node_answers_resets_reports_and_ends_at_once_when_told(start, peer, number):
    process = simulation(start, scene="wall")
    sequence = 0
    peer.until(lambda: peer.handle.get_subscription_count() == 1)
    for _ in range(20):
        sequence = peer.ask(sequence, (0.0, 0.0, 0.0))
    assert peer.tools[-1].position[0] < 0.03
    assert peer.tools[-1].stamp_ns == 1_000_000 * peer.tools[-1].position[3 + exchange.ANSWERED]
    peer.until(lambda: peer.said and int(peer.said[-1]["answered"]) >= 20)
    peer.until(lambda: float(peer.said[-1]["tool_port_energy"]) > 0.0)
    done = peer.reset.call_async(Trigger.Request())
    peer.until(done.done)
    assert done.result().success
    answers = len(peer.tools)
    peer.ask(sequence, (0.0, 0.0, 0.0))
    assert [0.03, 0.0, 0.0] in [tool.position[:3].tolist() for tool in peer.tools[answers:]]
    process.send_signal(number)
    assert process.wait(5.0) == 0
    assert "Traceback" not in process.stderr.read()


def test_another_scene_is_loaded_behind_a_silence_and_starts_from_its_own_home(start, peer):
    simulation(start, scene="wall")
    peer.until(lambda: peer.handle.get_subscription_count() == 1)
    sequence = peer.ask(0, (0.0, 0.0, 0.0))
    refused = peer.want_scene("nowhere")
    assert not refused.successful
    assert "nowhere is neither a file nor a name" in refused.reason
    assert peer.want_scene("corner").successful
    answered = peer.call(peer.load, Trigger.Request())
    assert (answered.success, answered.message) == (True, "scene is corner")
    changed = time.monotonic()
    sequence = peer.ask(sequence, (0.03, 0.04, 0.0))
    assert time.monotonic() - changed > 0.15
    assert peer.tools[-1].position[:3].tolist() == [0.03, 0.04, 0.0]
    for _ in range(5):
        sequence = peer.ask(sequence, (0.02, 0.04, 0.0))
    assert 0.02 < peer.tools[-1].position[0] < 0.03


def test_paused_the_world_says_nothing_and_then_goes_on_from_where_it_was(start, peer):
    simulation(start, scene="wall")
    peer.until(lambda: peer.handle.get_subscription_count() == 1)
    sequence = 0
    for _ in range(5):
        sequence = peer.ask(sequence, (0.02, 0.0, 0.0))
    assert peer.call(peer.pause, SetBool.Request(data=True)).message == "paused"
    answers, place = len(peer.tools), peer.tools[-1].position[0]
    for _ in range(10):
        sequence += 1
        peer.handle.publish(handle(float(sequence), position=(0.0, 0.0, 0.0), stamp_ns=int(sequence * 1e6)))
        peer.executor.spin_once(timeout_sec=0.02)
    assert len(peer.tools) == answers
    assert peer.call(peer.pause, SetBool.Request(data=False)).success
    peer.ask(sequence, (0.02, 0.0, 0.0))
    assert peer.tools[-1].position[0] == pytest.approx(place, abs=1e-3)


def test_the_last_word_at_the_end_is_how_things_then_stand(start, peer):
    process = simulation(start, scene="peg_in_hole")
    peer.until(lambda: peer.handle.get_subscription_count() == 1)
    sequence = 0
    for _ in range(5):
        sequence = peer.ask(sequence)
    process.send_signal(signal.SIGTERM)
    peer.until(lambda: peer.said and int(peer.said[-1]["answered"]) >= 5)
    assert float(peer.said[-1]["result.insertion_fraction"]) == pytest.approx(-0.5, abs=0.01)
    assert {"max_contact_force", "max_penetration", "refused", "rejoined", "sub_steps"} <= peer.said[-1].keys()


@pytest.mark.parametrize(
    ("parameters", "words"),
    [({"scene": "nowhere"}, ["nowhere", "peg_in_hole"]), ({"sub_step": "1.0"}, ["sub_step", "1.0 s", "at most"]),
     ({"scen": "wall"}, ["scen is not", "did you mean scene"])],
)
def test_a_bad_parameter_ends_the_node_with_one_sentence(start, parameters, words):
    process = simulation(start, **parameters)
    assert process.wait(20.0) == 1
    said = process.stderr.read().strip().splitlines()[-1]
    assert said.startswith("haptic_simulation: ")
    assert all(word in said for word in words), said
