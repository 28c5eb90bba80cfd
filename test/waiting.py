# SPDX-License-Identifier: Apache-2.0
"""Waiting for what must come: for the thing itself, never for a time."""

import time

LIMIT = 200.0  # [s] for whatever is waited for: a node that starts on a busy machine, or compiles first; no assertion


def until(condition, what, look=lambda: time.sleep(0.005), said=lambda: ""):
    """Does look() until condition() holds, and returns what that gives.

    Raises AssertionError after LIMIT, with what was waited for and said().
    """
    end = time.monotonic() + LIMIT
    while not (found := condition()):
        assert time.monotonic() < end, f"not within {LIMIT:g} s: {what}; {said()}"
        look()
    return found
