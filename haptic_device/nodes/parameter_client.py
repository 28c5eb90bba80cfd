# SPDX-License-Identifier: Apache-2.0
"""Asks the nodes of a namespace for all their parameters, once until told otherwise, without ever waiting."""

import math
import time
from collections.abc import Callable

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python

AGAIN = 3.0  # [s] an answer is lost if its server was found a moment ago: asked again after this time


class ParameterClient:
    """tell(node name, {parameter: value}) is called with each node's answer."""

    def __init__(self, node: Node, tell: Callable[[str, dict], None]):
        self._node, self._tell = node, tell
        self._asked: dict[str, tuple] = {}
        self._answered: set[str] = set()

    def look(self) -> None:
        """Asks who is new or has not answered; a node that has gone is asked again when it comes back."""
        own, prefix = self._node.get_name(), self._node.get_namespace()
        there = {name for name, namespace in self._node.get_node_names_and_namespaces() if namespace == prefix} - {own}
        for name in [name for name in self._asked if name not in there]:
            self._forget(name)
        for name in there - self._answered:
            if name not in self._asked or time.monotonic() > self._asked[name][0] + AGAIN:
                self._ask(name)

    def again(self) -> None:
        """With the next look every node is asked anew."""
        self._answered.clear()
        self._asked = {name: (-math.inf, *clients) for name, (_, *clients) in self._asked.items()}

    def _ask(self, name: str) -> None:
        """With the same clients each time: a node that was busy answers old requests too, and for each whose client has
        gone rmw_fastrtps waits 100 ms, holding the interpreter of that node."""
        if name not in self._asked:
            listing = self._node.create_client(ListParameters, f"{name}/list_parameters")
            getting = self._node.create_client(GetParameters, f"{name}/get_parameters")
        else:
            _, listing, getting = self._asked[name]
        self._asked[name] = time.monotonic(), listing, getting
        if listing.service_is_ready() and getting.service_is_ready():
            future = listing.call_async(ListParameters.Request())
            future.add_done_callback(lambda done: self._get(name, getting, done.result()))

    def _get(self, name: str, getting, listed) -> None:
        if listed is None or self._asked.get(name, (0, 0, None))[2] is not getting:
            return
        names = sorted(listed.result.names)
        future = getting.call_async(GetParameters.Request(names=names))
        future.add_done_callback(lambda done: self._take(name, names, done.result()))

    def _take(self, name: str, names: list[str], got) -> None:
        if got is not None and len(got.values) == len(names) and name not in self._answered:
            self._answered.add(name)
            values = (_plain(parameter_value_to_python(value)) for value in got.values)
            self._tell(name, dict(zip(names, values, strict=True)))

    def _forget(self, name: str) -> None:
        self._answered.discard(name)
        for client in self._asked.pop(name, (0,))[1:]:
            self._node.destroy_client(client)


def _plain(value):
    """Arrays as lists, for YAML."""
    return value.tolist() if hasattr(value, "tolist") else value
