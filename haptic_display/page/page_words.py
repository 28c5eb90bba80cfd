# SPDX-License-Identifier: Apache-2.0
"""What nodes answer, in the words of the page: its buttons in place of their services. The one place for it."""

import re

from haptic_device.control.faults import FAULTS
from haptic_device.nodes.fault_answers import latched, latched_again
from haptic_display.fault_sentence import PRESS, steps

SAID = (
    (r"~/reset, then ~/enable", PRESS),
    (r"call ~/disable and ~/enable", "press Disable, then Engage"),
    (r"~/enable to go on", "press Engage to go on"),
    (r"call ~/reset first", PRESS),
    (r"e-stop latched, motor zero", "stopped: the motor is off"),
    (r"set clutch\.open to false", "close the clutch: clutch.open under Expert"),
)
LATCHED, AGAIN = (re.compile(answer(r"(\w+)")) for answer in (latched, latched_again))
ABSENT = re.compile(r"haptic_(\w+) offers no ~/\w+ in .*")
SILENT = re.compile(r"haptic_(\w+) did not answer ~/(\w+) within (.*)")


def in_page_words(sentence: str) -> str:
    """The sentence of a node as the page says it."""
    if (found := LATCHED.fullmatch(sentence)) and found[1] in FAULTS:
        return f"{FAULTS[found[1]].title} is active. {PRESS[0].upper()}{PRESS[1:]}."
    if (found := AGAIN.fullmatch(sentence)) and found[1] in FAULTS:
        return f"{FAULTS[found[1]].title}: its cause is still there. {steps(found[1])}"
    if found := ABSENT.fullmatch(sentence):
        return f"The {found[1]} does not run here."
    if found := SILENT.fullmatch(sentence):
        return f"The {found[1]} did not answer within {found[3]}."
    for said, words in SAID:
        sentence = re.sub(said, words, sentence)
    return sentence
