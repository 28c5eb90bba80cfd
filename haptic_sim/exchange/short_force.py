# SPDX-License-Identifier: Apache-2.0
"""What is said of force that the tool's port withholds: the tool gets less than the coupling asks for, and so the hand.

A moment of it is an impact; it counts where it lasts, as causes on the device's side do (control/withheld_time).
"""

SHARE = 0.2  # of the time beyond which it is said


def short_sentence(seconds: float, of: float, tank: float) -> str:
    """Says that the port kept the force short for `seconds` of the last so many, and the cure; "" if it did not last.

    tank: the energy that the port holds [J].
    """
    if seconds <= SHARE * of:
        return ""
    return (
        f"force withheld (tool_port): the tool's port kept the force short for {1e3 * seconds:.0f} ms of the last "
        f"{1e3 * of:.0f} ms, and the hand felt as little; it holds {1e3 * tank:.3g} mJ; "
        "push on, which fills it, or raise port_budget or port_force"
    )
