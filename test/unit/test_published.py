# SPDX-License-Identifier: Apache-2.0
"""Published results: what a source may say, when ours agrees, the table and its page; python-control as oracle."""

import re
from pathlib import Path

import control
import numpy as np
import pytest
from examples import few
from hypothesis import given
from hypothesis import strategies as st
from in_process import bench

from bench.published import table
from bench.published.source import Result, agrees
from haptic_device.analysis.coupling_damping import least_damping_for_any_simulation
from haptic_device.analysis.passivity import least_damping
from haptic_device.analysis.stability import held_plant, largest_stable_stiffness
from haptic_device.analysis.transfer import wall_transfer
from haptic_device.config_files import ConfigError

PAGE = Path(__file__).parents[2] / "docs" / "benchmarks" / "published.md"
GIL = (table.FOLDER / "gil_2009.yaml").read_text(encoding="utf-8")
MASS, PHYSICAL_DAMPING, DAMPING = st.floats(0.02, 1.0), st.floats(0.05, 3.0), st.floats(0.0, 3.0)
PERIOD, DELAY = st.sampled_from([2e-4, 1e-3, 5e-3]), st.integers(0, 3)


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
    assert {result.ours for source in table.sources(table.FOLDER) for result in source.results} == set(table.OURS)


def test_the_page_is_in_short_sentences():
    """At most three of more than 28 words, none of more than 40."""
    prose = re.sub(r"^(\|.*|#.*|<.*>)$|^.*\*.*\*\..*$", "", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    lengths = [len(sentence.split()) for sentence in re.split(r"[.:]\s|\n\n", prose)]
    assert max(lengths) <= 40
    assert sum(length > 28 for length in lengths) <= 3


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
        "exact largest stable stiffness over (b + B)/(T/2 + delay), six loops"
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


def test_as_many_numbers_are_compared_as_were_published():
    with pytest.raises(ValueError):
        agrees(Result(quantity="q", ours="o", kind="exact", tolerance=1.0, published=(1.0, 1.0)), [1.0])


@few(20)
@given(MASS, PHYSICAL_DAMPING, PERIOD)
def test_the_held_plant_is_that_of_python_control(mass, physical_damping, period):
    theirs = control.c2d(control.tf([1.0], [mass, physical_damping, 0.0]), period, "zoh")
    z = np.exp(1j * np.linspace(0.3, 3.0, 7))
    np.testing.assert_allclose(held_plant(mass, physical_damping, period)(z), theirs(z), rtol=1e-6)


@few(20)
@given(MASS, PHYSICAL_DAMPING, DAMPING, PERIOD, DELAY)
def test_loops_of_python_control_are_stable_just_below_our_boundary_and_unstable_just_above(
    mass, physical_damping, damping, period, delay
):
    boundary = largest_stable_stiffness(mass, physical_damping, damping, period, delay)
    plant = control.c2d(control.tf([1.0], [mass, physical_damping, 0.0]), period, "zoh")
    late = control.tf([1.0], [1.0, *np.zeros(delay)], period)

    def radius(stiffness):
        viscous = damping / period
        wall = control.tf([stiffness + viscous, -viscous], [1.0, 0.0], period)
        return np.abs(control.feedback(plant, wall * late).poles()).max()

    if boundary > 0.0:
        assert radius(0.99 * boundary) < 1.0
    assert radius(1.01 * boundary + 1e-3 * mass / period**2) > 1.0


@few(20)
@given(st.floats(10.0, 1e5), st.floats(-5.0, 5.0), PERIOD, st.sampled_from([0.0, 1e-3, 1e-2]))
def test_no_frequency_response_of_python_control_asks_for_more_damping_than_condition_1(
    stiffness, damping, period, lag
):
    share = period / (period + lag)
    theirs = control.tf([stiffness], [1.0], period) + control.tf(
        np.array([1.0, -1.0]) * damping * share / period, [1.0, share - 1.0], period
    )
    angle = np.geomspace(1e-4, np.pi, 4001)
    held = (1.0 - np.exp(-1j * angle)) * theirs(np.exp(1j * angle))
    asked = 0.5 * period * held.real / (1.0 - np.cos(angle))
    ours = float(least_damping(wall_transfer(stiffness, damping, period, lag), period).damping)
    assert asked.max() == pytest.approx(ours, rel=1e-3)
    assert asked.max() <= ours * (1.0 + 1e-6)


@few(20)
@given(st.floats(10.0, 1e5), st.floats(-0.4, 3.0), PERIOD)
def test_llewellyns_criterion_with_python_control_asks_for_our_bound_of_a_coupling(stiffness, share, period):
    """share: B/(KT)."""
    damping = share * stiffness * period
    viscous = damping / period
    coupling = control.tf([stiffness + viscous, -viscous], [1.0, 0.0], period)
    admittance = control.tf([1.0, -1.0], [period, 0.0], period) / coupling
    z = np.exp(1j * np.linspace(1e-3, np.pi, 4001))
    transmitted = -1.0 / z
    asked = (np.abs(transmitted) + transmitted.real) / (2.0 * admittance(z).real)
    ours = float(least_damping_for_any_simulation(wall_transfer(stiffness, damping, period), period).damping)
    assert asked.max() == pytest.approx(ours, rel=1e-3)
