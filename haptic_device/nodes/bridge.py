# SPDX-License-Identifier: Apache-2.0
"""haptic_bridge: serves the device page from hardware on a line, as the device description says what it is."""

if __name__ == "__main__":  # before the imports, which take seconds
    from haptic_device.process import start

    raise SystemExit(start(__spec__.name))

import contextlib
import os
import secrets
import threading
import time

import numpy as np

from haptic_device.config.description import load_device
from haptic_device.config.drives import drives
from haptic_device.config.link_registry import SERVED, UdpOptions
from haptic_device.config.parameters import BRIDGE, BRIDGE_FIGURES
from haptic_device.jit import ensure_compiled
from haptic_device.link import bridge_loop, clock_fit, codec, line
from haptic_device.nodes import diagnostics
from haptic_device.nodes.lifecycle import run
from haptic_device.nodes.page_server import PageServer
from haptic_device.realtime.seqlock import SeqLock

SAME = 1e-3  # relative, within which two numbers are the same
REOPEN = 0.2  # [s] between tries to open a line that is not there
TARGET = np.dtype([("place", "f8", (3,))])
STEP_TOLD = 30_000_000_000  # [ns] for which it is said that the device's clock was set
WRONG_CLOCK = "greets, but its answers to questions for its clock cannot be: are they in ns?"
HOLDS = "this device holds its last motor value where haptic_bridge is killed or stopped: keep a switch at hand"
OPEN = {False: line.open_serial, True: line.open_udp}


class BridgeNode(PageServer):
    """Configured it holds the page and has tried the line, active it serves the servo."""

    def __init__(self):
        super().__init__("haptic_bridge", BRIDGE, bridge_loop.CONTROLS)
        self._codec = self._opener = None
        self._descriptor, self._target = -1, SeqLock(TARGET)
        self.reopened, self._why = 0, ""

    def configure(self):
        """Reads the device, opens its line, both of which may be refused, and takes the shared memory."""
        ensure_compiled("bridge", told=self.told)
        self.device = load_device(self.values["device"])
        if self.device.link.type in SERVED:
            raise ValueError(
                f"device {self.device.name} has link type {self.device.link.type}, which haptic_bridge does not serve"
            )
        self.options = pointed(self.device.link.options, self.values["port"])
        self._codec = self.device.link.module.codec(self.options, self.device)
        self._descriptor = self._open()
        self.take_page()

    def activate(self):
        """Starts the loop, and what opens the line again where it is lost."""
        self._control[:] = 0
        self._control[bridge_loop.WATCHDOG] = round(1e9 * self.values["motor_watchdog"])
        self._control[bridge_loop.ASKS] = self._codec.asks
        self._control[bridge_loop.DATAGRAM] = self._codec.datagram
        if self._descriptor < 0:  # it was active before: what came since is no answer to what is asked now
            self._descriptor = self._open()
        self._control[bridge_loop.FD] = self._descriptor
        self.start_loop("bridge")
        self._ending = threading.Event()
        self._opener = threading.Thread(target=self._keep_open, name="line")
        self._opener.start()
        if self._codec.asks and not self._codec.state[codec.WATCHDOG]:
            self.get_logger().warning(HOLDS)
        self.get_logger().info(
            f"serving {self.device.name} on {address(self.options)} in {self.where}; {self.realtime}"
        )

    def deactivate(self):
        """Stops them; the last that the device is told is a motor value of zero."""
        self._control[bridge_loop.STOP] = 1  # first: whatever else fails, the loop takes the motor back
        self.stop_loop()
        if self._opener is not None:
            self._ending.set()
            self._opener.join()
        self._opener = None
        self._close()

    def cleanup(self):
        """Lets line and shared memory go."""
        self._close()
        super().cleanup()

    def _open(self):
        return OPEN[isinstance(self.options, UdpOptions)](self.options)

    def _close(self):
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            with contextlib.suppress(OSError):
                os.close(descriptor)

    def loop(self):
        """From line to page and back."""
        said, mails = self._codec, (self._truth.mail.words, self._target.words)
        coding, page = (said.encode, said.decode, said.state), (self.shared.words, self._control)
        return bridge_loop.compiled(), (*coding, *page, *mails, secrets.randbits(48) | 1)

    def _keep_open(self):
        """Opens the line again where the loop has lost it; what keeps it from that is said once."""
        while not self._ending.wait(REOPEN):
            if self._control[bridge_loop.FD] >= 0:
                continue
            self._close()
            try:
                self._descriptor = self._open()
            except OSError as error:
                if self._why != str(error):
                    self._why = str(error)
                    self.get_logger().error(f"the line is lost: {error}")
                continue
            self.reopened, self._why = self.reopened + 1, ""
            self._control[bridge_loop.FD] = self._descriptor
            self.get_logger().warning(f"{address(self.options)} is open again")

    def lead(self, places):
        """Only the hand of a simulated device follows."""
        if following := self._codec.state[codec.SIMULATED]:
            place = np.zeros(1, TARGET)
            place["place"][0, : len(places)] = places
            self._target.put(place)
        return following

    def diagnose(self):
        """Says how line and device are, while the node is active."""
        if self._thread is None:
            return
        state, control = self._codec.state, self._control
        values = {
            "device": self.device.name,
            "link": self.device.link.type,
            "port": address(self.options),
            "connected": bool(state[codec.READY]),
            "firmware": ".".join(str(int(state[codec.FIRMWARE]) >> shift & 255) for shift in (16, 8, 0)),
            "realtime": self.realtime,
            "driven": bool(control[bridge_loop.DRIVEN]),
            "delay_mean_us": f"{state[codec.DELAY_MEAN] * 1e-3:.1f}",
            "delay_us": f"{state[codec.DELAY] * 1e-3:.1f}",
            "clock_error_us": f"{state[codec.CLOCK_ERROR] * 1e-3:.1f}",
            "skew_ppm": f"{state[codec.SKEW] * 1e-3:.3f}",
            "round_trip_us": f"{state[codec.ROUND_TRIP] * 1e-3:.1f}",
            "samples": int(control[bridge_loop.PASSED]),
            "lost": int(state[codec.LOST]),
            "refused": int(state[codec.REFUSED]),
            "unsent": int(control[bridge_loop.UNSENT]),
            "sessions": int(state[codec.SESSIONS]),
            "clock_steps": int(state[codec.CLOCK_STEPS]),
            "reopened": self.reopened,
            "temperature_c": _temperature(int(state[codec.TEMPERATURE])),
            "run_on": int(control[bridge_loop.RUN_ON]),
            "watchdog_trips": int(control[bridge_loop.TRIPS]),
            "refused_writes": int(control[bridge_loop.REFUSED]),
            "refused_targets": self.refused_targets,
            "survived": self.survived,
            "energy_given": float(self._truth.mail.get()[0].energy_given),
        }
        self.say_status(*self._status(), values, self._watched(values), self.device.name)

    def _status(self):
        """(level, message)."""
        if not self._thread.is_alive():
            return "error", "the loop is not running"
        if self._control[bridge_loop.FD] < 0:
            return "error", self._why or f"the line {address(self.options)} is lost"
        if not self._codec.state[codec.READY]:
            where, greets = address(self.options), self._codec.state[codec.AXES] and self._codec.state[codec.REFUSED]
            return "warn", f"the device on {where} {WRONG_CLOCK}" if greets else f"no device answers on {where}"
        if trouble := clock_trouble(self._codec.state, time.monotonic_ns()):
            return "error" if self._codec.state[codec.CLOCK_TROUBLE] else "warn", trouble
        wrong = "; ".join(contradictions(self._codec.state, self.device))
        return ("error", wrong) if wrong else ("ok", "serving")

    def _watched(self, values):
        """Statuses of the figures that have limits."""
        ready, state = self._codec.state[codec.READY], self._codec.state
        figures = {"delay": state[codec.DELAY] * 1e-9, "clock_error": state[codec.CLOCK_ERROR] * 1e-9} if ready else {}
        figures |= self._rates.of(lost=values["lost"], run_on=values["run_on"])
        return diagnostics.statuses("haptic_bridge", BRIDGE_FIGURES, figures, self.values)


