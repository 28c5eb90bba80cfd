# SPDX-License-Identifier: Apache-2.0
"""haptic_simulation: a scene with a tool in it, answering every handle sample with a tool sample."""

if __name__ == "__main__":  # before the imports, which take seconds
    from haptic_device.process import start

    raise SystemExit(start(__spec__.name))

import statistics
import sys
import threading
import time
from functools import partial

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from haptic_device.jit import ensure_compiled
from haptic_device.nodes import diagnostics, messages
from haptic_device.nodes.lifecycle import ManagedNode, run, sentence_of
from haptic_device.nodes.refusals import Refusals
from haptic_device.nodes.ros_parameters import on_change
from haptic_device.os_errors import in_words
from haptic_device.realtime.scheduling import go_realtime, lift_interpreter, lift_threads, put_back, spare_collections
from haptic_sim.exchange.endpoint import ExchangeEndpoint
from haptic_sim.exchange.left_out_time import left_out_sentence, paused_sentence, short_sentence
from haptic_sim.exchange.simulation import Added, Simulation, kernels_of
from haptic_sim.node.exchange_thread import ExchangeThread
from haptic_sim.node.parameters import FIGURES, NODES
from haptic_sim.node.scene_publisher import ScenePublisher
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

MIDDLEWARE_PRIORITY = 65  # above the exchange, which must never wait for the middleware's own threads
GIL_SWITCH = 0.2e-3  # s, longest time the executor keeps the exchange thread from running; python's own is 5 ms


