# SPDX-License-Identifier: Apache-2.0
"""Published results: what a source may say, when ours agrees, the table and its page."""

from pathlib import Path

import pytest
from in_process import bench

from bench.published import choi_tan_2004, colgate_brown_1994, table
from bench.published.source import Result, agrees
from haptic_device.config_files import ConfigError

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
    rows = table.computed(table.sources(table.FOLDER))
    assert len(rows) >= 12
    assert [f"{table.short(row.source)}: {row.result.quantity}, {row.ours}" for row in rows if not row.kept] == []
    shown, made = PAGE.read_text(encoding="utf-8").splitlines(), table.page(rows).splitlines()
    assert list(map(without_ours, shown)) == list(map(without_ours, made))


def test_every_function_of_the_table_is_named_by_a_source():
    assert {result.ours for source in table.sources(table.FOLDER).values() for result in source.results} == set(
        table.OURS
    )


def test_the_clean_stiffness_rises_with_the_rate_up_to_1_khz_and_no_further():
    values = [choi_tan_2004.clean(rate) for rate in (250.0, 500.0, 1e3, 2e3, 10e3, 40e3)]
    assert values == pytest.approx([944.0, 2113.0, *[4217.0] * 4], abs=1.0)


@pytest.mark.parametrize("friction, first", [(0.05, "damping"), (0.02, "velocity filter")])
def test_damping_widens_the_range_of_walls_most_if_friction_covers_the_encoder_step(friction, first):
    widths = colgate_brown_1994.widths(friction)
    others = [widths[name] for name in widths if name != first]
    assert 0.5 * widths[first] > max(others)


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


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("    tolerance: 0.01", "    tolerance: 0.01\n    tolerence: 0.01", "'tolerence'"),
        ("kind: exact", "kind: roughly", "it should be 'exact', 'shape' or 'order'"),
        ("tolerance: 0.01", "tolerance: 0", "it should be greater than 0"),
        ("tolerance: 0.01", "tolerance: .nan", "results[0].tolerance"),
        ("kind: exact", "kind: order", "is an order; it must have `order` with two names"),
        ("kind: exact", "kind: shape", "has tolerance 0.01; a factor must be 1 or more"),
        ("    published: [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]\n", "", "must have `published` with a number at least"),
        ("address: https:", "address: file:", "it must begin with https:// or http://"),
        ("authors: J. J. Gil,", "title: twice\nauthors: J. J. Gil,", "title"),
        ("gil_2009.boundary", "os.system", "ours is 'os.system'; it must be one of abbott_okamura_2005.damping"),
    ],
)
def test_what_a_source_may_not_say_is_refused_in_one_sentence(folder, old, new, sentence):
    path = written(folder, GIL.replace(old, new, 1))
    with pytest.raises(ConfigError) as refused:
        table.sources(folder)
    assert str(refused.value).startswith(f"{path}: ") and sentence in str(refused.value)
    assert "\n" not in str(refused.value)
    assert bench("published").returncode == 1


@pytest.mark.parametrize("value, kept", [(0.981, True), (1.019, True), (0.979, False), (1.021, False)])
def test_exact_is_within_a_share_of_the_published_value(value, kept):
    result = Result(quantity="q", ours="o", kind="exact", tolerance=0.02, published=(3.0, 1.0))
    assert agrees(result, [3.0, value]) is kept


@pytest.mark.parametrize("value, kept", [(2.02, True), (7.98, True), (1.98, False), (8.02, False)])
def test_shape_is_within_a_factor(value, kept):
    assert agrees(Result(quantity="q", ours="o", kind="shape", tolerance=2.0, published=(4.0,)), [value]) is kept


@pytest.mark.parametrize("middle, kept", [(0.79, True), (0.81, False), (0.66, True), (0.6, False)])
def test_an_order_falls_by_a_share_at_each_step(middle, kept):
    result = Result(quantity="q", ours="o", kind="order", tolerance=0.2, order=("a", "b", "c"))
    assert agrees(result, {"a": 1.0, "b": middle, "c": 0.5}) is kept


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("published: [1.0, 1.0,", "published: [1.0,", "has 5 numbers in `published`; gil_2009.boundary gives 6"),
        ("published: [1.0,", "published: [1.0, 1.0,", "has 7 numbers in `published`; gil_2009.boundary gives 6"),
        ("gil_2009.boundary", "diolaiti_2006.stable", "is of kind exact; diolaiti_2006.stable gives named values"),
        (
            "kind: exact\n    published: [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]",
            "kind: order\n    order: [long, short]",
            "has 'long' in `order`; gil_2009.boundary gives numbers without names",
        ),
        (
            "ours: gil_2009.boundary\n    kind: exact\n    published: [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]",
            "ours: diolaiti_2006.stable\n    kind: order\n    order: [comes to rest, passiv]",
            "has 'passiv' in `order`; diolaiti_2006.stable gives comes to rest, passive",
        ),
    ],
)
def test_what_cannot_be_compared_with_ours_is_refused_in_one_sentence(folder, old, new, sentence):
    path = written(folder, GIL.replace(old, new, 1))
    with pytest.raises(ConfigError) as refused:
        table.computed(table.sources(folder))
    assert str(refused.value).startswith(f"{path}: results[0] {sentence}")
    assert "\n" not in str(refused.value)
    assert bench("published").returncode == 1
