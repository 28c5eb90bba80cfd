# SPDX-License-Identifier: Apache-2.0
"""What is said of a driver that fell into a fault: which, why, and what clears it."""

from haptic_device.control.faults import TABLE

FAULTS = {fault.name: fault for fault in TABLE}
"""The rows of the table of faults by name."""


def fell(name: str) -> str:
    """Which fault, and its cause."""
    return f"haptic_driver fell into fault {name} ({FAULTS[name].cause})"


def what_to_do(name: str) -> str:
    """Which fault, its cause, and what clears it."""
    return f"{fell(name)}; what clears it: {FAULTS[name].clear}"
