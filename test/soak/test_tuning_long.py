# SPDX-License-Identifier: Apache-2.0
"""Tools that take their time, on a driver and a loopback of their own: `haptic zwidth --live`, `haptic identify`."""

import contextlib
import json
import signal
import subprocess
import time

import pytest
import typer
import yaml
from live_demo import HAPTIC
from typer.testing import CliRunner
from waiting import output, until

from haptic_device.config.description import load_device
from haptic_device.config.files import find
from haptic_display.cli.identify import identify
from haptic_display.device_tools.pair import on_pair, running
from haptic_display.device_tools.tuning import Tuning

pytestmark = pytest.mark.timeout(900)

GAINS = ("wall.normals", "wall.offsets", "wall.stiffness", "wall.damping", "passivity.policy", "coupling.stiffness")
PATIENT = {"servo.rate": 1000.0, "fault.silence": 1.0, "fault.unattended": 0.0}
PAIR = PATIENT, {"device": "desktop", "motion.name": "follow", "motor_watchdog": 2.0}


@pytest.fixture
def pair():
    """(tuning, domain, namespace) of driver and loopback with a hand that follows, engaged.

    No fault if the machine holds them up for a second."""
    with (
        running(None, None, *PAIR) as (domain, namespace, check),
        contextlib.closing(Tuning(domain, namespace)) as tuning,
    ):
        tuning.wait_engaged(check)
        yield tuning, domain, namespace


def test_a_tool_whose_own_driver_falls_into_a_fault_goes_on_with_a_new_pair(capsys, monkeypatch):
    monkeypatch.delenv("ROS_DOMAIN_ID")  # a pair of its own has a domain of its own
    domains = []

    def work(domain, namespace, check):
        domains.append(domain)
        with contextlib.closing(Tuning(domain, namespace)) as tuning:
            tuning.wait_engaged(check)
            if len(domains) == 1:
                tuning.trigger("estop")
            tuning.watch(1.0)
            return tuning.said("state")

    assert on_pair(None, None, *PAIR, work) == "engaged" and len(domains) == 2
    fell = "Emergency stop (fault estop): a person or a program pressed stop; both nodes are started anew"
    assert capsys.readouterr().err.splitlines() == [fell]


def test_zwidth_live_interrupted_at_a_wall_leaves_the_gains_as_found(pair, start):
    tuning, domain, namespace = pair
    before = tuning.get(GAINS)
    words = ["zwidth", "--live", "--device", "desktop", "--domain", domain, "--namespace", namespace]
    process = start([*HAPTIC, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE)

    def at_a_wall():
        assert process.poll() is None, process.communicate()
        return tuning.get(["wall.stiffness"]) != {"wall.stiffness": ()}

    until(at_a_wall, "a wall", look=lambda: time.sleep(0.05))
    process.send_signal(signal.SIGINT)
    said, complained = output(process)
    assert (said, process.returncode) == ("", 130)
    # before it, that kernels were compiled, if they were
    assert complained.splitlines()[-1] == "haptic zwidth: interrupted; the gains are as they were", complained
    assert tuning.get(GAINS) == before


def test_identify_writes_what_it_found_of_a_live_device_and_tells_it_from_the_one_that_the_driver_was_told(
    tmp_path, monkeypatch
):
    monkeypatch.delenv("ROS_DOMAIN_ID")  # a pair of its own needs a domain of its own
    content = yaml.safe_load(find("devices", "desktop").read_text())
    for axis in content["axes"][:2]:
        axis |= {"mass": 0.15, "damping": 2.0, "coulomb": 0.05}
    content["axes"][2] |= {"mass": 0.00015, "damping": 0.003, "coulomb": 0.0003}
    (tmp_path / "other.yaml").write_text(yaml.safe_dump(content | {"actuation_delay": 0.0005}))
    app = typer.Typer()
    app.command()(identify)
    words = ["--loopback", tmp_path / "other.yaml", "--out", tmp_path / "found.yaml", "--seconds", 4, "--rate", 1000]
    result = CliRunner().invoke(app, [*map(str, words), "--json"])
    assert result.exit_code == 0, result.stderr
    axes, written = json.loads(result.stdout)["axes"], load_device(str(tmp_path / "found.yaml"))
    told, true = load_device("desktop"), load_device(str(tmp_path / "other.yaml"))
    for had, has, axis in zip(told.axes, true.axes, written.axes, strict=True):
        assert abs(axis.mass - has.mass) < abs(axis.mass - had.mass)
        assert axis.mass == pytest.approx(axes[axis.name]["mass"][0], abs=1e-9)
        assert axis.damping == pytest.approx(max(0.0, axes[axis.name]["damping"][0]), abs=1e-9)
