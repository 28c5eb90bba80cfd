# SPDX-License-Identifier: Apache-2.0
"""When the tool that a page shows is not what the hand feels: in which words, and what the hand must do."""

import math
from typing import Any

from haptic_device.control.withheld import TABLE
from haptic_device.digits import plain
from haptic_display.page.page_words import in_page_words
from haptic_display.page.settings import DRIVER, SIMULATION
from haptic_display.page.state import NOT_HELD, State

NOT_FELT, SILENT, LESS = "tool not felt", "simulation silent", "less force"
NEAR = 0.5e-3  # m from the tool at which a handle that still waits stands in walls


def unfelt(state: State, frame: dict[str, Any], known: bool) -> dict[str, str]:
    """{"words": for the chip and the tool, "" if all is felt; "todo": a sentence}. known: the simulation was heard of
    before."""
    if known and DRIVER in state.statuses and SIMULATION not in state.statuses:
        return {"words": SILENT, "todo": "Simulation silent: the tool is drawn where it was last."}
    causes = [name for name in state.said(DRIVER, "withheld").split(", ") if name]
    if state.said(DRIVER, "fault"):
        return {"words": "", "todo": ""}
    if not causes:
        short = state.said(SIMULATION, "withheld")
        return {"words": LESS if short else "", "todo": f"{LESS.capitalize()}: {short}." if short else ""}
    first = next((cause for cause in TABLE if cause.name in causes), None)
    words = NOT_FELT if set(causes) & NOT_HELD else LESS
    if first is None or not first.leads:
        said, cure = map(in_page_words, (first.cause, first.cure) if first else (causes[0], ""))
        todo = f" {cure[0].upper()}{cure[1:]}." if cure else ""
        return {"words": words, "todo": f"{words.capitalize()}: {said}.{todo}"}
    return {"words": words, "todo": f"{words.capitalize()}. {_lead(state, frame)}"}


def _lead(state: State, frame: dict[str, Any]) -> str:
    handle, tool = frame["handle"], frame["tool"]
    if handle is None or tool is None:
        return "Lead the handle to the tool."
    apart = math.hypot(tool[0] - handle[0], tool[1] - handle[1])
    turn = abs(math.degrees(tool[2] - handle[2])) if state.axes == 3 else 0.0
    if apart < NEAR and turn < 1.0:
        return "Lead the handle out of the walls."
    way = "Drag the blue handle onto the orange tool" if state.axes else "Lead the handle to the tool"
    angle = f" and {plain(turn, digits=2)}°" if turn >= 1.0 else ""
    return f"{way}: {plain(1e3 * apart, 'mm', digits=2)}{angle} to go."
