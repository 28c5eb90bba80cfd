# SPDX-License-Identifier: Apache-2.0
"""The thread that answers handle samples: off the executor, on bytes, the latest that is accepted only.

An executor would take half a core at 1 kHz to hand over what a wait set of one subscription hands over at once.
"""

import threading
import time
from collections import deque
from typing import NamedTuple

from rclpy.impl.implementation_singleton import rclpy_implementation

from haptic_device.nodes.messages import STREAM, JointState
from haptic_device.nodes.polled_subscription import Untouched
from haptic_sim.node.endpoint import Port
from haptic_sim.node.scene_publisher import ScenePublisher
from haptic_sim.simulation import Counters, Simulation

LOOK_UP_NS = 50_000_000  # longest time it does not look at what others ask of it
SILENCE_NS = 250_000_000  # hides a change of the world: by default the driver's coupling has let go after 0.2 s
RETURN_NS = 140_000_000  # time over which the coupling's gains then return, as the driver's own fade does
TIMES_KEPT = 4096
MOST = 64  # messages taken at a turn: a flood that never ends must not hold up the answers


class Report(NamedTuple):
    """What the thread last said about the world, for others to read."""

    result: dict[str, float]
    counters: Counters
    energy: float


class ExchangeThread:
    """Owns the simulation from start() to stop(): what others want of the world, they ask for.

    While the world changes or is paused it says nothing: the driver's coupling fades out by age, and in again once it
    answers; meanwhile the world stands still, and its own coupling returns from zero gains.

    `prepare` is called first in the thread and says what scheduling it has (kept as `scheduling`). An exception in what
    follows ends the thread, and `failure` is then a sentence that says so: nothing answers any more.
    """

    def __init__(self, node, simulation: Simulation, port: Port, publishers, prepare):
        self.simulation, self.port, self._prepare = simulation, port, prepare
        self._publisher, self._near_publisher = publishers  # of tool, of local_contacts or None
        self._node = node
        self._subscription = node.create_subscription(
            JointState, "handle", lambda data: None, STREAM, raw=True, callback_group=Untouched()
        )
        self._wait_set = rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, node.context.handle)
        self._stop, self._wish, self._granted = threading.Event(), None, threading.Event()
        self._granting = threading.Lock()
        self._silent_until_ns, self._returned_ns = 0, 0
        self.paused = False
        self._ready, self._refusal = threading.Event(), None
        self.scheduling = self.failure = ""
        self.report = Report({}, Counters(), 0.0)
        self.answered = 0
        self.compute_ns = deque(maxlen=TIMES_KEPT)
        self._showing, self._handle = ScenePublisher(node), None
        self._thread = threading.Thread(target=self._run, name="exchange")

    def start(self) -> None:
        """Start the thread; an exception of `prepare` comes out of here, and the thread has ended."""
        self._say()
        self._thread.start()
        self._ready.wait()
        if self._refusal is not None:
            raise self._refusal

    def stop(self) -> None:
        """End the thread, if it has been started; returns when it has, at most one look-up and one exchange later."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        self._node.destroy_subscription(self._subscription)
        self._showing.close()

    def reset(self, patience: float = 1.0) -> str:
        """Put the world back to the scene's start; "" when that is done, or why it is not within `patience` [s]."""
        return self._ask(lambda: self.simulation.reset(), patience)

    def load(self, simulation: Simulation, patience: float = 1.0) -> str:
        """Go on with another world; "" when that is done, or why it is not within `patience` [s]."""
        return self._ask(lambda: self._exchange_world(simulation), patience)

    def pause(self, paused: bool) -> None:
        """Let the world stand still, or go on."""
        if self.paused and not paused:
            self._fall_silent()
        self.paused = paused

    def _ask(self, wish, patience):
        """A wish that is not granted in time is withdrawn: nothing changes later, when nobody expects it."""
        self._granted.clear()
        self._wish = wish
        self._granted.wait(0.0 if self.failure else patience)
        with self._granting:
            late, self._wish = self._wish is not None, None
        silent = f"the exchange did not answer within {patience:g} s: nothing was changed"
        return self.failure or (silent if late else "")

    def _exchange_world(self, simulation):
        simulation.attach(self.simulation.port)  # not before: the world that runs pulls by it
        self.simulation, self.port.home = simulation, simulation.scene.tool.pose
        self.port.scene += 1

    def _fall_silent(self):
        self._silent_until_ns = time.monotonic_ns() + SILENCE_NS

    def _run(self):
        try:
            self.scheduling = self._prepare()
        except Exception as error:
            self._refusal, self.failure = error, str(error)
            return
        finally:
            self._ready.set()
        try:
            while not self._stop.is_set():
                self._turn()
            self._say()
        except Exception as error:
            self.failure = f"the exchange has ended by {type(error).__name__}: {' '.join(str(error).split())}"
            self._node.get_logger().error(self.failure)
            self._granted.set()

    def _turn(self):
        messages = self._waiting()
        if messages:
            self._answer(*messages)
            self._showing.show(self.simulation, self._handle, time.monotonic_ns())
        if self._wish is not None:
            self._grant()
        if time.monotonic_ns() >= self._next_report_ns:
            self._say()

    def _waiting(self):
        """What has come since, oldest first."""
        messages, handle = [], self._subscription.handle
        with handle, self._node.context.handle:  # they live on while it waits
            self._wait_set.clear_entities()
            self._wait_set.add_subscription(handle)
            self._wait_set.wait(LOOK_UP_NS)
            while len(messages) < MOST and (taken := handle.take_message(JointState, True)) is not None:
                messages.append(taken[0])
        return messages

    def _answer(self, *messages):
        """Answers the newest of these that is accepted: one that is refused takes no other's turn."""
        began, now_ns = time.perf_counter_ns(), time.monotonic_ns()
        questions = [question for data in messages if (question := self.port.take(data, now_ns)) is not None]
        if not questions:
            return
        question = questions[-1]
        if any(one.new_session for one in questions) or self._silent(now_ns):
            self.simulation.rejoin()
        if self._silent(now_ns):
            return
        tool = self.simulation.exchange(self._faded(question.handle, now_ns))
        answer = self.port.answer(question, tool)
        self.compute_ns.append(time.perf_counter_ns() - began)
        self._publisher.publish(answer)
        if self._near_publisher is not None:
            near = self.simulation.local_contacts
            near.look(self.port.lag(question))
            self._near_publisher.publish(self.port.local_contacts(question, near.common, near.table))
        self.answered += 1
        self._handle = question.handle.position

    def _silent(self, now_ns):
        if self.paused or now_ns < self._silent_until_ns:
            self._returned_ns = now_ns + RETURN_NS
            return True
        return False

    def _faded(self, handle, now_ns):
        """The handle sample with gains that return linearly after a silence."""
        missing = (self._returned_ns - now_ns) / RETURN_NS
        if missing <= 0.0:
            return handle
        return handle._replace(**{name: (1.0 - missing) * gain for name, gain in handle.gains._asdict().items()})

    def _grant(self):
        with self._granting:
            if self._wish is None:  # withdrawn
                return
            self._wish()
            self._wish = None
        self._fall_silent()
        self._say()
        self._granted.set()

    def _say(self):
        now_ns = time.monotonic_ns()
        self._next_report_ns = now_ns + 2 * LOOK_UP_NS
        self._showing.show(self.simulation, self._handle, now_ns)
        self.report = Report(self.simulation.measure(), self.simulation.counters, self.simulation.ledger.supplied)
