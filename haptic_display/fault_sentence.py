# SPDX-License-Identifier: Apache-2.0
"""What is said of a driver that fell into a fault: which, why, and what to do; in words for a page and a terminal."""

from haptic_device.control.faults import FAULTS

BUTTON = "Reset and engage"
PRESS = f"press {BUTTON}"
TYPE = "press r and e in haptic status"
RUN = "start again"  # where the nodes have ended


def cause(name: str, number: str = "") -> str:
    """Why, with its number where that is known."""
    return "; ".join(filter(None, (FAULTS[name].cause, number)))


def called(name: str) -> str:
    """Which fault."""
    return f"{FAULTS[name].title} (fault {name})"


def fell(name: str, number: str = "") -> str:
    """Which fault, and its cause. number: the driver's entry `fault_detail`."""
    return f"{called(name)}: {cause(name, number)}"


def what_to_do(name: str, number: str = "", last: str = RUN, first: str = "") -> str:
    """Which fault, its cause, and what to do, in a terminal; after a run, or with TYPE at a display that goes on."""
    return f"{fell(name, number)}. {steps(name, last, first)}"


def steps(name: str, last: str = PRESS, first: str = "") -> str:
    """What a person does first, if anything, and then. first: the driver's entry `fault_first`, where it is known."""
    first = first or FAULTS[name].first
    return _sentence(f"{first}, then {last}" if first else last)


def _sentence(words):
    return f"{words[0].upper()}{words[1:]}."
