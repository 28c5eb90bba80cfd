# SPDX-License-Identifier: Apache-2.0
"""Live nodes among enemies: services with nonsense in them, and a flood on every topic; the handle does not notice."""

import math
import subprocess
import sys
import time

import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from live_nodes import SLOW, Ear, Nodes
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically

pytestmark = pytest.mark.timeout(600)

DRIVER = {"engage__time": 0.05, "auto_enable": True, **SLOW}
NODES = ("haptic_driver", "haptic_loopback", "haptic_simulation")
FLOOD = [sys.executable, "-m", "haptic_sim.cli.flood", "10000", "2"]


@pytest.fixture(scope="module")
def nodes(ros_domain, tmp_path_factory):
    with Nodes(tmp_path_factory.mktemp("nodes")) as nodes:
        nodes.start("haptic_loopback", motion__name="follow")
        nodes.start("haptic_simulation", scene="free_space")
        nodes.start("haptic_driver", **DRIVER)
        yield nodes
        for process in nodes.running.values():
            assert process.poll() is None and "Traceback" not in process.log.read_text()


@pytest.fixture(scope="module")
def ear(ros_domain, nodes):
    ear = Ear(ros_domain)
    try:
        ear.go_to(0.0)
        ear.until(lambda: ear.said.get("haptic_driver"), "the driver says something")
        ear.cleared()
        ear.engaged()
        yield ear
    finally:
        ear.close()


def send(ear, service, kind, request):
    """Calls without waiting for an answer: nonsense may get none."""
    client = ear.node.create_client(kind, service)
    ear.until(client.service_is_ready, f"the service {service}")
    client.call_async(request)


def survived(ear, node, before):
    """Waits until the node says that it has survived one more."""
    ear.news(node, lambda level, message, values: int(values["survived"]) > before, what="it survived")


def refusals(values):
    """How many messages a node says that it refused."""
    return sum(int(value) for name, value in values.items() if name.startswith(("refused.", "refused_t")))


@pytest.mark.parametrize("node", NODES)
def test_a_parameter_of_no_known_type_ends_no_node(ear, node):
    before = int(ear.news(node, lambda level, message, values: True)[2]["survived"])
    nonsense = Parameter(name="realtime", value=ParameterValue(type=99))
    send(ear, f"{node}/set_parameters", SetParameters, SetParameters.Request(parameters=[nonsense]))
    survived(ear, node, before)


@pytest.mark.parametrize("node", NODES)
def test_a_transition_that_does_not_exist_or_does_not_fit_ends_no_node(ear, node):
    before = int(ear.news(node, lambda level, message, values: True)[2]["survived"])
    for number in (250, Transition.TRANSITION_CONFIGURE):
        send(ear, f"{node}/change_state", ChangeState, ChangeState.Request(transition=Transition(id=number)))
    survived(ear, node, before)
    label = ChangeState.Request(transition=Transition(id=0, label="explode"))
    assert not ear.ask(f"{node}/change_state", ChangeState, label).success


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("no.such.parameter", ParameterValue(type=3, double_value=1.0)),
        ("", ParameterValue(type=3, double_value=1.0)),
        ("coupling.stiffness", ParameterValue(type=3, double_value=math.nan)),
        ("coupling.stiffness", ParameterValue(type=4, string_value="x" * 100_000)),
        ("coupling.stiffness", ParameterValue(type=8, double_array_value=[1e308] * 1000)),
        ("wall.stiffness", ParameterValue(type=8, double_array_value=[1.0] * 10_000)),
        ("diagnostics.margin.warn", ParameterValue(type=3, double_value=math.inf)),
        ("engage.time", ParameterValue(type=0)),
    ],
)
def test_a_wild_parameter_is_refused_with_its_reason(ear, name, value):
    request = SetParametersAtomically.Request(parameters=[Parameter(name=name, value=value)])
    result = ear.ask("haptic_driver/set_parameters_atomically", SetParametersAtomically, request, again=3.0).result
    assert not result.successful and result.reason and len(result.reason) < 300_000


def test_a_flood_of_messages_that_are_not_theirs_moves_nothing_and_is_counted(ear, start):
    before, begin = int(ear.engaged()[2]["ticks"]), len(ear.truths)
    flood = start(FLOOD, stdout=subprocess.PIPE)
    ear.until(lambda: flood.poll() is not None, "the flood is over")
    assert flood.returncode == 0 and int(flood.stdout.read().split()[-1]) > 0
    for node in NODES:
        ear.news(node, lambda level, message, values: refusals(values) > 0, what=f"{node} counts what it refused")
    _, _, values = ear.news("haptic_driver", lambda level, message, values: True)
    assert values["fault"] == "" and int(values["ticks"]) > before
    moved = [abs(truth.position[:2]).max() for truth in ear.truths[begin:]]
    pushed = [abs(ear.motor(truth)[:2]).max() for truth in ear.truths[begin:]]
    assert max(moved) < 5e-4 and max(pushed) < 0.5


def test_the_next_word_is_heard_as_before(ear):
    assert ear.trigger("estop") == (True, "e-stop latched, motor zero")
    ear.motor_off_after(time.monotonic())
    assert ear.trigger("reset")[0] and ear.trigger("enable") == (True, "enabled")
