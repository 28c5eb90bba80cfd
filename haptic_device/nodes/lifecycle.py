# SPDX-License-Identifier: Apache-2.0
"""What all nodes have in common: a managed node that starts by itself, says how it is, and ends well."""

import atexit
import contextlib
import signal
import sys
import threading
import time
from collections.abc import Sequence
from functools import partial

import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import Node, TransitionCallbackReturn

from haptic_device import ros_environment
from haptic_device.config.parameter_types import Parameter
from haptic_device.nodes import messages
from haptic_device.nodes.participant_id import own_participant_id
from haptic_device.nodes.ros import begin_ros, made, refuse_files_of_others
from haptic_device.nodes.ros_parameters import declare
from haptic_device.os_errors import in_words
from haptic_device.process import ENDING, hear, say
from haptic_device.realtime.session_clock import SessionClock

LOOK_UP = 0.05  # [s] longest time a signal waits
DIAGNOSTICS_PERIOD = 0.5  # [s]
LAST_WORD = Duration(seconds=0.2)  # longest time that the end of a node waits for those who hear its diagnostics
TRANSITIONS = {
    number: name.removeprefix("TRANSITION_").lower()
    for name, number in vars(Transition).items()
    if name.startswith("TRANSITION_") and isinstance(number, int)
}
MOST_SAID = 20  # different exceptions that are logged; all are counted


class ManagedNode(Node):
    """Lifecycle node with declared parameters. A subclass has configure, activate, deactivate, cleanup, diagnose.

    configure and activate raise ValueError or OSError to refuse. failure: why the node's work ended by itself, as a
    sentence; "" while it does not. Its diagnostics are then ERROR with that sentence, and `run` deactivates it, or ends
    its process with code 1 where it began by itself (autostart).
    """

    def __init__(self, name, parameters: tuple[Parameter, ...]):
        super().__init__(name)
        self.values = declare(self, parameters)
        self.refusal, self.failure, self.active = "", "", False
        self.survived, self._said_of = 0, set()
        self.told: Sequence[int] = ()  # signals that tell it to end, as they come: whoever waits long looks at them
        self.clock = SessionClock()
        self._diagnostics = self.create_publisher(messages.DiagnosticArray, "/diagnostics", 10)
        self.create_timer(DIAGNOSTICS_PERIOD, self._follow_and_diagnose)
        [service] = [one for one in self.services if one.srv_type is ChangeState]
        service.callback = partial(self._on_change_state, service.callback)
        threading.excepthook = self.thread_ended  # one process, one node

    def destroy_node(self):
        """Ends the node; exceptions of threads are again printed as Python does."""
        threading.excepthook = threading.__excepthook__
        super().destroy_node()

    @property
    def where(self):
        """Namespace and domain, as they are said."""
        return f"{self.get_namespace()}, domain {self.context.get_domain_id()}"

    def take_values(self, values, checked=None):
        """Takes changed values, where nothing else is to be done about them."""
        self.values = values

    def diagnose(self):
        """Says how the node is (`say_status`); called each DIAGNOSTICS_PERIOD."""

    def say_status(self, level, message, values, figures=(), hardware_id=""):
        """Publishes the node's status: level `ok`, `warn` or `error`, values {name: anything}, figures of `statuses`.

        A node that has failed says that instead.
        """
        level, message = ("error", self.failure) if self.failure else (level, message)
        values = {"namespace": self.get_namespace(), **values}  # two displays have nodes of the same names
        now = self.clock.stamp(time.monotonic_ns())
        told = messages.diagnostics(now, self.get_name(), hardware_id, level, message, values, figures)
        self._diagnostics.publish(told)

    def on_configure(self, state):
        """Configures; a refusal is logged as its sentence."""
        return self._try(self.configure, super().on_configure, state, self.cleanup)

    def on_activate(self, state):
        """Starts; what failed before is forgotten."""
        self.failure = ""
        answer = self._try(self.activate, super().on_activate, state, self.deactivate)
        self.active = answer == TransitionCallbackReturn.SUCCESS
        return answer

    def on_deactivate(self, state):
        """Stops; what must be zero is zero before it answers."""
        self.active = False
        return self._try(self.deactivate, super().on_deactivate, state)

    def on_cleanup(self, state):
        """Lets everything go."""
        return self._try(self.cleanup, super().on_cleanup, state)

    def on_shutdown(self, state):
        """Stops and lets everything go, from any state."""
        self.finish()
        return TransitionCallbackReturn.SUCCESS

    on_error = on_shutdown  # after a transition that failed as nobody foresaw: unconfigured again

    def _on_change_state(self, change, request, response):
        """Answers also where the node's state has no such transition, as a second `activate` of an active node."""
        before = self._state_machine.current_state[1]
        try:
            return change(request, response)
        except RuntimeError:  # RCLError, which rclpy lets pass: nobody would be answered
            wanted = request.transition.label or TRANSITIONS.get(request.transition.id, request.transition.id)
            self.get_logger().error(f"{self.get_name()} is {before}; there is no transition {wanted} from there")
            response.success = False
            return response

    def _follow_and_diagnose(self):
        self.clock.follow()
        self.diagnose()

    def survive(self, error):
        """Counts an exception out of a callback, and logs it; a node that a message could end would be no safe one."""
        self.survived += 1
        sentence = sentence_of(error)
        if sentence not in self._said_of and len(self._said_of) < MOST_SAID:
            self._said_of.add(sentence)
            self.get_logger().error(f"an input could not be served: {sentence}")

    def fail(self, sentence):
        """The node's work has ended by itself; any thread may say so. The first failure is kept, all are logged."""
        self.failure = self.failure or sentence
        self.get_logger().error(sentence)

    def thread_ended(self, ended):
        """threading.excepthook: an exception that ends a thread of the node is its failure."""
        self.fail(f"the {ended.thread.name} thread ended: {sentence_of(ended.exc_value)}")

    def end_failed(self):
        """Ends what is left of the work of a node that has failed; ValueError where its process is to end."""
        if self.values["autostart"]:
            raise ValueError(self.failure)
        if self.active:
            self.trigger_deactivate()

    def serve(self, executor, patience=LOOK_UP):
        """Serves what has come within `patience` [s]; whatever a message makes rclpy or a callback raise ends there."""
        try:
            executor.spin_once(timeout_sec=patience)
        except Exception as error:
            self.survive(error)

    def finish(self):
        """Ends in the right order whatever has begun; what was said last is heard before the node is gone."""
        self.active = False
        try:
            self.deactivate()
            self._diagnostics.wait_for_all_acked(LAST_WORD)
        finally:
            self.cleanup()

    def _try(self, action, after, state, undo=lambda: None):
        try:
            action()
        except (ValueError, OSError) as refusal:
            self.refusal = in_words(refusal)
            self.get_logger().error(self.refusal)
            undo()
            return TransitionCallbackReturn.FAILURE
        except Exception as error:
            self.survive(error)
            self.refusal = sentence_of(error)
            return TransitionCallbackReturn.ERROR
        return after(state)


