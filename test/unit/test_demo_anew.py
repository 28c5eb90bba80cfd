# SPDX-License-Identifier: Apache-2.0
"""What `haptic demo` does and says where its driver falls into a fault, with nodes and runs that the test makes up."""

import json

import pytest

from haptic_device.config.files import find
from haptic_display.cli import demo
from haptic_display.run.follow import Ending
from haptic_display.run.system import Order

SILENT = Ending("the motion did not begin: …", "device_silent", True, False)
WITHHELD = Ending("no motor command came: waiting for a small force; force withheld for …", "", False, False)
FELL = "Device does not answer (fault device_silent): the device did not answer for longer than fault.silence"
WELL = Ending("", "", True, True)


class Nodes:
    """Nodes that do nothing but leave a bag."""

    def __init__(self, logs):
        logs.mkdir(parents=True, exist_ok=True)
        (logs.parent / "bag").mkdir()

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        pass

    def start(self, program):
        pass


@pytest.fixture
def ran(monkeypatch, tmp_path, capsys):
    """ran(endings, params, as_json) runs a demo whose starts end so, as far as there are starts: whether it was done,
    its JSON object or its table, what it said, and the endings that are left."""

    def run(*endings, params="demo", as_json=True):
        left = list(endings)
        monkeypatch.setattr(demo, "Nodes", Nodes)
        monkeypatch.setattr(demo, "prepare", lambda programs: None)
        monkeypatch.setattr(demo, "_follow", lambda seconds, domain, nodes: left.pop(0))
        figures = {"exchange": {"sent": 1000, "answered": 1000}}
        monkeypatch.setattr(demo, "_evaluate", lambda order, started: figures)
        order = Order("free_space", None, tmp_path / "run", None, None, find("", params).absolute())
        done = demo.run(order, 0.0, as_json)
        said = capsys.readouterr()
        return done, json.loads(said.out) if as_json else said.out, said.err, left

    return run


def test_a_device_that_fell_silent_before_the_motion_is_said_and_the_demo_begins_anew_once(ran, tmp_path):
    done, found, said, left = ran(SILENT, WELL)
    assert done and found["done"] and found["why"] == "" and not left
    kept = tmp_path / "run" / "first_start"
    assert f"haptic demo: {FELL}; all nodes are started anew, and {kept} keeps this start\n" in said
    assert all((folder / name).is_dir() for folder in (kept, tmp_path / "run") for name in ("bag", "log"))


@pytest.mark.parametrize(("params", "silence"), [("demo", "0.02"), ("test/busy.yaml", "1")])
def test_a_device_that_fell_silent_twice_is_said_with_the_limit_and_what_to_do(ran, params, silence):
    done, found, said, _ = ran(SILENT, SILENT, params=params)
    busy = f"the machine was too busy to serve the device for fault.silence = {silence} s"
    todo = "end what else keeps the machine busy, take a lower --rate, or write a longer fault.silence into --params"
    assert not done and not found["done"] and found["why"] == f"{FELL} again: {busy}; {todo}"
    assert said.endswith(f"haptic demo: {found['why']}\n")


@pytest.mark.parametrize("as_json", [True, False])
def test_a_driver_that_never_gives_force_is_the_cause_that_is_said_once_and_the_recording_is_kept(
    ran, tmp_path, as_json
):
    done, found, said, left = ran(WITHHELD, as_json=as_json)
    assert not done and not left and (tmp_path / "run" / "bag").is_dir()
    assert said.count(WITHHELD.why) == 1
    assert not as_json or (found["why"], found["bag"]) == (WITHHELD.why, str(tmp_path / "run" / "bag"))


@pytest.mark.parametrize(
    "ending",
    [
        WELL,
        SILENT._replace(begun=True),
        SILENT._replace(fault="velocity"),
        SILENT._replace(fault="estop", commanded=False),
        SILENT._replace(fault=""),
    ],
)
def test_a_demo_that_ended_in_any_other_way_does_not_begin_anew(ran, ending):
    done, found, _, left = ran(ending, WELL)
    assert left == [WELL] and found["why"] == ending.why and done == (not ending.why)
