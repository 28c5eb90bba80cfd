# SPDX-License-Identifier: Apache-2.0
"""What the device's nodes have in common: a managed node that starts by itself and ends well."""

import atexit
import os
import re
import signal
import sys
from collections.abc import Sequence

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import Node, TransitionCallbackReturn
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from haptic_device.nodes.participant_id import own_participant_id
from haptic_device.nodes.ros_parameters import declare
from haptic_device.parameter import Parameter

LOOK_UP = 0.05  # [s] longest time a signal waits
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
MOST_SAID = 20  # different exceptions that are logged; all are counted


class ManagedNode(Node):
    """Lifecycle node with declared parameters; a subclass's begin/end raise ValueError, OSError to refuse."""

    def __init__(self, name, parameters: tuple[Parameter, ...]):
        super().__init__(name, namespace="/haptic")
        self.values = declare(self, parameters)
        self.refusal, self.survived, self._said_of = "", 0, set()
        self.told: Sequence[int] = ()  # signals that tell it to end, as they come: whoever waits long looks at them

    def page_name(self, page_name):
        """The device page of this node's ROS domain and namespace."""
        return page_name(os.environ.get("ROS_DOMAIN_ID", "0") or "0", self.get_namespace())

    def on_configure(self, state):
        """Configures; a refusal is logged as its sentence."""
        return self._try(self.configure, super().on_configure, state, self.cleanup)

    def on_activate(self, state):
        """Starts."""
        return self._try(self.activate, super().on_activate, state, self.deactivate)

    def on_deactivate(self, state):
        """Stops; what must be zero is zero before it answers."""
        return self._try(self.deactivate, super().on_deactivate, state)

    def on_cleanup(self, state):
        """Lets everything go."""
        return self._try(self.cleanup, super().on_cleanup, state)

    def on_shutdown(self, state):
        """Stops and lets everything go, from any state."""
        self.finish()
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state):
        """After a transition that failed as nobody foresaw: stops and lets everything go, unconfigured again."""
        self.finish()
        return TransitionCallbackReturn.SUCCESS

    def survive(self, error):
        """Counts an exception out of a callback, and logs it; a node that a message could end would be no safe one."""
        self.survived += 1
        sentence = f"{type(error).__name__}: {' '.join(str(error).split())}"
        if sentence not in self._said_of and len(self._said_of) < MOST_SAID:
            self._said_of.add(sentence)
            self.get_logger().error(f"an input could not be served: {sentence}")

    def finish(self):
        """Ends in the right order whatever has begun."""
        try:
            self.deactivate()
        finally:
            self.cleanup()

    def _try(self, action, after, state, undo=lambda: None):
        try:
            action()
        except (ValueError, OSError) as refusal:
            self.refusal = str(refusal)
            self.get_logger().error(self.refusal)
            undo()
            return TransitionCallbackReturn.FAILURE
        except Exception as error:
            self.survive(error)
            self.refusal = f"{type(error).__name__}: {error}"
            return TransitionCallbackReturn.ERROR
        return after(state)


def _autostart(node):
    if not node.values["autostart"]:
        return
    for trigger in (node.trigger_configure, node.trigger_activate):
        if node.told:
            return
        if trigger() != TransitionCallbackReturn.SUCCESS:
            raise ValueError(node.refusal)


def begin_ros(args):
    """rclpy.init without signal handlers; ValueError, one sentence, for arguments or a file that ROS cannot read."""
    try:
        left = remove_ros_args(args=sys.argv if args is None else args)[1 if args is None else 0 :]
        if left:
            raise ValueError(f"{left[0]} is no argument of a node; ROS arguments begin with --ros-args")
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # rcl's own kinds are nowhere public; their text ends with places in its source
        raise ValueError(f"ROS does not take these arguments: {_plain(error)}") from None


def _plain(error):
    """The text of one of rcl's errors without the places in its source."""
    heads = "failed to initialize rcl|Failed to parse ROS arguments|error creating node"
    return " ".join(re.sub(rf",? at \S+:\d+|^({heads}): ", "", str(error)).split())


def _made(make_node):
    """The node; ValueError, one sentence, where ROS makes none (a middleware without security is asked for it)."""
    try:
        return make_node()
    except RuntimeError as error:
        raise ValueError(f"ROS makes no node: {_plain(error)}") from None


def _serve(executor, node):
    """Serves what has come; whatever a message makes rclpy or a callback raise ends there."""
    try:
        executor.spin_once(timeout_sec=LOOK_UP)
    except Exception as error:
        node.survive(error)


def hear_the_end():
    """From now on SIGINT, SIGTERM and SIGHUP are put into the list that is returned, and do nothing else."""
    told = []
    for number in ENDING:
        signal.signal(number, lambda received, frame: told.append(received))
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
    """Runs a managed node until SIGINT, SIGTERM or SIGHUP, exit code 0; a refusal is printed as its sentence, code 1.

    A signal only sets a flag, also while the node starts: raised in the middle of anything it would leave threads that
    wait on what is then destroyed.
    """
    told, node = hear_the_end(), None
    try:
        with own_participant_id(name):
            begin_ros(args)
            node = _made(make_node)
        node.told = told
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        _autostart(node)
        while not told and rclpy.ok():
            _serve(executor, node)
    except (ValueError, OSError) as refusal:
        print(f"{name}: {' '.join(str(refusal).split())}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:  # of jit.ensure_compiled, which was waiting
        return 0
    finally:
        try:
            if node is not None:
                node.finish()
        finally:
            if node is not None:
                node.destroy_node()
            rclpy.try_shutdown()
    return 0
