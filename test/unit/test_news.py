# SPDX-License-Identifier: Apache-2.0
"""How tools wait for a driver, and what they do where the one that they started falls into a fault."""

import contextlib
import types

import numpy as np
import pytest
from made_up_clock import Clock

from haptic_device.control.records import TRACE_ROW
from haptic_device.recording.status import Status
from haptic_display.device_tools import pair, tuning
from haptic_display.device_tools.tuning import FaultError, Tuning
from haptic_display.run import news


class Heard:
    """A client that hears of the driver what `said(seconds)` gives: state, fault, exchange_answered.

    tells: whether a simulated device tells its truth; traces: samples of the trace, one each look.
    """

    def __init__(self, clock, said, tells=True, traces=()):
        self._clock, self._began, self._said, self._tells = clock, clock.now, said, tells
        self._traces = [types.SimpleNamespace(message=message) for message in traces]
        self.statuses, self.truth, self.truths, self.aim, self.close = {}, {}, [], None, None
        self.node = types.SimpleNamespace(get_namespace=lambda: "/there")

    def look(self):
        if values := self._said(self._clock.now - self._began):
            self.statuses["haptic_driver"] = Status(0, 0, values.get("state", ""), values)
            self.truths += [{}] * self._tells

    def subscribe(self, topic, *what):
        assert topic == "trace"
        return self

    def take(self):
        return [self._traces.pop()] if self._traces else []

    def said(self, node, entry):
        return self.statuses[node].values.get(entry, "") if node in self.statuses else ""


@pytest.fixture
def waited(monkeypatch):
    """waited(said, check, of) waits as the tool does for such a driver."""
    clock = Clock().put(monkeypatch, news, tuning)

    def wait(said, check=dict, of="wait_engaged"):
        monkeypatch.setattr(tuning.Client, "join", lambda *where, **how: Heard(clock, said))
        getattr(Tuning(0, "/there"), of)(check)

    return wait


def test_a_tool_that_looks_at_the_trace_needs_no_simulated_device_and_one_that_looks_at_the_truth_does(monkeypatch):
    clock = Clock().put(monkeypatch, news, tuning)
    row = np.ones(1, TRACE_ROW)

    def tool(trace, traces=()):
        monkeypatch.setattr(tuning.Client, "join", lambda *where, **how: Heard(clock, engaged, False, traces))
        return Tuning(0, "/there", trace=trace)

    def engaged(seconds):
        return {"state": "engaged"}

    cloud = types.SimpleNamespace(point_step=row.itemsize, data=row.tobytes())
    looking = tool(True, [cloud])
    looking.wait_engaged()
    assert looking.rows == [row]
    with pytest.raises(ValueError, match=r"no engaged driver with a trace \(publish.trace\) is heard in /there"):
        tool(True).wait_engaged()
    with pytest.raises(ValueError, match="no engaged driver with a loopback is heard in /there"):
        tool(False).wait_engaged()


def test_nodes_of_which_nothing_is_heard_are_told_with_what_to_do(waited, monkeypatch):
    lack = f"no engaged driver with a loopback is heard in /there, and no news for {news.LIMIT:g} s: "
    with pytest.raises(ValueError, match="or let this command start them") as ended:
        waited(lambda t: {})
    heard = "nothing was heard of haptic_driver; nothing was heard of haptic_loopback"
    assert str(ended.value).startswith(f"{lack}{heard}; start both and enable the driver")
    monkeypatch.setenv("ROS_DISCOVERY_SERVER", "127.0.0.1:11811")
    with pytest.raises(ValueError, match=f"and no news for {news.UNSERVED:g} s: ROS_DISCOVERY_SERVER is '127.0.0.1"):
        waited(lambda t: {}, lambda: {"haptic_driver": "[INFO] [1.5]: servo at 4000 Hz"})


@pytest.fixture
def worked(monkeypatch):
    """worked(faults, domain) does some work on nodes whose driver falls into each of these faults, one at a time."""

    def work(faults, domain=None):
        started, left = [], list(faults)

        @contextlib.contextmanager
        def running(*given):
            started.append(given)
            yield 7, "/there", dict

        def once(domain, namespace, check):
            if left:
                raise FaultError(left.pop(0))
            return domain, namespace, len(started)

        monkeypatch.setattr(pair, "running", running)
        return pair.on_pair(domain, None, {}, {}, once)

    return work


def test_where_the_driver_of_a_pair_of_its_own_falls_into_a_fault_a_tool_begins_anew_once_and_says_so(worked, capsys):
    assert worked([]) == (7, "/there", 1) and capsys.readouterr().err == ""
    assert worked(["device_silent"]) == (7, "/there", 2)
    fell = "Device does not answer (fault device_silent): the device did not answer for longer than fault.silence"
    assert capsys.readouterr().err == f"{fell}; both nodes are started anew\n"
    with pytest.raises(ValueError, match="fault.silence again: end what else keeps the machine busy, or take a lower"):
        worked(["device_silent", "device_silent"])
    with pytest.raises(ValueError, match="^haptic_driver is in fault velocity: clear it first"):
        worked(["velocity"], domain=7)
