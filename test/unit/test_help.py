# SPDX-License-Identifier: Apache-2.0
"""What `haptic COMMAND --help` and docs/reference/cli.md say of a command is all that there is to it."""

import importlib
import inspect
import re
import subprocess
import sys
import typing
from importlib.metadata import version
from pathlib import Path

import typer
from in_process import haptic

from haptic_display.cli.main import COMMANDS, PANELS

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


def told(name):
    """(name, what typer knows of it) of each argument of a command."""
    hints = typing.get_type_hints(FUNCTIONS[name], include_extras=True)
    there = (argument for argument in inspect.signature(FUNCTIONS[name]).parameters if argument != "context")
    return [(argument, hints[argument].__metadata__[0]) for argument in there]


def squeezed(text):
    """Without what a terminal's width adds."""
    return "".join(text.split())


def test_help_of_every_command_keeps_every_word_of_every_option_in_eighty_columns_and_h_is_help(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    for name in ["", "device", *FUNCTIONS]:
        shown = haptic(*name.split(), "--help").stdout
        assert shown
        assert max(map(len, shown.splitlines())) <= 80
        for _, option in told(name) if name in FUNCTIONS else ():
            assert squeezed(option.help) in squeezed(shown), name
    assert haptic("demo", "-h").stdout == haptic("demo", "--help").stdout


def test_help_of_haptic_lists_each_command_with_a_whole_sentence_and_imports_none():
    shown = " ".join(haptic("-h").stdout.split())
    assert all(f"{name} {what}" in shown and what.endswith(".") for name, (_, what) in COMMANDS.items())
    code = "import sys; sys.argv[1:] = ['-h']; from haptic_display.cli.main import main\n"
    code += (
        "try: main()\nexcept SystemExit: print([m for m in ('numpy', 'haptic_display.cli.demo') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "[]", done


def test_help_of_haptic_lists_the_commands_by_their_job():
    listed = [line.split()[0] for line in haptic("-h").stdout.splitlines() if line.startswith("  ")]
    assert [name for name in listed if name in COMMANDS] == [*COMMANDS]
    shown, names = haptic("-h").stdout, [*COMMANDS]
    for first, panel in PANELS.items():
        assert f"\n{panel}:\n  {first} " in shown
    jobs = re.findall(r"^\| ([a-z ]+) \| (\[`.*) \|$", PAGE, re.MULTILINE)
    assert [job.capitalize() for job, _ in jobs] == [*PANELS.values()]
    assert [name for _, told in jobs for name in re.findall(r"`(\w+)`", told)] == names


def test_version_is_that_of_the_package():
    done = haptic("--version")
    assert (done.returncode, done.stdout) == (0, f"haptic_display {version('haptic_display')}\n")


def test_a_command_that_is_none_is_refused_with_the_nearest_and_none_at_all_says_where_to_begin():
    done = haptic("dmeo")
    assert done.returncode == 2
    assert "No such command 'dmeo'. Did you mean 'demo'?" in done.stderr
    assert haptic("nonsense").returncode == 2
    done = haptic()
    assert "Begin with: haptic demo --view" in done.stdout + done.stderr


def test_the_page_of_commands_has_each_command_with_each_option():
    for name in FUNCTIONS:
        [section] = [part for part in PAGE.split("\n## ") if f"`haptic {name}`" in part.splitlines()[0]]
        for argument, option in told(name):
            if type(option).__name__ == "OptionInfo":
                named = [one for one in (option.default, *(option.param_decls or ())) if str(one).startswith("--")]
                flag = (*named, f"--{argument.replace('_', '-')}")[0]
                assert f"`{flag}" in section, (name, flag)
