# SPDX-License-Identifier: Apache-2.0
"""Driver and simulation exchange samples, whoever came first; gains and strangers on the way."""

import time

import pytest
from live_nodes import DISPLAY

from haptic_device.control import exchange_samples
from haptic_device.message_fields import TAIL, exchange_names
from haptic_device.recording.layouts import JointLayout

NODES = {name: DISPLAY[name] for name in ("haptic_loopback", "haptic_driver")}
NAMES = exchange_names(3)
WARN = 1
QUIET = 0.5  # [N] on the handle


@pytest.fixture
def handles(display):
    """The handle samples that come."""
    display.hear_handles()
    display.until(lambda: display.handles, "a handle sample")
    yield display.handles
    display.hear_handles(False)


def answered(level, message, values):
    """Whether an engaged driver has a simulation that answers."""
    there = values["state"] == "engaged" and "no simulation" not in message
    return there and int(values["exchange_answered"]) > 0


def test_a_driver_exchanges_samples_with_a_simulation_that_came_later(display, nodes):
    level, message, _ = display.engaged()
    assert level == WARN and "no simulation: the handle is in free space" in message
    nodes.have("haptic_simulation", **DISPLAY["haptic_simulation"])
    display.news("haptic_driver", answered, what="an answer")
    display.go_to(0.005)
    display.truth(lambda truth: abs(truth.position[0] - 0.005) < 5e-4, what="the handle is at 5 mm with its tool")


def test_softer_gains_are_taken_while_it_runs_and_told_to_the_simulation(display, handles):
    told = NAMES.index("stiffness")
    for stiffness in (300.0, 200.0):
        assert display.set("coupling.stiffness", stiffness) == (True, "")
        handles.clear()
        display.until(
            lambda: handles and handles[-1].position[told] == stiffness,  # noqa: B023
            f"a handle sample with {stiffness} N/m",
        )
        gains = [handles[-1].position[NAMES.index(name)] for name in TAIL[exchange_samples.GAIN_0 :][:4]]
        assert handles[-1].position[NAMES.index("gains_hash")] == exchange_samples.gains_hash(*gains)


def test_a_second_simulation_is_refused_counted_and_not_felt(display, nodes, handles):
    nodes.have("haptic_simulation", **DISPLAY["haptic_simulation"])
    display.engaged()
    display.news("haptic_driver", answered, what="an answer")
    begin, heard, still = len(display.truths), len(display.said["haptic_driver"]), [0.0] * len(NAMES)
    layout, sent = JointLayout(NAMES), 0.0

    def forge():
        """A tool far away, as another simulation would answer to the newest handle sample, every few milliseconds."""
        nonlocal sent
        if time.monotonic() > sent + 0.003:
            tail, sent = dict(zip(NAMES[3:], handles[-1].position[3:], strict=True)), time.monotonic()
            tail |= {"answered_session": tail["session"], "answered": tail["sequence"]}
            tail |= {"session": 4711.0, "sequence": 1.0}
            display.tool.publish(layout.pack(0, [0.1, -0.1, 1.0, *tail.values()], still, still))

    def refused():
        forge()
        said = "tool messages refused: second publisher; end one of the two"
        return next((one for one in display.said["haptic_driver"][heard:] if said in one[1]), None)

    level, _, values = display.until(refused, "the driver says that it refuses")
    assert level == WARN and int(values["refused.second publisher"]) > 0 and values["fault"] == ""
    assert max(abs(display.motor(truth)[:2]).max() for truth in display.truths[begin:]) < QUIET