class SimulationNode(ManagedNode):
    """Configured it has a scene, active it answers: by a thread of its own, which alone touches the world meanwhile.

    added: puts bodies of one's own into each new world, which is a PymunkWorld: also after a reset and another scene.
    """

    def __init__(self, added: Added | None = None):
        self._added = added
        super().__init__("haptic_simulation", NODES["haptic_simulation"])
        self.exchange: ExchangeEndpoint | None = None
        self.simulation: Simulation | None = None
        self.scheduling, self._thread, self._result = "", None, {}
        self._loading, self._lifted = False, []
        self._rates = diagnostics.Rates()
        self._tool = self.create_publisher(messages.JointState, "tool", messages.LATEST)
        local = self.values["exchange.method"] == "local"
        self._near = self.create_publisher(messages.PointCloud2, "local_contacts", messages.LATEST) if local else None
        self.create_service(Trigger, "~/reset_scene", self._on_reset_scene)
        beside = ReentrantCallbackGroup()  # while it waits for its world others are served
        self.create_service(Trigger, "~/load_scene", self._on_load_scene, callback_group=beside)
        self.create_service(SetBool, "~/pause", self._on_pause)
        # the parameter `scene` names what load_scene loads next
        on_change(self, NODES["haptic_simulation"], lambda values: load(values["scene"]), self.take_values)

    def configure(self) -> None:
        """Loads the scene."""
        lift_threads(self.values["realtime"], MIDDLEWARE_PRIORITY)
        self.simulation = self._world(self.values)

    def activate(self) -> None:
        """Starts answering."""
        self._refused, self._rejoined = Refusals("handle"), self.simulation.counters.rejoined
        self._waited = self.simulation.counters.waited_ns, time.monotonic()
        self._kept_short = self.simulation.counters.short_ns, time.monotonic()
        self._scene, self._result = ScenePublisher(self), self.simulation.measure()
        home, method = self.simulation.scene.tool.pose, self.values["exchange.method"]
        self.exchange = ExchangeEndpoint(self.simulation, home, method)
        self._thread = ExchangeThread(self, self._turn, self._prepare)
        self.scheduling = self._thread.start()
        self.get_logger().info(f"scene {self.simulation.scene.name}; {self.scheduling}")

    def deactivate(self) -> None:
        """Stops answering and says once more how things stand."""
        if self.exchange is None:
            return
        self._thread.stop()
        put_back(self._lifted)
        self._scene.close()
        try:
            if not self._thread.ended:
                self._result = self.simulation.measure()
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
        world = self.simulation
        values = {"scene": world.scene.name, "method": world.method_name, "why": world.why}
        values |= {"scheduling": self.scheduling, **_values(self.exchange, world), "survived": self.survived}
        values |= {f"result.{name}": value for name, value in self._result.items()}
        values["withheld"] = short = self._short()
        level, message = self._verdict(short)
        figures = {"compute": values["compute_us_p99"] * 1e-6, **self._rates.of(refused=values["refused"])}
        watched = diagnostics.statuses(self.get_name(), FIGURES, figures, self.values)
        self.say_status(level, message, values, watched)

    def _turn(self, messages):
        """In the thread: answers what has come, and shows the world."""
        tool = self.exchange.answer(messages, time.monotonic_ns()) if messages else None
        if tool is not None:
            self._tool.publish(tool)
            if self._near is not None:
                self._near.publish(self.exchange.local_contacts())
        if self._scene.show(self.simulation, self.exchange.position, time.monotonic_ns()):
            self._result = self.simulation.measure()

    def _verdict(self, short):
        counters = self.simulation.counters
        known, self._rejoined = self._rejoined, counters.rejoined
        rejoined, late = self._rejoined - known, self._late()
        if self._thread.ended:
            return "error", self._thread.ended
        if self.exchange.paused:
            return "warn", "paused"
        if left_out := counters.left_out:
            return "error", (
                f"{left_out} contacts were left out: more at once than the method can solve for; "
                "take fewer bodies, or the method impulse"
            )
        if refused := self._refused.sentence(self.exchange.refused):
            return "warn", refused
        if not self.exchange.answered:
            return "warn", "no handle sample has come yet"
        if rejoined > 0 and not (late and self.exchange.pace.dear):
            return "warn", paused_sentence(rejoined, self.values["max_catch_up"])
        return ("warn", late or short) if late or short else ("ok", "answering")

    def _late(self):
        """What is to be said of the time left out since the last report."""
        known, now, pace = self._waited, time.monotonic(), self.exchange.pace
        self._waited = self.simulation.counters.waited_ns, now
        seconds = 1e-9 * (self._waited[0] - known[0])
        return left_out_sentence(seconds, now - known[1], pace.load, 1e-9 * pace.period_ns)

    def _short(self):
        """What is to be said of force that the port kept short since the last report."""
        known, world = self._kept_short, self.simulation
        self._kept_short = world.counters.short_ns, time.monotonic()
        seconds = 1e-9 * (self._kept_short[0] - known[0])
        return short_sentence(seconds, self._kept_short[1] - known[1], getattr(world.port, "tank", 0.0))

    def _world(self, values):
        """A simulation as these parameters say."""
        reduced = reduce_scene(load(values["scene"]), values["method"])
        ensure_compiled(*kernels_of(reduced, values["exchange.method"]), told=self.told)
        world = Simulation.by_parameters(reduced, values, self._added)
        if values["exchange.method"] == "local":
            world.local_contacts.look(0.0)  # compiled here, not in the first exchange
        return world

    def _build(self, values, built):
        """In a thread of its own: `built` becomes the world, or a sentence on why there is none."""
        try:
            world = self._world(values)
        except (ValueError, OSError) as refusal:
            world = in_words(refusal)
        except KeyboardInterrupt:
            world = "the node ends"
        except Exception as error:
            world = sentence_of(error)
        built.set_result(world)

    def _prepare(self):
        sys.setswitchinterval(GIL_SWITCH)
        spare_collections()
        wish, priority = self.values["realtime"], self.values["realtime_priority"]
        has = go_realtime(wish, priority)
        self._lifted = lift_interpreter(wish)  # this thread needs their lock
        return has

    def _on_reset_scene(self, request, response):
        if self.exchange is not None:
            refusal = self._thread.ask(lambda: self.exchange.reset(time.monotonic_ns()))
        elif self.simulation is not None:
            self.simulation.reset()
            refusal = ""
        else:
            refusal = self._no_exchange()
        return _answered(response, refusal, "scene is at its start")

    async def _on_load_scene(self, request, response):
        """Builds the world beside: that may have to compile first, and takes the tool's port only when it is there."""
        if self._loading:
            return _answered(response, "another scene is being loaded", "")
        self._loading, built, before = True, Future(), self.simulation
        threading.Thread(target=self._build, args=(self.values, built), name="loader").start()
        world = await built
        self._loading = False
        if isinstance(world, str):
            return _answered(response, world, "")
        if self.simulation is not before:
            return _answered(response, "the node was cleaned up meanwhile: nothing was changed", "")
        return _answered(response, self._take_world(world), f"scene is {world.scene.name}")

    def _take_world(self, world):
        """Goes on with another world; "" or why not."""
        if self.exchange is None:
            self.simulation = world
            return ""

        def change():
            self.exchange.load(world, time.monotonic_ns())
            self.simulation = world

        return self._thread.ask(change)

    def _on_pause(self, request, response):
        refusal = self._no_exchange()
        if not refusal:
            refusal = self._thread.ask(lambda: self.exchange.pause(request.data, time.monotonic_ns()))
        return _answered(response, refusal, "paused" if request.data else "goes on")

    def _no_exchange(self):
        """Why nothing answers; "" if something does."""
        return self._thread.ended if self.exchange is not None else "there is no scene that answers"


def _answered(response, refusal, done):
    response.success, response.message = not refusal, refusal or done
    return response


def _values(exchange, world):
    refused, times = exchange.refused, sorted(exchange.compute_ns) or [0]
    return {
        "answered": exchange.answered,
        "refused": sum(refused.values()),
        **{f"refused.{reason}": count for reason, count in refused.items() if count},
        "rejoined": world.counters.rejoined,
        "waited_s": 1e-9 * world.counters.waited_ns,
        "short_s": 1e-9 * world.counters.short_ns,
        "world_load": exchange.pace.load,
        "sub_steps": world.counters.sub_steps,
        "compute_us_p50": statistics.median(times) / 1e3,
        "compute_us_p99": times[int(0.99 * (len(times) - 1))] / 1e3,
        "compute_us_max": times[-1] / 1e3,
        "max_contact_force": world.counters.max_contact_force,
        "max_penetration": world.counters.max_penetration,
        "contacts_left_out": world.counters.left_out,
        "tool_port_energy": world.ledger.supplied,
    }


def main(args: list[str] | None = None, added: Added | None = None) -> int:
    """Runs haptic_simulation until SIGINT, SIGTERM or SIGHUP; added: as of SimulationNode. Exit code 1 on a refusal."""
    return run(partial(SimulationNode, added), "haptic_simulation", args)
