# SPDX-License-Identifier: Apache-2.0
"""What `haptic COMMAND --help` and docs/cli.md say of a command is all that there is to it."""

import importlib
import inspect
import typing
from pathlib import Path

import pytest
import typer
from in_process import haptic

from haptic_sim.cli.main import COMMANDS

PAGE = (Path(__file__).parents[2] / "docs/cli.md").read_text(encoding="utf-8")


def functions():
    """{words of a command: its function}, with those of a group one by one."""
    found = {}
    for name, place in COMMANDS.items():
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
