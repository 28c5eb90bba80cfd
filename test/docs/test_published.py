# SPDX-License-Identifier: Apache-2.0
"""Published results: what a source may say, when ours agrees, the table and its page."""

from pathlib import Path

import pytest
from in_process import bench

from bench.published import table
from bench.published.source import Result, agrees
from haptic_device.config.files import ConfigError

PAGE = Path(__file__).parents[2] / "docs" / "benchmarks" / "published.md"
GIL = (table.FOLDER / "gil_2009.yaml").read_text(encoding="utf-8")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder of sources, which the command then reads."""
    monkeypatch.setattr(table, "FOLDER", tmp_path)
    return tmp_path


def written(folder, text):
    path = folder / "one.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def without_ours(line):
    """A line of the page; a row of the table without our value, whose last digits are those of the machine."""
    cells = line.split(" | ")
    return [*cells[:3], *cells[4:]] if line.startswith("| [") else line


def test_all_results_are_kept_and_the_page_shows_them():
    sources = table.sources(table.FOLDER)
    assert {result.ours for source in sources.values() for result in source.results} == set(table.OURS)
    rows = table.computed(sources)
    assert len(rows) >= 12
    assert [f"{table.short(row.source)}: {row.result.quantity}, {row.ours}" for row in rows if not row.kept] == []
    shown, made = PAGE.read_text(encoding="utf-8").splitlines(), table.page(rows).splitlines()
    assert list(map(without_ours, shown)) == list(map(without_ours, made))


def test_the_command_prints_the_table_and_writes_the_page(folder, tmp_path, monkeypatch):
    written(folder, GIL)
    (folder / "head.md").write_text("# Head\n", encoding="utf-8")
    done = bench("published", "--out", tmp_path / "page.md")
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert page.startswith("# Head\n") and done.stdout.strip() in page
    assert "### Gil, Sánchez, Hulin, Preusche and Hirzinger 2009" in page


def test_a_wrong_number_fails_the_table_and_writes_no_page(folder, tmp_path):
    written(folder, GIL.replace("published: [1.0,", "published: [1.02,"))
    done = bench("published", "--out", tmp_path / "page.md")
    assert done.returncode == 1
    assert "**left**" in done.stdout
    assert done.stderr.strip() == (
        "bench: 1 of 1 published results out of tolerance: Gil, Sánchez, Hulin, Preusche and Hirzinger 2009, "
        "exact largest stable stiffness divided by (b + B)/(T/2 + delay), six loops"
    )
    assert not (tmp_path / "page.md").exists()


OF_SOURCE = [  # what is changed in a source, into what, and what is said of it
    ("    tolerance: 0.01", "    tolerance: 0.01\n    tolerence: 0.01", "'tolerence'"),
    ("kind: exact", "kind: roughly", "it should be 'exact', 'shape' or 'order'"),
    ("tolerance: 0.01", "tolerance: 0", "it should be greater than 0"),
    ("kind: exact", "kind: order", "is an order; it must have `order` with two names"),
    ("address: https:", "address: file:", "it must begin with https:// or http://"),
    ("gil_2009.boundary", "os.system", "ours is 'os.system'; it must be one of abbott_okamura_2005.damping"),
]
KIND = "kind: exact\n    published: [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]"
OF_OURS = [  # the same, where it does not fit what we compute
    ("published: [1.0,", "published: [1.0, 1.0,", "results[0] has 7 numbers in `published`; gil_2009.boundary gives 6"),
    ("gil_2009.boundary", "diolaiti_2006.stable", "is of kind exact; diolaiti_2006.stable gives named values"),
    (
        f"ours: gil_2009.boundary\n    {KIND}",
        "ours: diolaiti_2006.stable\n    kind: order\n    order: [comes to rest, passiv]",
        "has 'passiv' in `order`; diolaiti_2006.stable gives comes to rest, passive",
    ),
]


@pytest.mark.parametrize(("old", "new", "sentence"), OF_SOURCE + OF_OURS)
def test_what_a_source_may_not_say_is_refused_in_one_sentence(folder, old, new, sentence):
    path = written(folder, GIL.replace(old, new, 1))
    with pytest.raises(ConfigError) as refused:
        table.computed(table.sources(folder))
    assert str(refused.value).startswith(f"{path}: ") and sentence in str(refused.value)
    assert "\n" not in str(refused.value)
    assert bench("published").returncode == 1


@pytest.mark.parametrize(
    ("kind", "tolerance", "kept", "left"),
    [
        ("exact", 0.02, (0.981, 1.019), (0.979, 1.021)),  # of 1: a share of the published value
        ("shape", 2.0, (0.505, 1.995), (0.495, 2.005)),  # a factor
        ("order", 0.2, (0.79, 0.66), (0.81, 0.6)),  # between 1 and 0.5: it falls by a share at each step
    ],
)
def test_a_result_is_kept_within_its_tolerance_and_not_beyond(kind, tolerance, kept, left):
    told = {"order": ("a", "b", "c")} if kind == "order" else {"published": (3.0, 1.0)}
    result = Result(quantity="q", ours="o", kind=kind, tolerance=tolerance, **told)
    for value in (*kept, *left):
        ours = {"a": 1.0, "b": value, "c": 0.5} if kind == "order" else [3.0, value]
        assert agrees(result, ours) is (value in kept)
