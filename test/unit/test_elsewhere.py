# SPDX-License-Identifier: Apache-2.0
"""Nodes in another namespace than the one asked, or not active: `haptic get` and `haptic status` name them."""

import math
import time
from types import SimpleNamespace

import pytest

from haptic_display.cli import parameters, status
from haptic_display.cli.status import _listen, newest
from haptic_display.client import Client
from haptic_display.service_requests import list_parameters

SHORT = 0.05  # [s]


class Unanswered(Client):
    """In /haptic, of a graph that shows these nodes and no service of theirs, and hears nothing."""

    def __init__(self, *shown):
        pairs = [(name, where or "/") for where, _, name in (one.rpartition("/") for one in shown)]
        self.node = SimpleNamespace(get_namespace=lambda: "/haptic", get_node_names_and_namespaces=lambda: pairs)
        self.shown, self.statuses, self.heard, self.elsewhere, self.look = pairs, {}, {}, {}, lambda: None

    def service(self, name):
        nothing = {"take": lambda: None, "send": lambda asking: None, "forget": lambda asking: None}
        return SimpleNamespace(ready=False, met=False, all_the_same=math.inf, **nothing)


@pytest.fixture
def seconds(monkeypatch):
    """Short times in place of those for nodes that are slow to be found; for one that is nowhere it is a second."""
    monkeypatch.setattr(parameters, "LISTENING", SHORT)
    monkeypatch.setattr(parameters, "ALL_THE_SAME", SHORT)
    monkeypatch.setattr(parameters, "SHOWING", 1.0)


@pytest.mark.parametrize("shown", [("/haptic_driver",), ("/left/haptic_driver", "/right/haptic_driver")])
def test_a_node_that_runs_in_other_namespaces_only_is_named_as_soon_as_one_would_be_found_where_it_is_looked_for(
    seconds, shown
):
    began = time.monotonic()
    sentence = f"^haptic_driver offers no ~/list_parameters in /haptic; there is {', '.join(shown)}; see --namespace$"
    with pytest.raises(ValueError, match=sentence):
        parameters._asked(Unanswered("/haptic/haptic_viewer", *shown), list_parameters("haptic_driver"))
    assert 2 * SHORT <= time.monotonic() - began < 1.0


def test_a_node_that_runs_where_it_is_looked_for_or_nowhere_has_no_namesake():
    both = Unanswered("/haptic/haptic_driver", "/left/haptic_driver")
    assert both.namesakes("haptic_driver") == both.namesakes("/left/haptic_driver") == both.namesakes("nobody") == ""
    assert both.namesakes("/right/haptic_driver").startswith("there is /haptic/haptic_driver, /left/haptic_driver;")


@pytest.mark.parametrize("everywhere", [False, True])
@pytest.mark.parametrize("shown", ["/left/haptic_driver", "/haptic/haptic_simulation"])
def test_a_status_is_empty_only_where_no_node_runs(everywhere, shown):
    (entry,) = newest(Unanswered(shown, "/haptic/haptic_status"), everywhere).items()
    assert entry == ("/haptic", {"level": 3, "message": f"nothing is heard; there is {shown}", "values": {}})
    assert newest(Unanswered("/haptic/haptic_status", "/talker"), everywhere) == {}


def test_who_announces_itself_after_two_seconds_is_waited_for_and_nobody_for_five(monkeypatch):
    monkeypatch.setattr(status, "LISTENING", SHORT)
    monkeypatch.setattr(status, "SILENCE", 4 * SHORT)
    late, began = Unanswered(), time.monotonic()
    late.look = lambda: time.monotonic() > began + 2 * SHORT and late.shown.append(("haptic_driver", "/left"))
    assert "/haptic" in _listen(late, True)
    assert time.monotonic() - began >= 2 * SHORT
    assert _listen(Unanswered(), True) == {}
