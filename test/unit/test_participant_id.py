# SPDX-License-Identifier: Apache-2.0
"""The profile that gives a node a network port of its own."""

import os
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from haptic_device.nodes import participant_id as ports
from haptic_device.nodes.participant_id import EACH, KINDS, PROFILES, free_ids, own_participant_id, queues
from haptic_display.run.domain import _QUICK


@pytest.fixture(autouse=True)
def shared_memory(monkeypatch, tmp_path):
    monkeypatch.setattr(ports, "QUEUES", tmp_path)
    monkeypatch.setenv("ROS_DOMAIN_ID", "3")
    return tmp_path


def drawn():
    """Id in the profiles in force, and their text."""
    text = Path(os.environ[PROFILES]).read_text()
    [found] = ElementTree.fromstring(text).iterfind(".//{*}participantID")
    return int(found.text), text


@pytest.mark.parametrize("kind", KINDS)
def test_neither_the_living_nor_the_dead_have_the_id_of_a_successor(monkeypatch, kind):
    monkeypatch.delenv(PROFILES, raising=False)
    used = set()
    for _ in range(EACH):
        with own_participant_id(kind):
            number = drawn()[0]
        assert number not in used and PROFILES not in os.environ
        used.add(number)
        queues(number)[len(used) % 2].touch()
    assert free_ids(kind) == []
    with own_participant_id(kind):
        assert PROFILES not in os.environ


def test_two_kinds_never_draw_the_same_and_all_are_within_what_is_looked_for_on_the_loopback_interface(shared_memory):
    ids = [number for kind in KINDS for number in free_ids(kind)]
    assert len(ids) == len(set(ids)) == EACH * len(KINDS) and max(ids) <= 31
    assert queues(8) == [shared_memory / "fastrtps_port8176", shared_memory / "fastrtps_port8177"]  # ports of RTPS


def test_profiles_given_are_kept_and_those_that_choose_an_id_or_cannot_be_read_are_left_alone(monkeypatch, tmp_path):
    given, chosen = tmp_path / "given.xml", _QUICK.replace("</rtps>", "<participantID>7</participantID></rtps>")
    monkeypatch.setenv(PROFILES, str(given))
    for text in (_QUICK, chosen, "no profile"):
        given.write_text(text)
        with own_participant_id(KINDS[0]):
            assert (os.environ[PROFILES] == str(given)) == (text != _QUICK)
            assert text != _QUICK or "leaseAnnouncement" in drawn()[1]
        assert os.environ[PROFILES] == str(given) and given.read_text() == text
