# SPDX-License-Identifier: Apache-2.0
"""Publishes `markers` while somebody listens, and frames on /tf where tf is installed."""

import time

from haptic_device.nodes.marker_messages import MarkerArray, TFMessage, frames, markers
from haptic_device.nodes.messages import STREAM
from haptic_sim.node.scene_publisher import FRAME
from haptic_sim.viewer import markers as made

LOOK_PERIOD = 0.5  # s between two looks whether somebody listens


class Beacon:
    """rate: markers a second [Hz]."""

    def __init__(self, node, rate: float):
        self._node, self._period = node, 1.0 / rate
        self._markers = node.create_publisher(MarkerArray, "markers", STREAM)
        self._frames = node.create_publisher(TFMessage, "/tf", STREAM) if TFMessage else None
        self._due = self._look_due = 0.0
        self._heard = False

    def show(self, scene, frame: dict, walls, workspace, now: float) -> None:
        """A frame of the feed, if it is time. scene: None while there is none; walls, workspace: as
        `markers.surroundings` has them; now [s]."""
        if now >= self._look_due:
            self._look_due = now + LOOK_PERIOD
            self._heard = self._markers.get_subscription_count() > 0
        if now < self._due:
            return
        self._due = max(self._due + self._period, now)
        stamp = time.time_ns()
        if self._heard and (wanted := self._wanted(scene, frame, walls, workspace)):
            self._markers.publish(markers(stamp, FRAME, wanted))
        if self._frames:
            known = {name: frame[name] for name in ("handle", "tool") if frame[name]}
            self._frames.publish(frames(stamp, FRAME, {"haptic_base": (0.0, 0.0, 0.0), **known}))

    def _wanted(self, scene, frame, walls, workspace):
        there = (frame["tool"], frame["bodies"])
        solids = made.bodies(scene, *there) + made.joints(scene, *there) if scene and frame["tool"] else []
        return solids + made.surroundings(walls, workspace) + made.happenings(frame)
