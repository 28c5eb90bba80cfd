# SPDX-License-Identifier: Apache-2.0
"""haptic_simulation: a scene with a tool in it, answering every handle sample with a tool sample."""

import statistics
import sys
import threading

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from haptic_device.jit import ensure_compiled
from haptic_device.nodes import diagnostics, messages
from haptic_device.nodes.lifecycle import ManagedNode, run
from haptic_device.nodes.refusals import Refusals
from haptic_device.nodes.ros_parameters import on_change
from haptic_device.realtime.scheduling import go_realtime, lift_threads, spare_collections
from haptic_sim.node.endpoint import Port
from haptic_sim.node.exchange_thread import ExchangeThread
from haptic_sim.node.parameters import FIGURES, PARAMETERS
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene import load
from haptic_sim.simulation import Simulation, kernels_of

MIDDLEWARE_PRIORITY = 65  # above the exchange, which must never wait for the middleware's own threads
GIL_SWITCH = 0.2e-3  # s, longest time the executor keeps the exchange thread from running; python's own is 5 ms


class SimulationNode(ManagedNode):
    """Configured it has a scene, active it answers."""

    def __init__(self):
        super().__init__("haptic_simulation", PARAMETERS)
        self.exchange: ExchangeThread | None = None
        self.simulation: Simulation | None = None
        self._loading = False
        self._rates = diagnostics.Rates()
        self._tool = self.create_publisher(messages.JointState, "tool", messages.LATEST)
        local = self.values["exchange.method"] == "local"
        self._near = self.create_publisher(messages.PointCloud2, "local_contacts", messages.LATEST) if local else None
        self.create_service(Trigger, "~/reset_scene", self._on_reset_scene)
        beside = ReentrantCallbackGroup()  # while it waits for its world others are served
        self.create_service(Trigger, "~/load_scene", self._on_load_scene, callback_group=beside)
        self.create_service(SetBool, "~/pause", self._on_pause)
        on_change(self, PARAMETERS, lambda values: load(values["scene"]), self._apply)

    def configure(self) -> None:
        """Loads the scene."""
        lift_threads(self.values["realtime"], MIDDLEWARE_PRIORITY)
        self.simulation = self._world(self.values)

    def activate(self) -> None:
        """Starts answering."""
        port = Port(self.simulation.scene.tool.pose, self.values["exchange.method"])
        self._refused, self._rejoined = Refusals("handle"), self.simulation.counters.rejoined
        self.exchange = ExchangeThread(self, self.simulation, port, (self._tool, self._near), self._prepare)
        self.exchange.start()
        self.get_logger().info(f"scene {self.simulation.scene.name}; {self.exchange.scheduling}")

    def deactivate(self) -> None:
        """Stops answering and says once more how things stand."""
        if self.exchange is not None:
            self.exchange.stop()
            try:
                self.diagnose()
            finally:
                self.exchange = None

    def cleanup(self) -> None:
        """Forgets the scene."""
        self.simulation = None

    def diagnose(self) -> None:
        """Publishes counts, times and results of the active node."""
        if self.exchange is None:
            return
        world = self.exchange.simulation
        values = {"scene": world.scene.name, "method": world.method_name, "why": world.why, **_values(self.exchange)}
        values["survived"] = self.survived
        level, message = self._verdict()
        figures = {"compute": values["compute_us_p99"] * 1e-6, **self._rates.of(refused=values["refused"])}
        watched = diagnostics.statuses(self.get_name(), FIGURES, figures, self.values)
        self.say_status(level, message, values, watched)

    def _verdict(self):
        counters = self.exchange.report.counters
        known, self._rejoined = self._rejoined, counters.rejoined
        rejoined = self._rejoined - known
        if self.exchange.failure:
            return "error", self.exchange.failure
        if self.exchange.paused:
            return "warn", "paused"
        if left_out := counters.left_out:
            return "error", (
                f"{left_out} contacts were left out: more at once than the method can solve for; "
                "take fewer bodies, or the method impulse"
            )
        if refused := self._refused.sentence(self.exchange.port.refused):
            return "warn", refused
        if not self.exchange.answered:
            return "warn", "no handle sample has come yet"
        if rejoined > 0:
            late = self.values["max_catch_up"] * 1e3
            return "warn", f"the world waited {rejoined} times: handle samples over {late:g} ms apart, or going back"
        return "ok", "answering"

    def _world(self, values):
        """A simulation as these parameters say."""
        reduced = reduce_scene(load(values["scene"]), values["method"])
        ensure_compiled(*kernels_of(reduced, values["exchange.method"]), told=self.told)
        world = Simulation.by_parameters(reduced, values)
        if values["exchange.method"] == "local":
            world.local_contacts.look(0.0)  # compiled here, not in the first exchange
        return world

    def _build(self, values, built):
        """In a thread of its own: `built` becomes the world, or a sentence on why there is none."""
        try:
            built.set_result(self._world(values))
        except (ValueError, OSError) as refusal:
            built.set_result(str(refusal))
        except KeyboardInterrupt:
            built.set_result("the node ends")
        except Exception as error:
            built.set_result(f"{type(error).__name__}: {error}")

    def _apply(self, values):
        """The parameter `scene` names what load_scene loads next."""
        self.values = values

    def _prepare(self):
        sys.setswitchinterval(GIL_SWITCH)
        spare_collections()
        return go_realtime(self.values["realtime"], self.values["realtime_priority"])

    def _on_reset_scene(self, request, response):
        refusal = self._no_exchange()
        if self.exchange is not None:
            refusal = self.exchange.reset()
        elif self.simulation is not None:
            self.simulation.reset()
            refusal = ""
        return _answered(response, refusal, "scene is at its start")

    async def _on_load_scene(self, request, response):
        """Builds the world beside: that may have to compile first, and takes the tool's port only when it is there."""
        if self._loading:
            return _answered(response, "another scene is being loaded", "")
        built, before = Future(), self.simulation
        threading.Thread(target=self._build, args=(self.values, built), name="loader").start()
        self._loading = True
        world = await built
        self._loading = False
        if isinstance(world, str):
            return _answered(response, world, "")
        if self.simulation is not before:
            return _answered(response, "the node was cleaned up meanwhile: nothing was changed", "")
        refusal = self.exchange.load(world) if self.exchange is not None else ""
        if not refusal:
            self.simulation = world
        return _answered(response, refusal, f"scene is {world.scene.name}")

    def _on_pause(self, request, response):
        refusal = self._no_exchange()
        if not refusal:
            self.exchange.pause(request.data)
        return _answered(response, refusal, "paused" if request.data else "goes on")

    def _no_exchange(self):
        """Why nothing answers; "" if something does."""
        return self.exchange.failure if self.exchange is not None else "there is no scene that answers"


def _answered(response, refusal, done):
    response.success, response.message = not refusal, refusal or done
    return response


def _values(exchange):
    report, refused, times = exchange.report, exchange.port.refused, sorted(exchange.compute_ns) or [0]
    return {
        "scheduling": exchange.scheduling,
        "answered": exchange.answered,
        "refused": sum(refused.values()),
        **{f"refused.{reason}": count for reason, count in refused.items() if count},
        "rejoined": report.counters.rejoined,
        "sub_steps": report.counters.sub_steps,
        "compute_us_p50": statistics.median(times) / 1e3,
        "compute_us_p99": times[int(0.99 * (len(times) - 1))] / 1e3,
        "compute_us_max": times[-1] / 1e3,
        "max_contact_force": report.counters.max_contact_force,
        "max_penetration": report.counters.max_penetration,
        "contacts_left_out": report.counters.left_out,
        "tool_port_energy": report.energy,
        **{f"result.{name}": value for name, value in report.result.items()},
    }


def main(args: list[str] | None = None) -> int:
    """Runs haptic_simulation until SIGINT, SIGTERM or SIGHUP. Exit code 1 on a refusal."""
    return run(SimulationNode, "haptic_simulation", args)


if __name__ == "__main__":
    sys.exit(main())
