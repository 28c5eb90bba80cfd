# SPDX-License-Identifier: Apache-2.0
"""The simulation's end of the exchange: bytes of the handle in, bytes of the tool out; no ROS."""
