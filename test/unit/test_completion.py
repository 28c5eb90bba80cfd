# SPDX-License-Identifier: Apache-2.0
"""What a shell completes of a `haptic` line."""

import pytest
from in_process import haptic

from haptic_device.config.files import names
from haptic_device.config.parameters import EXCHANGE_METHODS
from haptic_display.cli.completion import COMPLETING
from haptic_display.cli.main import COMMANDS
from haptic_sim.node.parameters import NODES


@pytest.fixture
def completed(monkeypatch):
    """completed(line): what bash is offered for the last word of it."""

    def ask(line):
        monkeypatch.setenv("COMP_WORDS", line)
        monkeypatch.setenv("COMP_CWORD", str(len(line.split()) - (not line.endswith(" "))))
        monkeypatch.setenv(COMPLETING, "complete_bash")
        return haptic().stdout.split()

    return ask


def live(node, live=True):
    return {each.name for each in NODES[node] if each.live or not live}


def test_the_commands_are_offered_and_those_that_begin_so(completed):
    assert set(completed("haptic ")) == set(COMMANDS)
    assert completed("haptic rec") == ["record"]
    assert set(completed("haptic device ")) == {"find", "show", "kinematics", "set-up", "test"}


def test_names_and_options_are_offered(completed):
    for line, offered in (
        ("demo --scene ", set(names("scenes"))),
        ("demo --scene peg_w", {"peg_wedged"}),
        ("demo --params ", set(names(""))),
        ("demo --device ", set(names("devices"))),
        ("demo --exchange ", set(EXCHANGE_METHODS)),
        ("demo --sce", {"--scene"}),
        ("scenes --explain wal", {"wall"}),
        ("check wal", set()),
        ("check --verify wal", {"wall"}),
        ("zwidth --device desk", {"desktop"}),
        ("device test desk", {"desktop"}),
        ("device kinematics hap", {"haply_2diy_gen2", "haply_2diy_gen3", "hapkit"}),
        ("compare bag demo mo", {name for name in names("") if name.startswith("mo")}),
        ("get ", set(NODES)),
        ("get haptic_driver servo.", {name for name in live("haptic_driver", False) if name.startswith("servo.")}),
        ("set haptic_driver ", live("haptic_driver")),
        ("set nobody ", set()),
    ):
        assert set(completed(f"haptic {line}")) == offered


def test_the_script_of_a_shell_asks_haptic(monkeypatch):
    for shell in ("bash", "zsh", "fish"):
        monkeypatch.setenv(COMPLETING, f"source_{shell}")
        assert f"{COMPLETING}=complete_{shell}" in haptic().stdout