def sentence_of(error):
    """Kind and text of an exception on one line."""
    return f"{type(error).__name__}: {in_words(error)}"


def _autostart(node):
    if not node.values["autostart"]:
        return
    for trigger in (node.trigger_configure, node.trigger_activate):
        if node.told:
            return
        if node.failure:  # of a thread that it has from its beginning
            raise ValueError(node.failure)
        if trigger() != TransitionCallbackReturn.SUCCESS:
            raise ValueError(node.refusal)


def hear_the_end():
    """From now on SIGINT, SIGTERM and SIGHUP are put into the list that is returned, and do nothing else."""
    told = []
    hear(lambda received, frame: told.append(received))
    atexit.register(_be_deaf)
    return told


def _be_deaf():
    """Python takes its handlers back while it ends: one signal more would be what a process that is done died of.

    One that another thread took just before the change is no news: Python would print it with a traceback.
    """
    tell, sys.unraisablehook = sys.unraisablehook, lambda found: "race condition" in str(found.exc_value) or tell(found)
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)


def run(make_node, name, args=None):
    """Runs a managed node until SIGINT, SIGTERM or SIGHUP, exit code 0; code 1 after a refusal or failure, printed.

    A signal only sets a flag, also while the node starts: raised in the middle of anything it would leave threads that
    wait on what is then destroyed.
    """
    told = hear_the_end()
    with contextlib.ExitStack() as ends:  # in the reverse order, each whatever the others do
        ends.callback(rclpy.try_shutdown)
        try:
            with own_participant_id(name):
                begin_ros(args)
                node = made(make_node)
            ends.callback(node.destroy_node)
            ends.callback(node.finish)
            refuse_files_of_others(node, name, args)
            if said := ros_environment.discovery():
                node.get_logger().info(said)
            node.told = told
            executor = SingleThreadedExecutor()
            executor.add_node(node)
            _autostart(node)
            while not told and rclpy.ok():
                node.serve(executor)
                if node.failure:
                    node.end_failed()
        except (ValueError, OSError) as refusal:
            say(f"{name}: {in_words(refusal)}")
            return 1
        except KeyboardInterrupt:  # of jit.ensure_compiled, which was waiting
            return 0
    return 1 if node.failure else 0
