# SPDX-License-Identifier: Apache-2.0
"""Recordings without ROS: the layouts of our messages, a rosbag2 folder written, read and made whole again."""
