# SPDX-License-Identifier: Apache-2.0
"""Services of the running nodes, for asyncio: asked again when no answer comes; no page ever waits for them."""

import asyncio
import threading

from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python
from std_srvs.srv import Trigger

ANSWER = 0.4  # s until it is asked again: the first answer to a client just discovered may be lost
LOOK_UP = 0.05  # s, longest time until the thread finds out that it shall end
ATTEMPTS = 12  # a busy machine may hold a node up for seconds


class Services:
    """Clients on a node, answered by an executor in a thread of its own. Failures are ValueError sentences."""

    def __init__(self, node):
        self._node, self._clients, self._loop = node, {}, None
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._spin, name="services")

    def start(self) -> None:
        """Begins, in the running event loop."""
        self._loop = asyncio.get_running_loop()
        self._thread.start()

    def stop(self) -> None:
        """Ends thread and executor; the node can then be destroyed."""
        self._over.set()
        self._thread.join()
        self._executor.shutdown()

    def _spin(self):
        while not self._over.is_set():
            try:
                self._executor.spin_once(timeout_sec=LOOK_UP)
            except Exception as error:  # one answer that cannot be read is not the end of all others
                self._node.get_logger().error(f"an answer could not be taken: {type(error).__name__}: {error}")

    def prepare(self, kind, service: str) -> None:
        """Makes a client now, so that it knows its service when it is needed."""
        if service not in self._clients:
            self._clients[service] = self._node.create_client(kind, service)

    async def ask(self, kind, service: str, request, attempts: int = ATTEMPTS, patience: float = ANSWER):
        """The first answer, to whichever attempt. Only for requests that do no harm if they are heard twice."""
        self.prepare(kind, service)
        client, node = self._clients[service], service.split("/")[0]
        if not client.service_is_ready():
            raise ValueError(f"{node} is not there: nobody offers {service}")
        answer, asked = self._loop.create_future(), []
        try:
            for _ in range(attempts):
                asked.append(client.call_async(request))
                asked[-1].add_done_callback(lambda done: self._tell(answer, done))
                await asyncio.wait([answer], timeout=patience)
                if answer.done():
                    return answer.result()
        finally:
            for future in asked:
                client.remove_pending_request(future)
        raise ValueError(f"{node} did not answer {service} within {attempts * patience:g} s")

    async def trigger(self, service: str, attempts: int = ATTEMPTS, patience: float = ANSWER) -> str:
        """What a std_srvs/Trigger answers; ValueError with its sentence if it refuses."""
        answer = await self.ask(Trigger, service, Trigger.Request(), attempts, patience)
        if not answer.success:
            raise ValueError(answer.message or f"{service} refused")
        return answer.message

    async def get(self, node: str, names) -> dict:
        """Values of a node's parameters; arrays as lists, those it does not have are left out."""
        names = list(names)
        answer = await self.ask(GetParameters, f"{node}/get_parameters", GetParameters.Request(names=names), 1)
        values = [parameter_value_to_python(value) for value in answer.values]
        return {name: _plain(value) for name, value in zip(names, values, strict=False) if value is not None}

    async def set(self, node: str, values: dict) -> None:
        """Sets live parameters, all or none; ValueError with the node's own sentence if it refuses."""
        parameters = [_parameter(name, value).to_parameter_msg() for name, value in values.items()]
        request = SetParametersAtomically.Request(parameters=parameters)
        result = (await self.ask(SetParametersAtomically, f"{node}/set_parameters_atomically", request)).result
        if not result.successful:
            raise ValueError(result.reason or f"{node} refused {', '.join(values)}")

    def _tell(self, answer, done):
        def hand_over():
            if not answer.done():
                answer.set_result(done.result())

        if done.result() is not None:
            self._loop.call_soon_threadsafe(hand_over)


def _plain(value):
    return value.tolist() if hasattr(value, "tolist") else list(value) if isinstance(value, tuple) else value


def _parameter(name, value):
    kind = Parameter.Type.DOUBLE_ARRAY if isinstance(value, list) else None
    return Parameter(name, kind, value) if kind else Parameter(name, value=value)
