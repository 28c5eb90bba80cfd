# SPDX-License-Identifier: Apache-2.0
"""The reference of the Python API names what is there, explains each field and argument, and its examples run."""

import doctest
import importlib
import inspect
import re
from dataclasses import is_dataclass
from pathlib import Path
from typing import Literal, get_origin

import pytest

API = Path(__file__).parents[2] / "docs/reference/api"
PAGES = sorted(page for page in API.glob("*.md") if page.name != "README.md")
NAMES = [name for page in PAGES for name in re.findall(r"^::: (\S+)$", page.read_text("utf-8"), re.MULTILINE)]
MAKER = "haptic_sim.lockstep.lockstep_bag.LockstepBag"  # its example makes the bag that others read
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def resolved(name):
    """What a dotted name stands for: a member of a module."""
    module, _, member = name.rpartition(".")
    return getattr(importlib.import_module(module), member)


CLASSES = [one for one in map(resolved, NAMES) if inspect.isclass(one)]


def ours(kind):
    """A class and its bases, those of libraries left out."""
    return [base for base in kind.__mro__ if base.__module__.startswith("haptic_")]


def makes_itself(kind):
    """Whether a class is made of arguments that are not its fields."""
    other = is_dataclass(kind) or issubclass(kind, Exception) or getattr(kind, "_is_protocol", False)
    return "__init__" in vars(kind) and not other


def listed(one, section):
    """Names in a section of a docstring, in their order."""
    text = inspect.getdoc(one).partition(f"\n{section}:\n")[2].partition("\n\n")[0]
    return re.findall(r"^    (\w+)(?: \(.*?\))?: ", text, re.MULTILINE)


def names_it(text, word):
    return re.search(rf"(?<![\w.]){re.escape(word)}(?!\w)", text or "") is not None


def failures(text, name):
    """What the examples print that does not stand there; there has to be an example."""
    test, said = doctest.DocTestParser().get_doctest(text, {"__name__": "__main__"}, name, None, 0), []
    assert test.examples, f"{name} has no example"
    doctest.DocTestRunner(optionflags=FLAGS).run(test, out=said.append)
    return "".join(said)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The folder `run` with the bag that the example of MAKER makes."""
    with pytest.MonkeyPatch.context() as here:
        here.chdir(folder := tmp_path_factory.mktemp("api"))
        assert failures(inspect.getdoc(resolved(MAKER)), MAKER) == ""
    return folder / "run"


def test_each_name_and_each_page_stands_in_the_reference_once():
    found = re.findall(r"^\| \[\w+\]\((\w+\.md)\)", (API / "README.md").read_text("utf-8"), re.MULTILINE)
    assert sorted(found) == [page.name for page in PAGES]
    assert len(NAMES) == len(set(NAMES)) > 100


def test_every_example_of_docstrings_and_pages_prints_what_stands_there(run, tmp_path, monkeypatch):
    examples = [(name, inspect.getdoc(resolved(name))) for name in NAMES if name != MAKER]
    blocks = r"^```pycon\n(.*?)^```$"
    for page in PAGES:
        found = re.findall(blocks, page.read_text("utf-8"), re.MULTILINE | re.DOTALL)
        examples += [(page.name, block) for block in found]
    wrong = []
    for number, (name, text) in enumerate(examples):
        (folder := tmp_path / f"{number}").mkdir()
        (folder / "run").symlink_to(run)
        monkeypatch.chdir(folder)
        wrong += [said for said in [failures(text, name)] if said]
    assert wrong == []


def test_an_example_that_prints_something_else_is_found_and_so_is_a_docstring_without_any():
    assert failures(">>> 1 + 1\n2\n", "right") == ""
    assert "Expected" in failures(">>> 1 + 1\n3\n", "wrong")
    with pytest.raises(AssertionError, match="empty has no example"):
        failures("Says nothing.", "empty")


def test_a_docstring_explains_the_arguments_in_their_order():
    functions = {name: one for name in NAMES if not inspect.isclass(one := resolved(name))}
    made = {name: one for name in NAMES if (one := resolved(name)) in CLASSES and makes_itself(one)}
    assert len(functions) > 50 and len(made) > 3
    given = {name: list(inspect.signature(one).parameters) for name, one in {**functions, **made}.items()}
    assert {name: listed(resolved(name), "Args") for name in given} == given


def test_a_docstring_names_each_field_of_its_class_and_no_attribute_that_is_gone():
    wrong = []
    for kind in CLASSES:
        text = "\n".join(inspect.getdoc(base) or "" for base in ours(kind))
        fields = {name for base in ours(kind) for name in inspect.get_annotations(base)}
        source = "".join(map(inspect.getsource, ours(kind)))
        for name, hint in inspect.get_annotations(kind).items():
            said = name.startswith("_") or get_origin(hint) is Literal or "ClassVar" in str(hint)
            wrong += [] if said or names_it(text, name) else [f"{kind.__name__}.{name} is not named"]
        for name in listed(kind, "Attributes"):
            wrong += [] if name in fields or f"self.{name}" in source else [f"{kind.__name__}.{name} is gone"]
    assert wrong == []
