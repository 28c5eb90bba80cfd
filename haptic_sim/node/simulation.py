# SPDX-License-Identifier: Apache-2.0
"""haptic_simulation: a scene with a tool in it, answering every handle sample with a tool sample."""

import statistics
import sys
import threading
import time
from functools import partial

from rclpy.experimental import EventsExecutor
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from haptic_device.jit import ensure_compiled
from haptic_device.nodes import diagnostics, messages
from haptic_device.nodes.lifecycle import ManagedNode, run, sentence_of
from haptic_device.nodes.refusals import Refusals
from haptic_device.nodes.ros_parameters import on_change
from haptic_device.realtime.scheduling import go_realtime, leave_realtime, lift_threads, spare_collections
from haptic_sim.endpoint import ExchangeEndpoint
from haptic_sim.node.parameters import FIGURES, PARAMETERS
from haptic_sim.node.scene_publisher import ScenePublisher
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene import load
from haptic_sim.simulation import Simulation, kernels_of

MIDDLEWARE_PRIORITY = 65  # above the exchange, which must never wait for the middleware's own threads
GIL_SWITCH = 0.2e-3  # s, longest time a scene that is being built holds up the exchange; python's own is 5 ms
MOST = 64  # messages taken at a turn: a flood that never ends must not hold up the answers
STILL_SHOWN = 0.1  # s, between looks at whether a world that nobody asks has to be shown


