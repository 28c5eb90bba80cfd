# SPDX-License-Identifier: Apache-2.0
"""What the driver tells the world, by a thread of its own: encoder, motor, wrench, pose and the trace.

On a machine that is too busy for all of it each keeps a share, and what is left out is counted: no stream takes more
than half of the time, and the trace, whose blocks take longest, gives way first.
"""

import threading
import time

import numpy as np
from rclpy.duration import Duration

from haptic_device.config.drives import drives, place_of
from haptic_device.control.records import SETTINGS, TRACE_ROW
from haptic_device.control.withheld import WithheldTime
from haptic_device.message_fields import frame_id
from haptic_device.nodes import messages
from haptic_device.nodes.fault_detail import LatchedFault
from haptic_device.nodes.robot_state import RobotState
from haptic_device.realtime import clock
from haptic_device.realtime.tick_replay import SNAPSHOT
from haptic_device.recording.layouts import (
    POSE,
    WRENCH,
    CloudLayout,
    JointLayout,
    StampedLayout,
    pose_numbers,
    wrench_numbers,
)

TRACE_PERIOD = 10_000_000  # [ns] between trace blocks, and between looks for new settings
SNAPSHOT_PERIOD = 1_000_000_000  # [ns] between snapshots of settings and memory, where nothing has changed
ACKNOWLEDGED = 1.0  # [s] that readers of the trace get for its last rows
MOST_ROWS = 256  # a block's size limit; more wait for the next
MOST_REST = 1_000_000  # [ns] that the others of this process get the interpreter for, after work as long or longer
BLOCKS = 8  # that go into the statistics at once: for each alone it took longer than to publish it
FRESH_ENOUGH = 400  # ticks after which the statistics are computed anew
WINDOW = 20000  # ticks that the statistics look back on
JUDGED = "lateness", "compute", "tool_age", "write_delay"
HARDWARE = "position_per_count", "zero", "scale"


