# SPDX-License-Identifier: Apache-2.0
"""Live nodes among enemies: what is not theirs is refused, said and counted, and the handle does not notice."""

import subprocess
import time

import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from live_nodes import DISPLAY
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically

from fault_injection.flood import COMMAND
from haptic_device.message_fields import exchange_names
from haptic_device.recording.layouts import JointLayout

WARN = 1
NODES = DISPLAY
FLOOD = [*COMMAND, "10000", "2"]
QUIET, STILL = 0.5, 5e-4  # [N] on the handle, [m] of the handle
BUDGET = 0.005  # [J]


@pytest.fixture
def exchanging(display):
    """Values of the driver's diagnostics once it and the simulation exchange, and its forces are on."""
    assert display.trigger("enable")[0]
    display.news("haptic_driver", lambda level, message, values: int(values["exchange_answered"]) > 300, what="answers")
    return engaged(display)[2]


def engaged(ear):
    """The next news of a driver whose forces are on."""
    return ear.news("haptic_driver", lambda level, message, values: values["state"] == "engaged", what="it is engaged")


def pushed(ear, begin):
    """Largest force of the motor [N] in the truths from `begin` on."""
    return max(abs(ear.motor(truth)[:2]).max() for truth in ear.truths[begin:])


def no_fault(ear):
    """Nothing that came in has latched a fault."""
    return ear.last()["haptic_driver"][2]["fault"] == ""


def send(ear, publisher, message, condition, what):
    """Publishes message() every few milliseconds until the condition holds."""
    asked = 0.0

    def done():
        nonlocal asked
        if time.monotonic() > asked + 0.003 and (data := message()) is not None:
            publisher.publish(data)
            asked = time.monotonic()
        return condition()

    return ear.until(done, what)


def survived(ear, nonsense):
    """Sends nonsense(node) to each node, and waits until each says that it has survived one more."""
    before = {node: int(ear.news(node, lambda *said: True)[2]["survived"]) for node in NODES}
    for node in NODES:
        nonsense(node)
    for node, count in before.items():
        ear.until(lambda node=node, count=count: int(ear.last()[node][2]["survived"]) > count, f"{node} survived it")


def test_a_parameter_of_no_known_type_ends_no_node_and_wild_ones_are_refused_with_their_reason(exchanging, ear):
    nonsense = Parameter(name="realtime", value=ParameterValue(type=99))
    request = SetParameters.Request(parameters=[nonsense])
    survived(ear, lambda node: ear.send(f"{node}/set_parameters", request))
    text = ParameterValue(type=4, string_value="x" * 100_000)
    for name, value in (("coupling.stiffness", text), ("engage.time", ParameterValue(type=0))):
        request = SetParametersAtomically.Request(parameters=[Parameter(name=name, value=value)])
        result = ear.ask("haptic_driver/set_parameters_atomically", request).result
        assert not result.successful and result.reason and len(result.reason) < 300_000


def test_a_transition_that_does_not_exist_or_does_not_fit_is_answered_and_ends_no_node(exchanging, ear):
    configure = Transition(id=Transition.TRANSITION_CONFIGURE)
    for wanted in (Transition(id=250), configure, Transition(id=0, label="explode")):
        request = ChangeState.Request(transition=wanted)
        assert not any(ear.ask(f"{node}/change_state", request).success for node in NODES)


def refusals(values):
    """How many messages a node says that it refused."""
    return sum(int(value) for name, value in values.items() if name.startswith(("refused.", "refused_t")))


def test_a_flood_of_messages_that_are_not_theirs_moves_nothing_and_is_counted(exchanging, ear, start):
    ear.go_to(0.0)
    before, begin = int(ear.engaged()[2]["ticks"]), len(ear.truths)
    flood = start(FLOOD, stdout=subprocess.PIPE)
    ear.until(lambda: flood.poll() is not None, "the flood is over")
    assert flood.returncode == 0 and int(flood.stdout.read().split()[-1]) > 0
    for node in NODES:
        ear.news(node, lambda level, message, values: refusals(values) > 0, what=f"{node} counts what it refused")
    _, _, values = ear.news("haptic_driver", lambda level, message, values: True)
    assert values["fault"] == "" and int(values["ticks"]) > before
    assert max(abs(truth.position[:2]).max() for truth in ear.truths[begin:]) < STILL and pushed(ear, begin) < QUIET


def test_wrong_stamps_and_jumps_of_the_simulation_that_is_accepted_give_no_energy_and_no_fault(exchanging, nodes, ear):
    nodes.lack("haptic_simulation")
    ear.hear_handles()
    begin, heard, layout = len(ear.truths), len(ear.handles), JointLayout(exchange_names(3))
    ear.until(lambda: len(ear.handles) > heard, "a handle sample")
    names, number = exchange_names(3), iter(range(1, 1 << 30))

    def forged():
        count, still = next(number), [0.0] * len(names)
        tail = dict(zip(names[3:], ear.handles[-1].position[3:], strict=True))
        ear.handles[:-1] = []
        answered = tail["sequence"] + (0.0, 0.0, 1e6, -50.0)[count % 4]  # and of the future, and of the past
        tail |= {"answered_session": tail["session"], "answered": answered, "session": 4711.0}
        jump = 0.1 * (-1.0) ** count
        place = [jump, -jump, 5.0 * jump, *(tail | {"sequence": float(count)}).values()]
        return layout.pack(10**18 * (count % 2), place, still, still)

    told = "refused.answers another session", "refused.late or repeated"

    def counted():
        values = ear.last()["haptic_driver"][2]
        return values["exchange_answered"] != known and all(int(values.get(key, "0")) > 20 for key in told)

    known = ear.last()["haptic_driver"][2]["exchange_answered"]
    send(ear, ear.tool, forged, counted, "answers that are taken and others that are refused")
    ear.hear_handles(False)
    assert no_fault(ear)
    given = [truth.position[2 * ear.axes] for truth in ear.truths[begin:]]
    assert max(given) - given[0] <= BUDGET


def test_an_exchange_method_that_differs_is_refused_in_a_sentence_and_the_handle_is_free(nodes, ear):
    nodes.lack("haptic_driver")  # which knows the simulation
    nodes.have("haptic_simulation", scene="free_space", exchange__method="direct")
    nodes.have("haptic_driver", auto_enable=True, **DISPLAY["haptic_driver"])
    said = "handle messages refused: other exchange method; set exchange.method alike on driver and simulation"
    level, message, values = ear.news("haptic_simulation", lambda level, message, values: said in message)
    assert level == WARN and int(values["refused.other exchange method"]) > 0 and values["answered"] == "0"
    level, message, values = engaged(ear)
    assert level == WARN and "no simulation: the handle is in free space" in message
    begin = len(ear.truths)
    ear.go_to(0.02)
    assert pushed(ear, begin) == 0.0
