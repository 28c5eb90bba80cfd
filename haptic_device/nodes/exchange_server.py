# SPDX-License-Identifier: Apache-2.0
"""The driver's side of the exchange as a thread, by the compiled loop on librcl (docs/decisions/0002, 0031)."""

import contextlib
import secrets
import threading

import numpy as np

from haptic_device.control import contact_model
from haptic_device.control import exchange_samples as law
from haptic_device.control.records import TRACE_ROW
from haptic_device.message_fields import LOCAL_CONTACT, MOST, exchange_names
from haptic_device.nodes import messages
from haptic_device.nodes.polled_subscription import PolledSubscription
from haptic_device.realtime import exchange_loop, exchange_step, scheduling, servo_loop
from haptic_device.recording.layouts import CLOUD, JOINTS, CloudLayout, JointLayout

PRIORITY = 60


class ExchangeServer:
    """Sends `handle` at the exchange rate and takes `tool`, from start() until stop()."""

    def __init__(self, node, servo_thread, axes, values, clock_offset):
        """clock_offset [ns]: of the session's stamps, as of `follow`."""
        self._servo = servo_thread
        self._realtime, self._period = values["realtime"], round(1e9 / values["exchange.rate"])
        layout = JointLayout(exchange_names(axes))
        self.frame = exchange_step.make_frame(layout.template, layout.fixed, layout.offsets, layout.count)
        self.state, self.watch = np.zeros(1, exchange_step.STATE), np.zeros(exchange_step.WATCHES, np.int64)
        self.state["session"], self.state["axes"] = secrets.randbits(48) | 1, axes
        self.follow(clock_offset)
        self.state["method"] = law.METHODS[values["exchange.method"]]
        self._node = node
        self._publisher = node.create_publisher(messages.JointState, "handle", messages.LATEST)
        # room for more than one: in a queue of one, a message that is refused replaces the answer before it
        self._subscription = PolledSubscription(node, "tool", JOINTS, messages.STREAM, raw=True)
        self.near_frame = exchange_step.make_near_frame(*CloudLayout(LOCAL_CONTACT).fixed(MOST))
        local = values["exchange.method"] == "local"
        self._near = PolledSubscription(node, "local_contacts", CLOUD, messages.STREAM, raw=True) if local else None
        self._compiled, self._error = threading.Event(), None
        self._thread = threading.Thread(target=self._run, name="exchange")

    def start(self):
        """Starts it; OSError, one sentence, if it cannot begin."""
        self._thread.start()
        self._compiled.wait()  # compiling holds the interpreter: done before the servo starts, it disturbs nobody
        if self._error is not None:
            raise OSError(f"the exchange cannot begin: {type(self._error).__name__}: {self._error}")

    def stop(self):
        """Ends the thread, then publisher and subscription."""
        self.watch[exchange_step.STOP] = 1
        if self._thread.is_alive():
            self._thread.join()
        self._subscription.close()
        if self._near is not None:
            self._near.close()
        self._node.destroy_publisher(self._publisher)

    def follow(self, clock_offset):
        """Stamps are deadlines plus this [ns] from now on."""
        self.state["clock_offset"] = clock_offset

    @property
    def sent(self):
        return int(self.watch[exchange_step.SENT])

    @property
    def answered(self):
        return int(self.watch[exchange_step.ANSWERED])

    def refusals(self):
        """{reason: count} of tool messages refused so far."""
        return self._counts(exchange_step.REFUSED, law.REFUSALS)

    @property
    def contact_sets(self):
        return int(self.watch[exchange_step.SEEN])

    def refused_contacts(self):
        """{reason: count} of sets of local contacts refused so far."""
        return self._counts(exchange_step.UNSEEN, contact_model.REFUSALS)

    def _counts(self, first, reasons):
        return {reason: int(count) for reason, count in zip(reasons, self.watch[first:], strict=False) if count}

    def round_trips(self):
        """Percentiles 50 and 99 of the times from composing a handle sample to its answer [ns], lately; NaN: none."""
        known = self.state["round_trip"][0][: int(self.state["turns"][0])]
        return np.percentile(known, (50, 99)) if len(known) else np.full(2, np.nan)

    def _run(self):
        try:
            self._run_rcl()
        except Exception as error:
            if self._compiled.is_set():
                raise
            self._error = error  # for start(), which waits
        finally:
            self._compiled.set()

    def _run_rcl(self):
        publisher, subscription, servo = self._publisher.handle, self._subscription.handle, self._servo
        near_handle = self._near.handle if self._near is not None else contextlib.nullcontext()
        mails = exchange_loop.Mails(servo.row.words, servo.gains.words, servo.tool.words)
        kinds = TRACE_ROW, law.COUPLING_GAINS, servo_loop.TOOL
        records, near = exchange_loop.Records(*(np.zeros(1, kind) for kind in kinds)), None
        with publisher, subscription, near_handle:  # they live on while the loop has their addresses
            exchange_loop.load_library()
            inbox, outbox = exchange_loop.incoming_buffer(), exchange_loop.outgoing_buffer(self.frame.outgoing)
            addresses = publisher.pointer, subscription.pointer
            line = exchange_loop.Line(*addresses, inbox, outbox, self.frame, self._period)
            if self._near is not None:
                record = np.zeros(1, contact_model.SET)
                near = exchange_loop.Near(near_handle.pointer, self.near_frame, servo.near.words, record)
            for watch in (stopped(), self.watch):
                exchange_loop.run_exchange(line, self.state, watch, mails, records, near)
                self._get_ready()
            exchange_loop.free(inbox)

    def _get_ready(self):
        """Urgent from here on; a thread that still compiles would keep a core from everybody for seconds."""
        if self._realtime != "off" and not self._compiled.is_set():
            scheduling.go_realtime("prefer", PRIORITY)
        self._compiled.set()


def stopped():
    """A watch with which a loop returns at once: it is compiled and loaded by that."""
    watch = np.zeros(exchange_step.WATCHES, np.int64)
    watch[exchange_step.STOP] = 1
    return watch