class Telemetry:
    """Publishes what the servo leaves under its sequence locks, from start() until stop()."""

    def __init__(self, node, servo_thread, device, values, stamp):
        """stamp: turns a time on CLOCK_MONOTONIC [ns] into that of the session's stamps."""
        self._servo, self._device, self._values, self._stamp = servo_thread, device, values, stamp
        names, frame = [drive.name for drive in drives(device)], frame_id(node.get_namespace(), "base_link")
        self._layout, self._robot = JointLayout(names, frame), RobotState(node, device)
        self._encoder = node.create_publisher(messages.JointState, "encoder", messages.STREAM)
        self._motor = node.create_publisher(messages.JointState, "motor", messages.STREAM)
        self._wrench = node.create_publisher(messages.WrenchStamped, "wrench", messages.STREAM)
        self._pose = node.create_publisher(messages.PoseStamped, "pose", messages.STREAM)
        self._trace = node.create_publisher(messages.PointCloud2, "trace", messages.TRACE)
        self._snapshot = node.create_publisher(messages.PointCloud2, "snapshot", messages.STATE)
        self._trace_layout, self._snapshot_layout = (CloudLayout(TRACE_ROW, frame), CloudLayout(SNAPSHOT, frame))
        self._version, self._snapshot_due, self.cpu = -1, 0, 0.0
        self._node, self._stopped, self._scratch = node, False, clock.scratch()
        self._recent = np.zeros((WINDOW, 4))  # lateness, compute, age, write delay [s] of the last ticks
        self._judged, self._judged_at = np.full((4, 4), np.nan), -FRESH_ENOUGH
        self._ticks, self._latched, self._position = 0, 0.0, [0.0] * 3
        self.withheld, self._blocks = WithheldTime(), []
        self.latched = LatchedFault(device.link.type, servo_thread.link.watchdog)
        self._told = dict.fromkeys(("axes", "pose"), (0.0, 0.0))  # deadline and number of the tick published last
        self.skipped, self._samples, self._known = 0, 0, np.zeros((2, 2), np.int64)
        self._row, self._settings, self._looked = np.zeros(1, TRACE_ROW), np.zeros(1, SETTINGS), False
        self._hardware = {}
        self._wrench_layout, self._pose_layout = (StampedLayout(WRENCH, frame), StampedLayout(POSE, frame))
        self._thread = threading.Thread(target=self._run, name="telemetry")

    def start(self):
        """Starts the thread."""
        self._thread.start()

    def stop(self):
        """Ends the thread with the last rows of the trace."""
        self._stopped = True
        if self._thread.is_alive():
            self._thread.join()
        self._trace.wait_for_all_acked(Duration(seconds=ACKNOWLEDGED))  # else the last rows go with the publisher
        self._robot.close()
        for publisher in (self._encoder, self._motor, self._wrench, self._pose, self._trace, self._snapshot):
            self._node.destroy_publisher(publisher)

    def window(self):
        """Length [s] of the time that the percentiles are of."""
        return min(self._ticks, WINDOW) / self._values["servo.rate"]

    def percentiles(self):
        """Percentiles 50, 99, 99.9, 100 of lateness, compute, age, write delay of the last ticks [s]; NaN for none."""
        if self._ticks - self._judged_at < FRESH_ENOUGH:
            return self._judged
        recent = self._recent[: min(self._ticks, WINDOW)]
        self._judged_at = self._ticks
        self._judged = np.array([_percentiles(column[column >= 0.0]) for column in recent.T])
        return self._judged

    def left_out(self):
        """{figure: share of what was due since the last call and is not published}: samples, and rows of the trace."""
        counts = np.array([[self.skipped, self._samples], [self._servo.ring.dropped, self._ticks]])
        grown, self._known = counts - self._known, counts
        return dict(zip(("skipped", "dropped"), grown[:, 0] / np.maximum(grown.sum(axis=1), 1), strict=True))

    def _run(self):
        periods = [round(1e9 / self._values[f"publish.{name}"]) for name in ("rate", "pose_rate")] + 2 * [TRACE_PERIOD]
        acts = self._publish_axes, self._publish_pose, self._publish_snapshot, self._publish_trace
        now = self._now()
        due, rested = [now] * len(acts), [now] * len(acts)
        while not self._stopped:
            begin, self._looked = now, False
            for i, act in enumerate(acts):
                if now >= max(due[i], rested[i]):
                    behind = (now - due[i]) // periods[i]
                    due[i] += (1 + behind) * periods[i]
                    act(now, behind)
                    began, now = now, self._now()
                    rested[i] = now + (now - began)
            self.cpu = time.thread_time()
            # whoever else wants the interpreter gets it, also where something is always due
            clock.sleep_until(max(min(map(max, due, rested)), now + min(now - begin, MOST_REST)), self._scratch)
            now = self._now()
        self._publish_last()

    def _now(self):
        return int(clock.now_ns(self._scratch))

    def _look(self, teller, behind):
        """The newest row of this turn; False where this teller has told that tick, and before the first.

        behind: times to publish that have passed unused. Where a tick was there for one, a sample was skipped.
        """
        if not self._looked:
            self._servo.row.read(self._row)
            self._looked = True
        (deadline, tick), told = self._told[teller], (float(self._row["deadline"][0]), float(self._row["tick"][0]))
        if told[0] <= deadline:
            return False
        if not deadline:
            self._servo.settings.read(self._settings)  # with the home, which stays what it was at the first tick
            self._hardware = {name: self._settings["hardware"][name][0].tolist() for name in HARDWARE}
        self._told[teller] = told
        self.skipped += min(behind, int(told[1] - tick) - 1) if deadline else 0
        self._samples += 1
        return True

    def _publish_axes(self, now, behind):
        """Encoder and motor of each drive in the device's own units."""
        if not self._look("axes", behind):
            return
        row, n, position = self._row[0], len(self._device.axes), self._drives()
        latched = float(row["latched"])
        elapsed = (latched - self._latched) * 1e-9
        moved = [now - before for now, before in zip(position, self._position, strict=True)]
        velocity = [way / elapsed if elapsed > 0.0 else 0.0 for way in moved]
        self._latched, self._position = latched, position
        stamp, none = self._stamp(row["deadline"]), [0.0] * n
        motor, force = row["motor"].tolist(), self._efforts()
        self._encoder.publish(self._layout.pack(stamp, position[:n], velocity[:n], none))
        self._motor.publish(self._layout.pack(stamp, motor[:n], none, force[:n]))

    def _drives(self):
        counts, (per_count, zero, _) = self._row["counts"][0].tolist(), self._hardware.values()
        return [count * each - at for count, each, at in zip(counts, per_count, zero, strict=True)]

    def _efforts(self):
        """What each motor holds: torques of joints, and forces along axes."""
        row, count = self._row[0], len(self._device.joints)
        return [*row["torque"].tolist()[:count], *row["force_on_handle"].tolist()[count:]]

    def _publish_pose(self, now, behind):
        """The operator's side: handle on the device, and the force the motor holds there; the same as joints.

        Where a linkage's handle cannot be, no pose is told.
        """
        if self._look("pose", behind):
            row, position = self._row[0], self._drives()
            stamp, force = self._stamp(row["deadline"]), row["force_on_handle"].tolist()
            self._wrench.publish(self._wrench_layout.pack(stamp, wrench_numbers(force)))
            if place := place_of(self._device, position):
                self._pose.publish(self._pose_layout.pack(stamp, pose_numbers(place)))
            velocity = [each / by for each, by in zip(row["velocity"].tolist(), self._hardware["scale"], strict=True)]
            self._robot.publish(stamp, position, velocity, self._efforts())

    def _publish_trace(self, now, behind):
        """The oldest rows that wait in the ring, one block; returns how many. What found no room, the ring counts."""
        rows = self._servo.ring.take(MOST_ROWS)
        if len(rows):
            self._remember(rows)
        if len(rows) and self._values["publish.trace"]:
            self._trace.publish(self._trace_layout.pack(self._stamp(rows["deadline"][0]), rows))
        return len(rows)

    def _publish_last(self):
        """What waits at the end: as many blocks as a full ring has, whether or not its writer has ended."""
        now = self._now()
        self._publish_snapshot(now, 0)
        for _ in range(-(-self._servo.ring.size // MOST_ROWS)):
            if self._publish_trace(now, 0) < MOST_ROWS:
                break
        self._judge()

    def _publish_snapshot(self, now, behind):
        """Settings and memory, each second and whenever the settings are new."""
        self._servo.settings.read(self._settings)
        version = int(self._settings["version"][0])
        if not self._values["publish.trace"] or (version == self._version and now < self._snapshot_due):
            return
        snapshot = self._servo.snapshot()
        if snapshot is not None:
            self._version, self._snapshot_due = version, now + SNAPSHOT_PERIOD
            self._snapshot.publish(self._snapshot_layout.pack(self._stamp(now), snapshot))

    def _remember(self, rows):
        self.withheld.add(rows["deadline"], rows["withheld"])
        self.latched.add(rows, self._settings[0])
        self._blocks.append(rows)
        if len(self._blocks) >= BLOCKS or sum(map(len, self._blocks)) >= FRESH_ENOUGH:
            self._judge()

    def _judge(self):
        """Takes what is remembered into the statistics."""
        blocks, self._blocks = self._blocks, []
        if not blocks:
            return
        told = {name: np.concatenate([rows[name] for rows in blocks]) for name in JUDGED}
        index = np.arange(self._ticks, self._ticks + len(told["lateness"])) % WINDOW
        self._recent[index] = np.stack(list(told.values()), axis=1)
        self._ticks += len(index)


def _percentiles(numbers):
    return np.percentile(numbers, (50, 99, 99.9, 100)) if len(numbers) else np.full(4, np.nan)
