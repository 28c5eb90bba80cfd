# SPDX-License-Identifier: Apache-2.0
"""Local contacts over the wire: what a simulation packs the driver takes, once, and only if it belongs to its tool."""

import random

import numpy as np
import pytest
from handle_samples import HOME, Recording, handle

from fault_injection.flood import mutated
from haptic_device.control import contact_model
from haptic_device.control import exchange_samples as law
from haptic_device.message_fields import EACH, LOCAL_CONTACT, MOST
from haptic_device.realtime import exchange_step, seqlock
from haptic_device.recording.layouts import CloudLayout
from haptic_sim.exchange.endpoint import ExchangeEndpoint

SESSION, OTHER, PEER = 7.0, 9.0, 5.0
COMMON = {"offered": 1.0, "trust": 0.5, "mass": 0.1, "inertia": 1e-4, "extent": 0.05, "tool_pose_x": 0.2}


class Driver:
    """The driver's end: a session that has asked five times, and knows its simulation."""

    def __init__(self, peer):
        self.frame = exchange_step.make_near_frame(*CloudLayout(LOCAL_CONTACT).fixed(MOST))
        self.state, self.watch = np.zeros(1, exchange_step.STATE), np.zeros(exchange_step.WATCHES, np.int64)
        self.state["session"], self.state["sequence"], self.state["peer_session"] = SESSION, 5.0, peer
        self.state["sent"][0, 3] = 123
        self.near, self.mail = np.zeros(1, contact_model.SET), seqlock.SeqLock(contact_model.SET)

    def take(self, data):
        self.frame.incoming[: len(data)] = np.frombuffer(data, np.uint8)[: len(self.frame.incoming)]
        return exchange_step.take_in_contacts(
            self.frame, len(data), self.state[0], self.watch, self.near, self.mail.words
        )


class Contacts:
    """What a simulation says of its local contacts: one flat one, which may be given otherwise."""

    def __init__(self, given):
        self.common, self.table = COMMON, np.zeros((MOST, len(EACH)))
        flat = {"identity": 4.0, "kind": contact_model.FLAT_THERE, "normal_x": 1.0}
        for name, value in (flat | given).items():
            self.table[2, EACH.index(name)] = value

    def look(self, lag):
        """All is said."""


def packed(answers=3.0, session=SESSION, peer=PEER, scene=0, **given):
    """The local contacts that go with the answer of the simulation `peer` to this handle sample."""
    end = ExchangeEndpoint(Recording(Contacts(given)), HOME, "local")
    end.session, end.scene = peer, scene
    assert end.answer([handle(answers, session, exchange_method=float(law.LOCAL))], 0) is not None
    return end.local_contacts()


@pytest.fixture
def driver():
    return Driver(PEER)


def test_what_is_packed_arrives_with_the_time_of_the_sample_it_answers(driver):
    assert driver.take(packed()) == contact_model.ACCEPTED
    found = driver.mail.get()[0]
    assert (found.number, found.sent, found.trust, found.mass, found.tool_pose_x) == (3.0, 123.0, 0.5, 0.1, 0.2)
    assert found.table[2, contact_model.IDENTITY] == 4.0 and found.table[2, contact_model.NORMAL_X] == 1.0


def test_a_set_has_the_length_at_which_it_arrives(driver):
    """RTPS rounds a payload up to four bytes; one of another length than the driver's own is refused."""
    assert len(packed()) % 4 == 0 and len(packed()) == len(driver.frame.template)


def test_late_repeated_foreign_and_nonsensical_sets_are_refused_and_counted(driver):
    assert driver.take(packed()) == contact_model.ACCEPTED
    assert driver.take(packed()) == contact_model.OLD
    assert driver.take(packed(2.0)) == contact_model.OLD
    assert driver.take(packed(6.0)) == contact_model.NOT_MINE
    assert driver.take(packed(4.0, OTHER)) == contact_model.NOT_MINE
    assert driver.take(packed(4.0, peer=PEER + 2.0)) == contact_model.OTHER_SENDER
    assert driver.take(packed(4.0, normal_x=0.5)) == contact_model.NOT_A_CONTACT
    assert driver.take(packed(4.0, gap=np.nan)) == contact_model.NOT_FINITE
    assert driver.take(packed(4.0)[:-8]) == contact_model.OTHER_LAYOUT
    assert driver.watch[exchange_step.SEEN] == 1 and driver.watch[exchange_step.UNSEEN :].sum() == 8
    assert driver.mail.get()[0].number == 3.0


def test_whatever_is_wrong_with_a_set_what_counts_stays_finite(driver):
    dice, whole = random.Random(7), packed()
    verdicts = set()
    for _ in range(20_000):
        driver.state["near_answered"] = 0.0
        verdicts.add(driver.take(mutated(whole, dice)))
        assert np.isfinite(driver.near["table"]).all() and np.isfinite(driver.near["trust"]).all()
    assert len(verdicts) >= 5, "the mutations reach many refusals"


def test_contacts_of_a_scene_that_was_left_are_refused(driver):
    old = packed(4.0)
    assert driver.take(packed(scene=1)) == contact_model.ACCEPTED
    assert driver.take(old) == contact_model.OTHER_SCENE
