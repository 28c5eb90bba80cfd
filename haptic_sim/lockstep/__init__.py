# SPDX-License-Identifier: Apache-2.0
"""Recorded hands and ticks again, in lock-step, without clock or DDS."""
