# SPDX-License-Identifier: Apache-2.0
"""`haptic status` where several displays are in the domain: names that tell them apart, and whom a key reaches."""

import contextlib
import time
from types import SimpleNamespace

from haptic_device.status import Status
from haptic_sim.cli.keys import ESTOP
from haptic_sim.cli.status import KEYS, _answers, _drivers, newest

DRIVER = Status(0, 0, "idle", {"namespace": "/haptic"})
LEFT = {"haptic_driver": (Status(0, 0, "idle", {"namespace": "/left"}), time.monotonic())}


class Heard:
    """A client that hears of these displays, and what it is told to ask."""

    def __init__(self, own=(), elsewhere=()):
        self.statuses, self.elsewhere, self.asked = dict(own), dict(elsewhere), []
        self.heard = dict.fromkeys(self.statuses, time.monotonic())
        self.node = SimpleNamespace(get_namespace=lambda: "/haptic")

    @contextlib.contextmanager
    def ask(self, question):
        yield SimpleNamespace(poll=lambda: self.asked.append(question.service))

    def call(self, question):
        self.asked.append(question.service)
        return "done"


def test_one_display_is_shown_without_its_namespace_also_beside_strangers_and_two_with_it():
    stranger = {"camera": Status(0, 0, "", {})}
    assert list(newest(Heard({"haptic_driver": DRIVER}), True)) == ["haptic_driver"]
    assert set(newest(Heard(stranger, {"/left": LEFT}), True)) == {"camera", "haptic_driver"}
    both = Heard({"haptic_driver": DRIVER}, {"/left": LEFT})
    assert list(newest(both, True)) == ["/haptic/haptic_driver", "/left/haptic_driver"]
    assert list(newest(both)) == ["haptic_driver"]


def test_a_key_reaches_the_display_that_is_there_and_of_several_an_e_stop_all_at_once_and_nothing_else_any():
    for heard, driver in ((Heard(), "/haptic"), (Heard((), {"/left": LEFT}), "/left")):
        assert _drivers(heard, True) == [f"{driver}/haptic_driver"]
    both = Heard({"haptic_driver": DRIVER}, {"/left": LEFT})
    drivers = _drivers(both, True)
    assert _answers(both, drivers, "reset") == "reset refused: 2 displays are here; name one by --namespace"
    assert both.asked == []
    _answers(both, drivers, KEYS[ESTOP])
    assert set(both.asked[:2]) == {"/haptic/haptic_driver/estop", "/left/haptic_driver/estop"}
