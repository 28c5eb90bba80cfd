# SPDX-License-Identifier: Apache-2.0
"""What the driver tells the world, by a thread of its own: encoder, motor, wrench, pose and the trace."""

import threading

import numpy as np
from rclpy.duration import Duration

from haptic_device.node import wire
from haptic_device.runtime import clock

TRACE_PERIOD = 10_000_000  # [ns] between trace blocks
ACKNOWLEDGED = 1.0  # [s] that readers of the trace get for its last rows
MOST_ROWS = 256  # a block's size limit; more wait for the next
FRESH_ENOUGH = 400  # ticks after which the statistics are computed anew
WINDOW = 20000  # ticks that the statistics look back on
FRAME = "haptic_base"


class Telemetry:
    """Publishes from the servo's mailboxes until stop()."""

    def __init__(self, node, servo_thread, device, values):
        self._servo, self._device, self._values = servo_thread, device, values
        axes = wire.AXES[: len(device.axes)]
        self._layout = wire.JointLayout(axes, FRAME)
        self._encoder = node.create_publisher(wire.JointState, "encoder", wire.STREAM)
        self._motor = node.create_publisher(wire.JointState, "motor", wire.STREAM)
        self._wrench = node.create_publisher(wire.WrenchStamped, "wrench", wire.STREAM)
        self._pose = node.create_publisher(wire.PoseStamped, "pose", wire.STREAM)
        self._trace = node.create_publisher(wire.PointCloud2, "trace", wire.TRACE)
        self._node, self._stopped, self._scratch = node, False, clock.scratch()
        self._recent = np.zeros((WINDOW, 4))  # lateness, compute, age, write delay [s] of the last ticks
        self._judged, self._judged_at = np.full((4, 4), np.nan), -FRESH_ENOUGH
        self._ticks, self._latched, self._position = 0, 0.0, np.zeros(3)
        self._thread = threading.Thread(target=self._run, name="telemetry")
        self._thread.start()

    def stop(self):
        """Ends the thread with the last rows of the trace."""
        self._stopped = True
        self._thread.join()
        self._trace.wait_for_all_acked(Duration(seconds=ACKNOWLEDGED))  # else the last rows go with the publisher
        for publisher in (self._encoder, self._motor, self._wrench, self._pose, self._trace):
            self._node.destroy_publisher(publisher)

    def percentiles(self):
        """Percentiles 50, 99, 99.9, 100 of lateness, compute, age, write delay of the last ticks [s]; NaN for none."""
        if self._ticks - self._judged_at < FRESH_ENOUGH:
            return self._judged
        recent = self._recent[: min(self._ticks, WINDOW)]
        self._judged_at = self._ticks
        self._judged = np.array([_percentiles(column[column >= 0.0]) for column in recent.T])
        return self._judged

    def _run(self):
        periods = [round(1e9 / self._values[f"publish.{name}"]) for name in ("rate", "pose_rate")] + [TRACE_PERIOD]
        acts, due = (self._publish_axes, self._publish_pose, self._publish_trace), [0, 0, 0]
        while not self._stopped:
            now = int(clock.now_ns(self._scratch))
            for i, act in enumerate(acts):
                if now >= due[i]:
                    due[i] = max(due[i] + periods[i], now - periods[i])
                    act(self._servo.row.get()[0], now)
            clock.sleep_until(min(due), self._scratch)
        self._publish_trace(None, int(clock.now_ns(self._scratch)))

    def _stamp(self, row, now):
        """ROS time [ns] at which the row's sample was latched."""
        return int(clock.read_clock(clock.REALTIME, self._scratch)) - now + int(row.deadline)

    def _publish_axes(self, row, now):
        """Encoder and motor in the device's own units."""
        if not row.deadline:
            return
        n, position = len(self._device.axes), self._device_position(row)
        elapsed = (row.latched - self._latched) * 1e-9
        velocity = (position - self._position) / elapsed if elapsed > 0.0 else np.zeros(3)
        self._latched, self._position = row.latched, position
        stamp, none = self._stamp(row, now), np.zeros(n)
        self._encoder.publish(self._layout.pack(stamp, position[:n], velocity[:n], none))
        self._motor.publish(self._layout.pack(stamp, row.motor[:n], none, row.force_on_handle[:n]))

    def _device_position(self, row):
        settings = self._servo.settings.get()[0]
        return row.counts * settings.position_per_count - settings.zero

    def _publish_pose(self, row, now):
        """The operator's side: handle on the device, and the force the motor holds there."""
        if row.deadline:
            stamp = self._stamp(row, now)
            self._wrench.publish(wire.wrench(stamp, FRAME, row.force_on_handle))
            self._pose.publish(wire.pose(stamp, FRAME, self._device_position(row)))

    def _publish_trace(self, row, now):
        """Everything that waits in the ring, in blocks; stops at one that is not full, for rows never stop coming."""
        count = MOST_ROWS
        while count == MOST_ROWS:
            rows = self._servo.ring.take(MOST_ROWS)
            count = len(rows)
            if count:
                self._remember(rows)
            if count and self._values["publish.trace"]:
                self._trace.publish(wire.trace_cloud(self._stamp(rows[0].view(np.recarray), now), FRAME, rows))

    def _remember(self, rows):
        index = np.arange(self._ticks, self._ticks + len(rows)) % WINDOW
        self._recent[index] = np.stack(
            [rows["lateness"], rows["compute"], rows["tool_age"], rows["write_delay"]], axis=1
        )
        self._ticks += len(rows)


def _percentiles(numbers):
    return np.percentile(numbers, (50, 99, 99.9, 100)) if len(numbers) else np.full(4, np.nan)
