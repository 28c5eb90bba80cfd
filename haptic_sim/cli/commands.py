# SPDX-License-Identifier: Apache-2.0
"""The driver's services from the terminal: asked until they answer, for answers are lost while nodes still meet."""

import time

from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import Trigger

NAMES = ("estop", "reset", "enable", "disable")
AGAIN = 0.3  # [s] without an answer after which a service is asked once more
PATIENCE = 3.0  # [s]


class Commands:
    """Clients of ~/estop, ~/reset, ~/enable, ~/disable, there from the start so that an e-stop finds them known."""

    def __init__(self, node, context):
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(node)
        self._clients = {name: node.create_client(Trigger, f"haptic_driver/{name}") for name in NAMES}

    def call(self, name: str, patience: float = PATIENCE) -> tuple[bool, str]:
        """(success, message) of the driver's answer; a sentence of our own if none came in time [s]."""
        end, asked, futures, client = time.monotonic() + patience, 0.0, [], self._clients[name]
        try:
            while time.monotonic() < end:
                if time.monotonic() - asked > AGAIN and client.service_is_ready():
                    futures.append(client.call_async(Trigger.Request()))
                    asked = time.monotonic()
                self._executor.spin_once(timeout_sec=0.01)
                for future in futures:
                    if future.done():
                        return future.result().success, future.result().message
        finally:
            for future in futures:
                client.remove_pending_request(future)
        return False, f"haptic_driver did not answer ~/{name} within {patience:g} s"

    def close(self) -> None:
        """Ends the executor."""
        self._executor.shutdown()
