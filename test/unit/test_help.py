# SPDX-License-Identifier: Apache-2.0
"""What `haptic COMMAND --help` and docs/reference/cli.md say of a command is all that there is to it."""

import importlib
import inspect
import subprocess
import sys
import typing
from importlib.metadata import version
from pathlib import Path

import pytest
import typer
from in_process import haptic

from haptic_sim.cli.main import COMMANDS

PAGE = (Path(__file__).parents[2] / "docs/reference/cli.md").read_text(encoding="utf-8")


def functions():
    """{words of a command: its function}, with those of a group one by one."""
    found = {}
    for name, (place, _) in COMMANDS.items():
        module, attribute = place.split(":")
        command = getattr(importlib.import_module(module), attribute)
        if isinstance(command, typer.Typer):
            each = command.registered_commands
            found |= {f"{name} {one.name or one.callback.__name__}": one.callback for one in each}
        else:
            found[name] = command
    return found


FUNCTIONS = functions()


def function(name):
    return FUNCTIONS[name]


def told(name):
    """(name, what typer knows of it) of each argument of a command."""
    hints = typing.get_type_hints(function(name), include_extras=True)
    there = (argument for argument in inspect.signature(function(name)).parameters if argument != "context")
    return [(argument, hints[argument].__metadata__[0]) for argument in there]


def squeezed(text):
    """Without what a terminal's width adds."""
    return "".join(text.split())


PAGES = ["", "device", *FUNCTIONS]


@pytest.mark.parametrize("name", PAGES)
def test_help_of_every_command_fits_into_eighty_columns(name, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    lines = haptic(*name.split(), "--help").stdout.splitlines()
    assert lines and max(map(len, lines)) <= 80


@pytest.mark.parametrize("name", PAGES)
def test_h_is_help(name):
    assert haptic(*name.split(), "-h").stdout == haptic(*name.split(), "--help").stdout


def test_help_of_haptic_lists_each_command_with_a_whole_sentence_and_imports_none():
    shown = " ".join(haptic("-h").stdout.split())
    assert all(f"{name} {what}" in shown and what.endswith(".") for name, (_, what) in COMMANDS.items())
    code = "import sys; sys.argv[1:] = ['-h']; from haptic_sim.cli.main import main\n"
    code += "try: main()\nexcept SystemExit: print([m for m in ('numpy', 'haptic_sim.cli.demo') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "[]", done


def test_version_is_that_of_the_package():
    done = haptic("--version")
    assert (done.returncode, done.stdout) == (0, f"haptic_display {version('haptic_display')}\n")


def test_a_command_that_is_none_is_refused_with_the_nearest():
    done = haptic("dmeo")
    assert done.returncode == 2 and "No such command 'dmeo'. Did you mean 'demo'?" in done.stderr
    assert haptic("nonsense").returncode == 2


def test_haptic_alone_says_what_there_is_and_where_to_begin():
    done = haptic()
    assert "Begin with: haptic demo --view" in done.stdout + done.stderr


@pytest.mark.parametrize("name", FUNCTIONS)
def test_help_keeps_every_word_of_every_option_its_units_in_brackets_too(name):
    shown = squeezed(haptic(*name.split(), "--help").stdout)
    for _, option in told(name):
        assert squeezed(option.help) in shown


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_page_of_commands_has_each_command_with_each_option(name):
    sections = [part for part in PAGE.split("\n## ") if f"`haptic {name}`" in part.splitlines()[0]]
    assert len(sections) == 1
    kind = {argument: option for argument, option in told(name) if type(option).__name__ == "OptionInfo"}
    for argument, option in kind.items():
        named = (name for name in (option.default, *(option.param_decls or ())) if str(name).startswith("--"))
        flag = next(named, f"--{argument.replace('_', '-')}")
        assert f"`{flag}" in sections[0], flag
