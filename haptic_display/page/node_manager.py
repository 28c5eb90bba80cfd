# SPDX-License-Identifier: Apache-2.0
"""The nodes of a run whose viewer is this process, which may start them again with another network or exchange."""

import asyncio
import time
from collections.abc import Callable, Collection
from typing import Any

from haptic_device.config.parameter_files import Values
from haptic_display.page.settings import DRIVER, RECORDER, SIMULATION
from haptic_display.run.domain import isolated_domain
from haptic_display.run.prepare import prepare
from haptic_display.run.processes import NAMESPACE, Nodes, ros_arguments, undisturbed
from haptic_display.run.system import Order, Relay, programs_of
from haptic_sim.node.parameters import NODES

HAND: Values = {"haptic_loopback": {"motion.name": "follow"}, RECORDER: {"bag": "", "autostart": False}}
NETWORK = {"delay": 200.0, "jitter": 200.0}  # most that may be asked for [ms]: beyond it nothing more is felt


class NodeManager:
    """The nodes of an order."""

    def __init__(self, order: Order, nodes: Nodes):
        self._order, self._nodes = order, nodes
        self._changing = asyncio.Lock()

    def start(self) -> None:
        """Starts all nodes."""
        for program in programs_of(self._order):
            self._nodes.start(program)

    def keep(self, values: Values) -> None:
        """What the next start of the nodes shall not lose: the driver's live parameters, the simulation's scene and
        method. values: as the nodes say them now, {node: {name: value}}; what is not said stays as it was."""
        if self._changing.locked():
            return
        live = {parameter.name for parameter in NODES[DRIVER] if parameter.live}
        driver = {name: value for name, value in values.get(DRIVER, {}).items() if name in live}
        method = {name: value for name, value in values.get(SIMULATION, {}).items() if name == "method"}
        given = self._order.given
        kept = {DRIVER: given.get(DRIVER, {}) | driver, SIMULATION: given.get(SIMULATION, {}) | method}
        scene = values.get(SIMULATION, {}).get("scene", self._order.scene)
        self._order = self._order._replace(scene=scene, given=given | kept)

    def offer(self) -> dict[str, dict[str, Any]]:
        """What `change` takes, and how it is now."""
        from haptic_device.config.parameters import EXCHANGE_METHODS, Exchange

        now = self._order.relay or Relay()
        times = {
            name: {"value": 1e3 * getattr(now, name), "unit": "ms", "low": 0, "high": high}
            for name, high in NETWORK.items()
        }
        loss = {"value": now.loss, "unit": "share", "low": 0, "high": 1}
        method = {"value": self._order.exchange or Exchange.model_fields["method"].default, "choices": EXCHANGE_METHODS}
        return {"exchange.method": method, **times, "loss": loss}

    async def change(self, name: str, value: Any, enable: bool) -> str:
        """Starts the nodes again with this changed, all else kept; the recorder goes on. ValueError if it cannot be.
        enable: whether the driver enables itself then."""
        async with self._changing:
            order = _enabling(self._changed(name, value), enable)
            programs = [program for program in programs_of(order) if program.name != RECORDER]
            await asyncio.to_thread(self._nodes.end_all_but, RECORDER)
            for program in programs:  # not in that thread: a child goes with the thread that started it
                self._nodes.start(program)
            self._order = order
            return f"{name} is {value}; the nodes have been started again"

    @property
    def changing(self) -> bool:
        """Whether nodes are being started again just now."""
        return self._changing.locked()

    def ended(self) -> dict[str, str]:
        """{name: how} of the nodes that have ended by themselves."""
        return self._nodes.ended()

    async def start_again(self, names: Collection[str]) -> None:
        """Starts these nodes again; a driver does not enable itself. One that still runs is killed first, for it was
        silent."""
        async with self._changing:
            for name in names:
                await asyncio.to_thread(self._nodes.kill, name)
            for program in programs_of(_enabling(self._order, False)):
                if program.name in names:
                    self._nodes.start(program)

    def _changed(self, name: str, value: Any) -> Order:
        offered = self.offer()
        if name not in offered:
            raise ValueError(f"{name} is none of {', '.join(offered)}")
        one = offered[name]
        if "choices" in one:
            if value not in one["choices"]:
                raise ValueError(f"{name} is {value!r}; it must be one of {', '.join(one['choices'])}")
            return self._order._replace(exchange=value)
        if not isinstance(value, int | float) or not one["low"] <= value <= one["high"]:
            raise ValueError(f"{name} is {value!r}; {one['low']} to {one['high']} {one['unit']} is needed")
        now = {known: offered[known]["value"] for known in (*NETWORK, "loss")} | {name: float(value)}
        relay = Relay(now["delay"] * 1e-3, now["jitter"] * 1e-3, now["loss"])
        return self._order._replace(relay=relay if any(relay) else None)


def _enabling(order: Order, enable: bool) -> Order:
    driver = order.given.get(DRIVER, {}) | {"auto_enable": enable}
    return order._replace(given=order.given | {DRIVER: driver})


def play(order: Order, page: dict[str, Any], stop: Callable[[], bool] | None = None) -> bool:
    """Runs the nodes of the order with a page, until Ctrl-C or the order's seconds are over. page: host and port;
    stop() asks for an e-stop."""
    order = order._replace(given=HAND)
    prepare(programs_of(order))
    with isolated_domain(order.out / "log"), Nodes(order.out / "log") as nodes:
        manager = NodeManager(order, nodes)
        manager.start()
        with undisturbed():  # some imports would lose a KeyboardInterrupt
            from haptic_device.nodes.lifecycle import hear_the_end
            from haptic_display.page.viewer import serve  # ROS is imported while the nodes start

        told, end = hear_the_end(), None if order.seconds is None else time.monotonic() + order.seconds
        serve(
            ros_arguments(NAMESPACE, page), lambda: told or (end is not None and time.monotonic() > end), manager, stop
        )
    return True
