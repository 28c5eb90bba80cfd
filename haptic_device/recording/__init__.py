# SPDX-License-Identifier: Apache-2.0
"""Recordings without ROS: `load(bag)` reads one; beside it the layouts of our messages, writing of bags.

`Recording` is what `load` gives, `Joints` a topic of it; `Entries` says what of a topic to read; `*_UNITS` its units.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from haptic_device.recording.bag_contents import ENTRY_UNITS, PORT_UNITS, TRACE_UNITS, Joints, Recording
    from haptic_device.recording.bag_topics import load
    from haptic_device.recording.columns import Entries

__all__ = ["ENTRY_UNITS", "PORT_UNITS", "TRACE_UNITS", "Entries", "Joints", "Recording", "load"]
_PLACES = {"load": "bag_topics", "Entries": "columns"}  # the others: bag_contents


def __getattr__(name: str) -> Any:
    """Imported when it is asked for: a node that only packs messages does without the readers of bags."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_PLACES.get(name, 'bag_contents')}"), name)
