# SPDX-License-Identifier: Apache-2.0
"""docs/reference/link_protocol.md has the layouts, kinds and bits by which both ends of the link are judged."""

import re
import struct
from pathlib import Path

import link_frames
import pytest

PAGE = (Path(__file__).parents[2] / "docs/reference/link_protocol.md").read_text(encoding="utf-8")
LETTERS = {"u8": "B", "u16": "H", "u32": "I", "i16": "h", "i32": "i", "i64": "q", "f32": "f", "f64": "d"}
NAMES = {
    "greeting": link_frames.GREETING,
    "command": link_frames.COMMAND,
    "sample": link_frames.SAMPLE,
    "clock, clock answer": link_frames.CLOCK_ANSWER,
    "target": link_frames.TARGET,
    "truth": link_frames.TRUTH,
}


def rows(head):
    """Cells of the table with this head."""
    table = PAGE.split(f"\n{head}\n", 1)[1].split("\n\n")[0]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[1:]]


def size(kind):
    """Bytes of a type as the page writes it: f32[3], char[24]."""
    letter, count = re.fullmatch(r"(\w+?)(?:\[(\d+)\])?", kind).groups()
    return int(count or 1) * (1 if letter == "char" else struct.calcsize(f"<{LETTERS[letter]}"))


@pytest.mark.parametrize("name", NAMES)
def test_each_field_of_a_payload_begins_where_the_one_before_it_ends(name):
    fields = rows(f"| offset | type | {name} |")
    places = [int(offset) for offset, *_ in fields]
    ends = [place + size(kind) for place, (_, kind, _) in zip(places, fields, strict=True)]
    assert places == [0, *ends[:-1]]
    assert ends[-1] == struct.calcsize(link_frames.PAYLOADS[NAMES[name]])


def test_the_header_has_its_fields_in_their_order():
    *fields, payload, _ = rows("| offset | type | field |")
    letters = "".join(LETTERS[kind] for _, kind, _ in fields)
    assert letters == link_frames.HEAD.format.lstrip("<") and int(payload[0]) == link_frames.HEAD.size


def test_each_kind_has_its_number_and_length():
    listed = {int(number): int(length) for number, _, _, length in rows("| kind | name | from | payload bytes |")}
    assert listed == {kind: struct.calcsize(payload) for kind, payload in link_frames.PAYLOADS.items()}


def test_the_bits_of_the_status_are_those_of_a_sample():
    bits = [link_frames.CUT, link_frames.ESTOP, link_frames.HOT, link_frames.END_SWITCH]
    bits += [link_frames.BROKEN_ENCODER, link_frames.CLAMPED]
    assert [1 << int(bit) for bit, _ in rows("| bit | status |")] == bits
