# SPDX-License-Identifier: Apache-2.0
"""What simulates in the haptic display: scenes, simulation methods, the node, and runs without a clock."""
