# SPDX-License-Identifier: Apache-2.0
"""The simulated side of the haptic display: scenes, simulation methods, its node, and the `haptic` command."""
