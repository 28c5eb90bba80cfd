# SPDX-License-Identifier: Apache-2.0
"""The profile that gives a node a network port of its own."""

import os
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from haptic_device.node.own_port import IDS, PROFILES, own_port
from haptic_sim.cli.domain import _QUICK


def drawn():
    """Id in the profiles in force, and their text."""
    text = Path(os.environ[PROFILES]).read_text()
    [found] = ElementTree.fromstring(text).iterfind(".//{*}participantID")
    return int(found.text), text


def test_a_successor_hardly_ever_gets_the_port_of_its_predecessor(monkeypatch):
    monkeypatch.delenv(PROFILES, raising=False)
    ids = []
    for _ in range(20):
        with own_port():
            ids.append(drawn()[0])
        assert PROFILES not in os.environ
    assert set(ids) <= set(IDS) and len(set(ids)) > 10


def test_the_highest_id_still_has_its_ports_below_those_of_the_next_domain():
    assert 11 + 2 * IDS[-1] < 250 <= 11 + 2 * (IDS[-1] + 2)


def test_profiles_given_are_kept_and_in_force_again_afterwards(monkeypatch, tmp_path):
    given = tmp_path / "given.xml"
    given.write_text(_QUICK)
    monkeypatch.setenv(PROFILES, str(given))
    with own_port():
        assert "leaseAnnouncement" in drawn()[1] and os.environ[PROFILES] != str(given)
    assert os.environ[PROFILES] == str(given) and given.read_text() == _QUICK


def test_profiles_that_choose_an_id_or_cannot_be_read_are_left_alone(monkeypatch, tmp_path):
    given = tmp_path / "given.xml"
    for text in (_QUICK.replace("</rtps>", "<participantID>7</participantID></rtps>"), "no profile", None):
        given.unlink(missing_ok=True) if text is None else given.write_text(text)
        monkeypatch.setenv(PROFILES, str(given))
        with own_port():
            assert os.environ[PROFILES] == str(given)
