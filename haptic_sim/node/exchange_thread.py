# SPDX-License-Identifier: Apache-2.0
"""The thread that takes handle samples, and does between two of them what others want of the world.

On rclpy's events executor the exchange would wait for every other callback (decision 0033).
"""

import queue
import threading
from concurrent.futures import Future

from rclpy.impl.implementation_singleton import rclpy_implementation

from haptic_device.nodes.lifecycle import sentence_of
from haptic_device.nodes.messages import STREAM, JointState
from haptic_device.nodes.polled_subscription import Untouched

LOOK_UP_NS = 50_000_000  # longest time it does not look at what others ask of it
PATIENCE = 1.0  # s for what is asked to begin
MOST = 64  # messages taken at a turn: a flood that never ends must not hold up the answers


class ExchangeThread:
    """turn(messages) is called with the `handle` messages that have come, oldest first, and each LOOK_UP_NS without.

    `prepare` is called first in the thread and says what scheduling it has. An exception in a turn, or in what was
    asked for, ends the thread, and `ended` is then a sentence that says so.
    """

    def __init__(self, node, turn, prepare):
        self._node, self._turn, self._prepare = node, turn, prepare
        self._subscription = node.create_subscription(
            JointState, "handle", lambda data: None, STREAM, raw=True, callback_group=Untouched()
        )
        self._wait_set = rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, node.context.handle)
        self._asked: queue.SimpleQueue = queue.SimpleQueue()
        self._prepared: Future[str] = Future()
        self._stop, self.ended = threading.Event(), ""
        self._thread = threading.Thread(target=self._run, name="exchange")

    def start(self) -> str:
        """Starts the thread; returns its scheduling. An exception of `prepare` comes out of here."""
        self._thread.start()
        return self._prepared.result()

    def stop(self) -> None:
        """Ends the thread; returns when it has, at most one look-up and one exchange later."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        self._node.destroy_subscription(self._subscription)

    def ask(self, wish) -> str:
        """Calls wish() in the thread; "" when that is done, or why nothing was changed, now or later."""
        done: Future[None] = Future()
        self._asked.put((done, wish))
        try:
            done.result(0.0 if self.ended else PATIENCE)
        except TimeoutError:
            if done.cancel():
                return self.ended or f"the exchange did not answer within {PATIENCE:g} s: nothing was changed"
            done.exception()  # it has begun
        except Exception:
            return self.ended
        return self.ended

    def _run(self):
        try:
            self._prepared.set_result(self._prepare())
        except Exception as refusal:
            self._prepared.set_exception(refusal)
            return
        try:
            while not self._stop.is_set():
                self._turn(self._waiting())
                while not self._asked.empty():
                    self._grant(*self._asked.get())
        except Exception as error:
            self.ended = f"the exchange has ended by {sentence_of(error)}"
            self._node.get_logger().error(self.ended)

    def _grant(self, done, wish):
        if not done.set_running_or_notify_cancel():
            return
        try:
            wish()
        except Exception as error:
            self.ended = f"the exchange has ended by {sentence_of(error)}"
            done.set_exception(error)
            raise
        done.set_result(None)

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