class SimulationNode(ManagedNode):
    """Configured it has a scene, active it answers: exchange, services and diagnostics in one thread.

    An exception in the exchange ends it until the next activation, and `ended` is then a sentence that says so: nothing
    answers any more.
    """

    def __init__(self):
        super().__init__("haptic_simulation", PARAMETERS)
        self.exchange: ExchangeEndpoint | None = None
        self.simulation: Simulation | None = None
        self.scheduling = self.ended = ""
        self._loading = False
        self._rates = diagnostics.Rates()
        self._tool = self.create_publisher(messages.JointState, "tool", messages.LATEST)
        local = self.values["exchange.method"] == "local"
        self._near = self.create_publisher(messages.PointCloud2, "local_contacts", messages.LATEST) if local else None
        self.create_service(Trigger, "~/reset_scene", self._on_reset_scene)
        _answers_later(self.create_service(Trigger, "~/load_scene", self._on_load_scene))
        self.create_service(SetBool, "~/pause", self._on_pause)
        self.create_timer(STILL_SHOWN, lambda: self._attempt(self._show))
        on_change(self, PARAMETERS, lambda values: load(values["scene"]), self._apply)

    def make_executor(self):
        """rclpy's quickest: it looks through no set of entities for each message."""
        return EventsExecutor()

    def configure(self) -> None:
        """Loads the scene."""
        lift_threads(self.values["realtime"], MIDDLEWARE_PRIORITY)
        self.simulation = self._world(self.values)

    def activate(self) -> None:
        """Starts answering."""
        try:
            self.scheduling, self.ended = self._prepare(), ""
        except PermissionError:
            leave_realtime()
            raise
        self._refused, self._rejoined = Refusals("handle"), self.simulation.counters.rejoined
        self._scene = ScenePublisher(self)
        self.exchange = ExchangeEndpoint(
            self.simulation, self.simulation.scene.tool.pose, self.values["exchange.method"]
        )
        self._handle = self.create_subscription(
            messages.JointState, "handle", self._on_handle, messages.STREAM, raw=True
        )
        self.get_logger().info(f"scene {self.simulation.scene.name}; {self.scheduling}")

    def deactivate(self) -> None:
        """Stops answering and says once more how things stand."""
        if self.exchange is None:
            return
        self.destroy_subscription(self._handle)
        self._attempt(self._show)
        self._scene.close()
        try:
            self.diagnose()
        finally:
            self.exchange, self.ended = None, ""
            leave_realtime()

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
        if not self.ended:  # a world that failed may fail in this too
            values |= {f"result.{name}": value for name, value in world.measure().items()}
        level, message = self._verdict()
        figures = {"compute": values["compute_us_p99"] * 1e-6, **self._rates.of(refused=values["refused"])}
        watched = diagnostics.statuses(self.get_name(), FIGURES, figures, self.values)
        self.say_status(level, message, values, watched)

    def _on_handle(self, data):
        """Answers; whatever has come since comes with it, so that only the newest is."""
        if self.ended:
            return
        waiting, take = [data], self._handle.handle.take_message
        while len(waiting) < MOST and (taken := take(messages.JointState, True)) is not None:
            waiting.append(taken[0])
        self._attempt(partial(self._answer, waiting))

    def _attempt(self, step):
        """Takes a step of the exchange, unless it has ended; an exception ends it. "", or why nothing answers."""
        if not self.ended:
            try:
                step()
            except Exception as error:
                self.ended = f"the exchange has ended by {sentence_of(error)}"
                self.get_logger().error(self.ended)
        return self.ended

    def _answer(self, waiting):
        tool = self.exchange.answer(waiting, time.monotonic_ns())
        if tool is not None:
            self._tool.publish(tool)
            if self._near is not None:
                self._near.publish(self.exchange.local_contacts())
        self._show()

    def _show(self):
        if self.exchange is not None:
            self._scene.show(self.simulation, self.exchange.position, time.monotonic_ns())

    def _verdict(self):
        counters = self.simulation.counters
        known, self._rejoined = self._rejoined, counters.rejoined
        rejoined = self._rejoined - known
        if self.ended:
            return "error", self.ended
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
            world = self._world(values)
        except (ValueError, OSError) as refusal:
            world = str(refusal)
        except KeyboardInterrupt:
            world = "the node ends"
        except Exception as error:
            world = sentence_of(error)
        built.set_result(world)

    def _apply(self, values):
        """The parameter `scene` names what load_scene loads next."""
        self.values = values

    def _prepare(self):
        sys.setswitchinterval(GIL_SWITCH)
        spare_collections()
        return go_realtime(self.values["realtime"], self.values["realtime_priority"])

    def _on_reset_scene(self, request, response):
        refusal = self._no_exchange()
        if self.exchange is None and self.simulation is not None:
            self.simulation.reset()
            refusal = ""
        elif not refusal:
            refusal = self._attempt(lambda: self.exchange.reset(time.monotonic_ns()))
        return _answered(response, refusal, "scene is at its start")

    def _on_load_scene(self, request, response):
        """Builds the world beside: that may have to compile first, and takes the tool's port only when it is there."""
        answer = Future(executor=self.executor)
        if self._loading:
            answer.set_result(_answered(response, "another scene is being loaded", ""))
            return answer
        self._loading, built = True, Future(executor=self.executor)
        built.add_done_callback(partial(self._take_world, self.simulation, response, answer))
        threading.Thread(target=self._build, args=(self.values, built), name="loader").start()
        return answer

    def _take_world(self, before, response, answer, built):
        """The world that was built in place of the one before, if that is still there."""
        self._loading, world = False, built.result()
        if isinstance(world, str):
            refusal, done = world, ""
        elif self.simulation is not before:
            refusal, done = "the node was cleaned up meanwhile: nothing was changed", ""
        else:
            refusal, done = self.ended, f"scene is {world.scene.name}"
        if done and not refusal:
            if self.exchange is not None:
                refusal = self._attempt(lambda: self.exchange.load(world, time.monotonic_ns()))
            self.simulation = world
        answer.set_result(_answered(response, refusal, done))

    def _on_pause(self, request, response):
        refusal = self._no_exchange()
        if not refusal:
            self.exchange.pause(request.data, time.monotonic_ns())
        return _answered(response, refusal, "paused" if request.data else "goes on")

    def _no_exchange(self):
        """Why nothing answers; "" if something does."""
        return self.ended if self.exchange is not None else "there is no scene that answers"


def _answers_later(service):
    """Its callback returns a future of the response: rclpy's events executor takes no coroutine for a service."""
    send = service.send_response
    service.send_response = lambda answer, header: answer.add_done_callback(lambda done: send(done.result(), header))


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
        "sub_steps": world.counters.sub_steps,
        "compute_us_p50": statistics.median(times) / 1e3,
        "compute_us_p99": times[int(0.99 * (len(times) - 1))] / 1e3,
        "compute_us_max": times[-1] / 1e3,
        "max_contact_force": world.counters.max_contact_force,
        "max_penetration": world.counters.max_penetration,
        "contacts_left_out": world.counters.left_out,
        "tool_port_energy": world.ledger.supplied,
    }


def main(args: list[str] | None = None) -> int:
    """Runs haptic_simulation until SIGINT, SIGTERM or SIGHUP. Exit code 1 on a refusal."""
    return run(SimulationNode, "haptic_simulation", args)


if __name__ == "__main__":
    sys.exit(main())
