# SPDX-License-Identifier: Apache-2.0
"""Services with a thread of their own: who is answered first, who is refused, and how it ends."""

import threading

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger
from waiting import LIMIT, until

from haptic_device.nodes.service_thread import ServiceThread


class Asked:
    """A node with the services `first`, `slow` and `other`, and a client of each: `order` is who was answered."""

    def __init__(self, domain):
        self.context, self.order, self.begun, self.go = Context(), [], threading.Event(), threading.Event()
        rclpy.init(context=self.context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        self.node = rclpy.create_node("asked", context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        names = "first", "slow", "other"
        self.services = ServiceThread(self.node, {name: self._answers(name) for name in names}, "overruled")
        self._clients = {name: self.node.create_client(Trigger, name) for name in names}
        self.services.start()
        for name, client in self._clients.items():
            until(client.service_is_ready, f"the service {name}")

    def _answers(self, name):
        def answer(request, response):
            self.order.append(name)
            if name == "slow":
                self.begun.set()
                self.go.wait(LIMIT)
            response.success = True
            return response

        return answer

    def ask(self, name):
        """A request, which has arrived when this returns: in one participant the caller delivers it himself."""
        return self._clients[name].call_async(Trigger.Request())

    def answer_of(self, asked):
        until(asked.done, "an answer", lambda: self._executor.spin_once(timeout_sec=0.05))
        return asked.result().success, asked.result().message

    def close(self):
        self.go.set()
        self.services.stop()
        self._executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def asked(ros_domain):
    asked = Asked(ros_domain)
    yield asked
    asked.close()


def test_the_first_goes_before_what_waits_longer_which_is_then_refused(asked):
    slow = asked.ask("slow")
    until(asked.begun.is_set, "the slow one has begun")
    other, first = asked.ask("other"), asked.ask("first")
    asked.go.set()
    assert asked.answer_of(first) == (True, "") == asked.answer_of(slow)
    assert asked.answer_of(other) == (False, "overruled")
    assert asked.order == ["slow", "first"]
    assert asked.answer_of(asked.ask("other")) == (True, ""), "what is asked for afterwards is done"


def test_it_says_whether_there_is_anybody_to_hear(asked):
    assert asked.services.running
    rclpy.shutdown(context=asked.context)
    until(lambda: not asked.services.running, "the end of the thread, whose context has ended")
