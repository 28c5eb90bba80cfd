# SPDX-License-Identifier: Apache-2.0
"""Waits for what hand and nodes do, beside what else runs in the event loop."""

import asyncio
import time
from collections.abc import Callable

ARRIVAL = 10.0  # s that the hand may take to where it is led
STARTING = 60.0  # s that a node which is started again may take until it is heard of
LOOK_PERIOD = 0.02  # s


async def until(condition: Callable[[], bool], patience: float) -> bool:
    """Whether the condition came true within so many seconds."""
    end = time.monotonic() + patience
    while not (true := condition()) and time.monotonic() < end:
        await asyncio.sleep(LOOK_PERIOD)
    return true
