# SPDX-License-Identifier: Apache-2.0
"""A service with a thread of its own: it is answered whatever else its node is busy with."""

import threading

from rclpy.impl.implementation_singleton import rclpy_implementation

from haptic_device.node.tap import Untouched

LOOK_UP_NS = 50_000_000  # longest time until it finds out that it shall end


class ServiceThread:
    """Answers from start() until stop(); answer(request, response) → response runs in this thread."""

    def __init__(self, node, kind, name, answer):
        self._node, self._kind, self._answer, self._stopped = node, kind, answer, False
        self._service = node.create_service(kind, name, answer, callback_group=Untouched())
        self._thread = threading.Thread(target=self._run, name=name)

    def start(self):
        """Starts the thread; who keeps this object by then can stop it."""
        self._thread.start()

    def stop(self):
        """Ends the thread, then the service."""
        self._stopped = True
        if self._thread.is_alive():
            self._thread.join()
        self._node.destroy_service(self._service)

    def _run(self):
        context, handle = self._node.context, self._service.handle
        with handle, context.handle:  # they live on while they are waited for
            wait_set = rclpy_implementation.WaitSet(0, 0, 0, 0, 1, 0, context.handle)
            while not self._stopped and context.ok() and threading.main_thread().is_alive():
                try:
                    self._serve(wait_set, handle)
                except Exception as error:
                    self._node.survive(error)

    def _serve(self, wait_set, handle):
        wait_set.clear_entities()
        wait_set.add_service(handle)
        wait_set.wait(LOOK_UP_NS)
        request, header = handle.service_take_request(self._kind.Request)
        if header is not None:
            self._service.send_response(self._answer(request, self._kind.Response()), header)
