# SPDX-License-Identifier: Apache-2.0
"""Simulation methods that are calculated: one file each behind `haptic_sim.protocol.World`, and what they share."""
