# SPDX-License-Identifier: Apache-2.0
"""Messages on `tool` that are refused take no answer's place, however many come between two looks."""

import contextlib
import math
from types import SimpleNamespace

import pytest
import rclpy
from rclpy.context import Context
from waiting import until

from haptic_device.control import contact_model, exchange_samples, records
from haptic_device.message_fields import TAIL, exchange_names
from haptic_device.nodes import messages
from haptic_device.nodes.exchange_server import ExchangeServer
from haptic_device.realtime import servo_loop
from haptic_device.realtime.seqlock import SeqLock
from haptic_device.recording.layouts import JointLayout

AXES, FLOOD, SENT = 2, 40, 100.0  # messages between two answers; handle samples that went out before
VALUES = {"realtime": "off", "exchange.rate": 1000.0, "exchange.method": "pspm"}


@pytest.fixture
def exchange(ros_domain):
    """(server that has not begun to look, function that sends an answer to a handle sample, with a position)."""
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain)
    mails = {
        name: SeqLock(dtype)
        for name, dtype in (
            ("row", records.TRACE_ROW),
            ("gains", exchange_samples.COUPLING_GAINS),
            ("tool", servo_loop.TOOL),
            ("near", contact_model.SET),
        )
    }
    driver, other = (rclpy.create_node(name, context=context) for name in ("driver", "other"))
    server = ExchangeServer(driver, SimpleNamespace(**mails), AXES, VALUES, 0)
    server.state["sequence"] = SENT
    publisher = other.create_publisher(messages.JointState, "tool", messages.LATEST)
    layout, still = JointLayout(exchange_names(AXES)), [0.0] * (AXES + len(TAIL))

    def answer(answered, x=0.01):
        tail = dict.fromkeys(TAIL, 0.0) | {"layout_version": exchange_samples.LAYOUT_VERSION, "session": 7.0}
        tail |= {"sequence": 1.0, "answered_session": float(server.state["session"][0]), "answered": answered}
        tail |= {"exchange_method": float(exchange_samples.PSPM)}
        publisher.publish(layout.pack(0, [x, 0.0, *tail.values()], still, still))

    until(lambda: publisher.get_subscription_count() == 1, "the driver's side hears the other")
    with contextlib.closing(SimpleNamespace(close=server.stop)):
        yield server, answer
    for node in (driver, other):
        node.destroy_node()
    rclpy.shutdown(context=context)


def test_an_answer_amid_a_flood_of_infinite_ones_counts_and_each_of_these_is_refused(exchange):
    server, answer = exchange
    answer(SENT - 1.0)
    for _ in range(FLOOD):
        answer(SENT, math.inf)
    answer(SENT)
    server.start()
    until(lambda: server.state["peer_answered"][0] == SENT, "the last answer counts")
    assert server.answered == 2 and server.refusals() == {"NaN or out of range": FLOOD}