def pointed(options, port):
    """Options that point to this port, "" for their own: a path, or of UDP a port or HOST:PORT. Raises ValueError."""
    if not port:
        return options
    if not isinstance(options, UdpOptions):
        return options.model_copy(update={"port": port})
    host, _, number = port.rpartition(":")
    if not number.isdigit() or not 1 <= int(number) <= 65535:
        raise ValueError(f"port is {port!r}; of a UDP device it should be a number from 1 to 65535, or HOST:NUMBER")
    return options.model_copy(update={"host": host or options.host, "port": int(number)})


def clock_trouble(state, now):
    """What keeps a device's clock from being good enough, or did a moment ago [ns], as a sentence; "" if nothing."""
    trouble, stepped_at = state[codec.CLOCK_TROUBLE], state[codec.CLOCK_STEPPED_AT]
    if trouble == clock_fit.DRIFT:
        skew, most = state[codec.SKEW] * 1e-7, clock_fit.TOLERATED * 100.0
        return f"the device's clock is {abs(skew):.3g} % {'fast' if skew > 0 else 'slow'}; {most:g} % is followed"
    if trouble == clock_fit.JITTER:
        told, most = state[codec.CLOCK_AVERAGE] * 1e-6, clock_fit.JITTER_FELT * 1e-6
        return f"the device's answers jitter and tell its clock to {told:.3g} ms; {most:g} ms is needed"
    if trouble == clock_fit.FINE and stepped_at and now - stepped_at < STEP_TOLD:
        step = state[codec.CLOCK_STEPPED] * 1e-6
        return f"the device's clock was set {'forward' if step > 0 else 'back'} by {abs(step):.3g} ms; never set it"
    return "the device's clock was set; never set it" if trouble else ""


def contradictions(state, device):
    """What a device tells of itself (state of its codec) otherwise than its description, a sentence each."""
    if state[codec.AXES] != len(device.axes):
        yield f"the device has {state[codec.AXES]} axes, its description {len(device.axes)}"
    told = state[codec.TOLD : codec.TOLD + 6].view(np.float64)
    for drive, counts, largest in zip(drives(device), told, told[3:], strict=False):
        what = f"{drive.kind} {drive.name}"
        if counts and abs(counts - drive.counts) > SAME * drive.counts:
            yield f"{what} has {counts:g} counts per unit, its description {drive.counts:g}"
        if largest and largest < drive.most * (1.0 - SAME):
            yield f"{what} takes motor values up to {largest:g}, its description gives up to {drive.most:g}"


def address(options):
    """Where a device is, as it is said."""
    return f"UDP {options.host}:{options.port}" if isinstance(options, UdpOptions) else options.port


def _temperature(tenths):
    return "" if tenths == codec.NO_TEMPERATURE else f"{tenths / 10:.1f}"


def main(args=None):
    """Runs haptic_bridge until SIGINT, SIGTERM or SIGHUP."""
    return run(BridgeNode, "haptic_bridge", args)
