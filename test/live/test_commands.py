# SPDX-License-Identifier: Apache-2.0
"""The driver's services from the terminal, with a driver that answers late or never."""

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger
from waiting import LIMIT, until

from haptic_sim.cli import commands

pytestmark = pytest.mark.timeout(300)


class Driver:
    """Offers all services; answers when it is served, by `served`."""

    def __init__(self, context):
        node = rclpy.create_node("haptic_driver", namespace="/haptic", context=context)
        for name in commands.NAMES:
            node.create_service(Trigger, f"~/{name}", lambda request, answer: answer)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(node)

    def serve(self):
        self._executor.spin_once(timeout_sec=1.0)


@pytest.fixture
def asked(ros_domain):
    """(commands, clients by name, driver), which have met."""
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("terminal", namespace="/haptic", context=context)
    driver, found = Driver(context), commands.Commands(node, context)
    clients = {client.srv_name.rsplit("/")[-1]: client for client in node.clients}
    until(lambda: all(client.service_is_ready() for client in clients.values()), "the services")
    yield found, clients, driver
    found.close()
    context.shutdown()


def test_no_request_is_kept_that_was_given_up(asked):
    found, clients, _ = asked
    for _ in range(3):
        assert found.call("enable", patience=0.5) == (False, "haptic_driver did not answer ~/enable within 0.5 s")
    assert clients["enable"]._pending_requests == {}


def test_no_request_is_kept_that_was_asked_again_before_one_was_answered(asked, monkeypatch):
    found, clients, driver = asked
    monkeypatch.setattr(commands, "AGAIN", -1.0)
    client, ask, sent = clients["reset"], clients["reset"].call_async, []

    def counted(request):
        sent.append(ask(request))
        if len(sent) >= 5:
            driver.serve()
        return sent[-1]

    monkeypatch.setattr(client, "call_async", counted)
    assert found.call("reset", LIMIT) == (False, "")
    assert len(sent) >= 5 and client._pending_requests == {}
