# SPDX-License-Identifier: Apache-2.0
"""A recorded hand played to whoever listens on the topic of targets, in real time."""

import contextlib

import numpy as np
import pytest
from ear import Listener
from rclpy.qos import QoSProfile, ReliabilityPolicy
from waiting import until

from haptic_sim.replay.recorded_operator import PlayedTarget
from haptic_sim.supervision import operator_publisher

AXES, SCALE = ("x", "y", "theta"), (2.0, 2.0, 1.0)  # world metres (radians) per metre (radian) of each axis
COUNT = 300


def test_live_a_listener_hears_samples_of_the_recorded_target(ros_domain):
    ways = np.linspace(0.0, [0.03, -0.02, 0.5], COUNT)
    short, heard = PlayedTarget(np.arange(COUNT) * 1_000_000, ways), []
    with contextlib.closing(Listener(ros_domain, "listener", "/played")) as listener:
        deep = QoSProfile(depth=5000, reliability=ReliabilityPolicy.BEST_EFFORT)
        listener.hear("operator/target", heard.append, deep)

        def play_and_look():  # again and again: nobody says when the listener has learnt of who plays
            assert operator_publisher.play(short, AXES, SCALE, "/played") == COUNT
            listener.look(0.1)

        until(lambda: heard, "a sample of the target", play_and_look)
    assert all(message.name == list(AXES) for message in heard)
    published = (ways * SCALE).tolist()
    assert all(list(message.position) in published for message in heard)


def test_live_without_a_loopback_is_refused_in_a_sentence(ros_domain, monkeypatch):
    monkeypatch.setattr(operator_publisher, "PATIENCE", 0.3)
    with pytest.raises(ValueError, match="nobody listens on /nobody/operator/target"):
        operator_publisher.play(PlayedTarget(np.array([0]), np.zeros((1, 3))), ("x",), (1.0,), "/nobody")
