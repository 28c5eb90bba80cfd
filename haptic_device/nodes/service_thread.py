# SPDX-License-Identifier: Apache-2.0
"""Services with a thread of their own: they are answered whatever else their node is busy with."""

import contextlib
import threading

from rclpy.impl.implementation_singleton import rclpy_implementation
from std_srvs.srv import Trigger

from haptic_device.nodes.polled_subscription import Untouched

LOOK_UP_NS = 50_000_000  # longest time until it finds out that it shall end


class ServiceThread:
    """Answers Trigger services from start() until stop(). The first goes before all others.

    answers: {name: answer(request, response) → response}, called in this thread. Whatever waits at the others when the
    first has been answered was asked for without knowing of it, and is refused with the sentence `overruled`.
    """

    def __init__(self, node, answers, overruled):
        self._node, self._overruled, self._stopped = node, overruled, False
        self._services = [
            (node.create_service(Trigger, name, answer, callback_group=Untouched()), answer)
            for name, answer in answers.items()
        ]
        self._thread = threading.Thread(target=self._run, name="services")

    @property
    def running(self):
        """Whether somebody is there to hear."""
        return self._thread.is_alive()

    def start(self):
        """Starts the thread; who keeps this object by then can stop it."""
        self._thread.start()

    def stop(self):
        """Ends the thread, then the services."""
        self._stopped = True
        if self._thread.is_alive():
            self._thread.join()
        for service, _ in self._services:
            self._node.destroy_service(service)

    def _run(self):
        context, handles = self._node.context, [service.handle for service, _ in self._services]
        with contextlib.ExitStack() as kept:
            for one in (context.handle, *handles):  # they live on while they are waited for
                kept.enter_context(one)
            wait_set = rclpy_implementation.WaitSet(0, 0, 0, 0, len(handles), 0, context.handle)
            while not self._stopped and context.ok() and threading.main_thread().is_alive():
                wait_set.clear_entities()
                for handle in handles:
                    wait_set.add_service(handle)
                wait_set.wait(LOOK_UP_NS)
                try:
                    self._serve()
                except Exception as error:
                    self._node.survive(error)

    def _serve(self):
        first, *others = self._services
        for one in others:
            if self._answer(*first):
                for late in others:
                    while self._answer(*late, self._overruled):
                        pass
                return
            self._answer(*one)

    def _answer(self, service, answer, refusal=""):
        """Whether there was a request, which is answered now."""
        request, header = service.handle.service_take_request(Trigger.Request)
        if header is not None:
            response = Trigger.Response(message=refusal)
            service.send_response(response if refusal else answer(request, response), header)
        return header is not None
