# SPDX-License-Identifier: Apache-2.0
"""What is said of time that a world left out, because it takes longer than it has or because somebody was late, and of
force that its tool's port withheld: the tool got less than the coupling asked for, and so the hand."""

import math

SHARE = 0.9  # of a period is the world's; messages are read, packed and sent in the rest
NOTICED = 0.01  # share of the time that may be left out, or of the samples that may stay unanswered, unsaid
KEPT_SHORT = 0.2  # share of the time beyond which short force is said: a moment of it is an impact
CHEAPER = (
    "take fewer bodies, a cheaper method (haptic scenes --explain SCENE), a longer sub_step or a lower exchange.rate"
)
QUIETER = "end what else keeps the machine busy, permit real time (haptic doctor), or take a lower exchange.rate"


def left_out_sentence(seconds: float, of: float, load: float, period: float) -> str:
    """Says that a world left out `seconds` of the last so many, why, and what to do; "" if it is not worth a word.

    load: time that the world takes for a second of its own [s], NaN where it is not known; period: that of the handle
    samples [s].
    """
    if seconds <= NOTICED * of:
        return ""
    said = f"it left out {1e3 * seconds:.0f} ms of the last {1e3 * of:.0f} ms"
    if load > SHARE:
        return f"the world is too dear: {said}, {takes(load, period)}; {CHEAPER}"
    return f"handle samples came late to the world: {said}, {takes(load, period)}; {QUIETER}"


def paused_sentence(times: int, limit: float) -> str:
    """Says that a world stood still so often because handle samples were over `limit` [s] apart, or out of order."""
    often = {1: "once", 2: "twice"}.get(times, f"{times} times")
    return f"simulation paused {often}: handle data was late, over {1e3 * limit:g} ms apart, or out of order"


def short_sentence(seconds: float, of: float, tank: float) -> str:
    """Says that the port kept the force short for `seconds` of the last so many, and the cure; "" if it did not last.

    tank: the energy that the port holds [J].
    """
    if seconds <= KEPT_SHORT * of:
        return ""
    return (
        f"force withheld (tool_port): the tool's port kept the force short for {1e3 * seconds:.0f} ms of the last "
        f"{1e3 * of:.0f} ms, and the hand felt as little; it holds {1e3 * tank:.3g} mJ; "
        "push on, which fills it, or raise port_budget or port_force"
    )


def takes(load: float, period: float) -> str:
    """What a period [s] of the world takes, in words."""
    if math.isnan(load):
        return "and what it takes for a period is not known"
    return f"and a period of {1e3 * period:.3g} ms takes it {1e3 * load * period:.3g} ms"
