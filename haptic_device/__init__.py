# SPDX-License-Identifier: Apache-2.0
"""The device side of the haptic display: laws, analysis, run time and ROS nodes. Never imports haptic_sim."""
