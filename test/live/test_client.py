# SPDX-License-Identifier: Apache-2.0
"""Questions to a node that answers late, refuses, or never answers; none is kept that nobody waits for."""

import asyncio
import contextlib

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger
from waiting import LIMIT, until

from haptic_display.client import Client
from haptic_display.service_requests import RefusedError, get_parameters, set_parameters, trigger

ENABLE, RESET = trigger("haptic_driver/enable"), trigger("haptic_driver/reset")
GET = get_parameters("haptic_driver", ["wall.stiffness", "servo.rate"])


class Driver:
    """Offers services and two parameters; answers when it is served. It enables, and refuses to reset."""

    def __init__(self, context):
        self.node = rclpy.create_node("haptic_driver", namespace="/haptic", context=context)
        self.node.create_service(Trigger, "~/enable", self._enable)
        self.node.create_service(Trigger, "~/reset", lambda request, answer: answer)
        self.node.declare_parameter("wall.stiffness", [300.0])
        self.node.declare_parameter("servo.rate", 1000.0)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self.node)

    def _enable(self, request, answer):
        answer.success, answer.message = True, "enabled"
        return answer

    def serve(self):
        self._executor.spin_once(timeout_sec=0.1)

    def close(self):
        self._executor.shutdown()
        self.node.destroy_node()


@pytest.fixture
def met(ros_domain):
    """(client, driver), which have met."""
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain, signal_handler_options=SignalHandlerOptions.NO)
    with (
        contextlib.closing(Driver(context)) as driver,
        contextlib.closing(Client.join("terminal", ros_domain, "/haptic")) as client,
    ):
        names = [question.service for question in (ENABLE, RESET, GET, set_parameters("haptic_driver", {}))]
        client.prepare(*names)
        until(lambda: all(client.service(name).ready for name in names), "the services")
        yield client, driver
    context.shutdown()


def answered(client, driver, *questions, **how):
    """What these questions give, all asked at once, while the driver is served."""

    async def all_of_them():
        asked = [asyncio.ensure_future(client.acall(question, patience=LIMIT, **how)) for question in questions]
        while not all(one.done() for one in asked):
            driver.serve()
            await asyncio.sleep(0.001)
        return [one.result() for one in asked]

    return asyncio.run(all_of_them())


def test_no_request_is_kept_that_was_given_up(met):
    client, _ = met
    for _ in range(3):
        with pytest.raises(ValueError, match="^haptic_driver did not answer ~/enable within 0.5 s$"):
            client.call(ENABLE, patience=0.5)
    assert client.service(ENABLE.service).asked == {}


def test_no_request_is_kept_that_was_asked_again_before_one_was_answered(met):
    client, driver = met
    service = client.service(RESET.service)

    async def served_late():
        asking = asyncio.ensure_future(client.acall(RESET, patience=LIMIT, again=0.0))
        while len(service.asked) < 5:
            await asyncio.sleep(0.001)
        while not asking.done():
            driver.serve()
            await asyncio.sleep(0.001)
        return asking.result()

    with pytest.raises(RefusedError, match="^haptic_driver/reset refused$"):
        asyncio.run(served_late())
    assert service.asked == {}


def test_who_asks_the_same_at_once_is_answered_each(met):
    assert answered(*met, ENABLE, ENABLE, ENABLE, again=None) == ["enabled"] * 3


def test_an_answer_that_cannot_be_read_is_not_the_end_of_the_question(met, monkeypatch):
    whole, torn = rclpy.client.Client.handle.fget, [RuntimeError("torn")]

    class Handle:
        def __init__(self, handle):
            self._handle = handle

        def __enter__(self):
            self._handle.__enter__()
            return self

        def __exit__(self, *error):
            return self._handle.__exit__(*error)

        def __getattr__(self, name):
            return getattr(self._handle, name)

        def take_response(self, kind):
            header, answer = self._handle.take_response(kind)
            if header is not None and torn:
                raise torn.pop()
            return header, answer

    monkeypatch.setattr(rclpy.client.Client, "handle", property(lambda client: Handle(whole(client))))
    assert answered(*met, ENABLE) == ["enabled"] and not torn


def test_a_service_that_the_graph_never_shows_is_asked_all_the_same_if_it_may_be_asked_again(met, monkeypatch):
    monkeypatch.setattr(rclpy.client.Client, "service_is_ready", lambda client: False)
    client, driver = met
    assert answered(client, driver, ENABLE) == ["enabled"]
    with client.ask(RESET, patience=1.5, again=None) as asking:
        with pytest.raises(ValueError, match="^haptic_driver offers no ~/reset in /haptic"):
            until(asking.poll, "the refusal")
        assert client.service(RESET.service).asked == {}


def test_parameters_are_set_all_or_none_and_a_refusal_is_the_nodes_own_sentence(met):
    client, driver = met
    assert answered(client, driver, GET) == [{"wall.stiffness": (300.0,), "servo.rate": 1000.0}]
    with pytest.raises(RefusedError, match="Wrong parameter type"):
        answered(client, driver, set_parameters("haptic_driver", {"wall.stiffness": (1.0,), "servo.rate": "fast"}))
    assert answered(client, driver, set_parameters("haptic_driver", {"wall.stiffness": (1.0, 2.0)})) == [None]
    assert answered(client, driver, GET) == [{"wall.stiffness": (1.0, 2.0), "servo.rate": 1000.0}]


def test_a_service_that_nobody_offers_is_refused_at_once_or_when_patience_ends(met):
    client, _ = met
    for how in ({"wait": False}, {"patience": 0.2}):
        with pytest.raises(ValueError, match="^haptic_driver offers no ~/dance in /haptic; does it run in this domain"):
            client.call(trigger("haptic_driver/dance"), **how)
