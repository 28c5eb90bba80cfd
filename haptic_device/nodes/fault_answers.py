# SPDX-License-Identifier: Apache-2.0
"""What the driver answers of a latched fault; the page says it in its own words (haptic_display/page/page_words.py)."""

CLEARED = "fault cleared; ~/enable to go on"


def latched(fault: str) -> str:
    """To who asks for forces while this fault is latched."""
    return f"fault {fault} is latched; call ~/reset first"


def latched_again(fault: str) -> str:
    """To who has reset a fault whose cause still stands."""
    return f"fault {fault} is latched again: its cause is still there"
