# SPDX-License-Identifier: Apache-2.0
"""What the driver tells of its ticks: each at most once on a topic, with stamps that differ as the deadlines do."""

import struct
import time

import numpy as np
import pytest
from fake_node import Node
from lockstep_systems import device, values
from waiting import until

from haptic_device import controller_config
from haptic_device.control import records
from haptic_device.nodes.telemetry import Telemetry
from haptic_device.realtime import clock, seqlock
from haptic_device.realtime.null_device import NullDevice
from haptic_device.realtime.servo_thread import ServoThread
from haptic_device.realtime.session_clock import SessionClock

EACH_TICK = ("encoder", "motor", "wrench", "pose", "joint_states")
STEP = 1_000_000  # [ns] between the test's ticks
RATES = {"publish__rate": 1000.0, "publish__pose_rate": 1000.0}


def stamps(said):
    """Of these messages [ns]."""
    return [s * 10**9 + ns for s, ns in (struct.unpack_from("<iI", data, 4) for data in said)]


class Told:
    """Telemetry of a servo whose ticks are the test's; counts how often it looks."""

    def __init__(self, patch):
        given = values("haptic_driver", **RATES)
        self.servo = ServoThread(NullDevice(), controller_config.settings_from(device(damping=3.0), given), None, "off")
        self.clock = SessionClock()
        self.node, self.looks, self.deadlines, sleep = Node(), 0, [], clock.sleep_until

        def look(deadline, scratch):
            self.looks += 1
            sleep(deadline, scratch)

        patch.setattr(clock, "sleep_until", look)
        self.telemetry = Telemetry(self.node, self.servo, device(damping=3.0), given, self.clock.stamp)
        self.telemetry.start()

    def tick(self):
        """A tick, and some looks of the telemetry after it."""
        row = np.zeros(1, records.TRACE_ROW)
        self.deadlines.append(10**12 + len(self.deadlines) * STEP)
        row["tick"], row["deadline"] = len(self.deadlines) - 1, self.deadlines[-1]
        self.servo.row.put(row)
        words, rows = self.servo.ring.words, self.servo.ring.rows
        rows[seqlock.ring_slot(words, len(rows) - 1)] = row[0]
        seqlock.ring_push(words)
        begin = self.looks
        until(lambda: self.looks >= begin + 20 and len(self.node.said["trace"]) >= len(self.deadlines), "20 looks")


@pytest.fixture
def told():
    with pytest.MonkeyPatch.context() as patch:
        told = Told(patch)
        yield told
        told.telemetry.stop()


def test_a_tick_is_told_once_though_telemetry_looks_again_and_again(told):
    for count in (1, 2, 3):
        told.tick()
        assert {topic: len(told.node.said[topic]) for topic in EACH_TICK} == dict.fromkeys(EACH_TICK, count)


def test_stamps_differ_as_deadlines_do_also_while_the_system_clock_is_set_back(told, monkeypatch):
    read = time.time_ns
    for ahead in (0, -(10**9), 5 * 10**9):
        monkeypatch.setattr(time, "time_ns", lambda ahead=ahead: read() + ahead)
        told.tick()
    for topic in (*EACH_TICK, "trace"):
        found = stamps(told.node.said[topic])
        assert np.diff(found).tolist() == [STEP, STEP], topic
        assert found == stamps(told.node.said["encoder"]), topic
