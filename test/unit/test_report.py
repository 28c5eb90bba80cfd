# SPDX-License-Identifier: Apache-2.0
"""The report of good and of bad recordings: one page that needs nothing else, and says what it could not show."""

import contextlib
import re
from functools import partial

import numpy as np
import pytest
import typer
from bag_of_a_run import (
    BOOT_TO_EPOCH,
    PERIOD_NS,
    cloud,
    diagnostics,
    joints,
    string,
    swing,
    write_bag,
    write_run,
)
from matplotlib import pyplot
from matplotlib.image import imread
from matplotlib.text import Text
from mcap.reader import make_reader

from haptic_device.control import withheld
from haptic_device.recording import load
from haptic_device.recording.layouts import (
    CLOUD,
    DIAGNOSTICS,
    JOINTS,
    STRING,
    WRENCH,
    CloudLayout,
    StampedLayout,
    wrench_numbers,
)
from haptic_device.recording.writer import Bag
from haptic_device.theory.palette import RUNS
from haptic_display.cli.report import report
from haptic_display.cli.tables import compared
from haptic_display.run.report import curves, figures, quantities, summary
from haptic_display.run.report import page as pages
from haptic_display.run.report.figures import FIGURES
from haptic_display.run.report.page import write_report
from haptic_display.run.report.picture import DPI, SIZE, draw_picture
from haptic_display.run.report.quantities import sections
from haptic_display.run.report.reading import read_run
from haptic_display.run.report.run import Run
from haptic_display.run.report.verdict import WARN, verdict
from haptic_sim.scene.draw import draw
from haptic_sim.scene.language import load as scene_of

TICKS = 8000
TOLD = [figure for figure in FIGURES if figure.name != "margin"]  # of which no driver says the damping here


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    """Figures with few pixels, of which most tests look at none; `page` is made once, with all of them."""
    monkeypatch.setattr(figures, "DPI", 20)


@pytest.fixture
def one_figure(monkeypatch):
    """Pages of which the test looks at the words."""
    monkeypatch.setattr(pages, "FIGURES", FIGURES[:1])


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bags")
    rows = swing(TICKS)
    rows["tool_contact"][2000:5000] = 1
    shaking = rows.copy()
    shaking["force_on_handle"][:, 0] += 0.5 * np.sin(2 * np.pi * 80.0 * np.arange(TICKS) * PERIOD_NS * 1e-9)
    return write_run(folder / "calm", rows), write_run(folder / "shaking", shaking)


@pytest.fixture(scope="module")
def page(bags, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    return write_report([read_run(bag) for bag in bags], folder)


def test_the_page_of_two_runs_holds_every_figure_what_they_share_and_when_they_began_and_needs_no_network(bags, page):
    text, run = page.read_text(encoding="utf-8"), read_run(bags[0])
    assert text.count("data:image/png;base64,") == len(TOLD)
    assert not re.search(r"(?:src|href)=[\"'](?!data:|#)|url\(|@import|<script", text)
    assert "calm" in text and "shaking" in text
    for figure in TOLD:
        height, width, _ = imread(page.parent / f"{figure.name}.png").shape
        assert height >= 200 and width >= (1000 if figure.name != "path" else 500)
    said = run.conditions
    assert (said["K"], said["T"], said["exchange"]) == ("1000 N/m", "250 µs", "direct")
    assert text.count("K 1000 N/m") == 1 and text.index("K 1000 N/m") < text.index("<figure")
    places = re.findall(r'href="#(\w+)"', text)
    assert places == [*(figure.name for figure in FIGURES), "tables"]
    assert all(text.count(f'id="{place}"') == 1 for place in places)
    assert run.begun.timestamp() == pytest.approx(BOOT_TO_EPOCH * 1e-9 + 5.0, abs=0.1)
    assert f"{run.begun:%-d %B %Y, %H:%M %Z}" in text
    [figure] = re.findall(r'<figure id="margin">(.*?)</figure>', text)  # which no run tells: a sentence, no empty box
    assert "<img" not in figure and "Not shown: the driver did not say its physical damping." in figure
    assert not (page.parent / "margin.png").exists()


def test_oscillation_contact_and_the_coupling_it_was_felt_through_are_found(bags):
    run, shaking = map(read_run, bags)
    assert sections(run)["Oscillation of the force"] == {"found": "none"}
    frequency = sections(shaking)["Oscillation of the force"]["frequency"]
    assert float(frequency.split()[0]) == pytest.approx(80.0, abs=1.0)
    [contact] = run.contacts
    assert (contact.begin, contact.end) == pytest.approx((0.5, 1.25), abs=0.001)
    found = run.impedances["contact", "x"]
    assert found.stiffness.value == pytest.approx(1000.0, rel=0.01)
    assert found.damping.value == pytest.approx(2.0, rel=0.01)


def test_the_energy_at_the_tools_port_is_the_work_of_the_coupling_on_it(tmp_path):
    rows = swing(4000)
    rows["tool_position"][:, 0] = np.linspace(0.1, 0.11, 4000)
    rows["tool_effort"], rows["tool_age"][:100] = 0.0, -1.0
    rows["tool_effort"][:, 0], rows["tool_energy"] = 2.0, 7.0  # 7: what an exchange ships, another thing
    run = read_run(write_run(tmp_path / "pushed", rows))
    assert run.tool_energy[99] == 0.0
    assert run.tool_energy[-1] == pytest.approx(2.0 * 0.01 * 3900 / 4000, rel=1e-3)


def test_a_long_line_keeps_its_peaks_and_its_end():
    count = 100_000
    values = np.zeros(count)
    values[[count // 3, -1]] = 5.0, -3.0
    time, thin = curves.thin(np.arange(count), values)
    assert (thin.max(), thin.min()) == (5.0, -3.0)
    assert len(thin) <= 2 * curves.POINTS and time[-1] >= 0.998 * (count - 1)


@pytest.mark.parametrize("column", ["tick", "deadline", "lateness"])
def test_a_few_ticks_that_are_no_numbers_take_no_figure_with_them(tmp_path, column):
    rows = swing(4000)
    at, blocks = [0, *range(1001, 1010), 3999], []
    for begin in range(0, 4000, 80):
        part = rows[begin : begin + 80]
        broken, data = part.copy(), cloud(part)
        broken[column][[i - begin for i in at if begin <= i < begin + 80]] = np.nan
        data = data.replace(part.tobytes(), broken.tobytes())
        blocks.append(("/haptic/trace", CLOUD, data, begin // 80 + 1, begin + 1))
    run = read_run(write_bag(tmp_path / "some", *blocks))
    found = sections(run)
    assert any("11" in note and column in note for note in run.notes)
    assert found["Servo"]["rate"] == "4000 Hz" and found["Servo"]["missed ticks"] == "0"
    assert found["Servo"]["lateness p50, p99, max"] == "8, 8, 8 µs"
    assert not any("nan" in value for section in found.values() for value in section.values())
    assert "nan" not in "".join(compared(read_run(tmp_path / "some")).values()) and "positions" in drawn(run)


def of_columns(folder, rows, names):
    """A bag of a trace alone, with these columns."""
    return write_bag(folder, ("/haptic/trace", CLOUD, cloud_of(rows[names].copy())))


def test_a_trace_of_an_older_layout_is_shown_as_far_as_it_goes(tmp_path):
    rows = swing(4000)
    older = [name for name in rows.dtype.names if name not in ("margin", "tool_age", "force_walls")]
    run = read_run(of_columns(tmp_path / "older", rows, older))
    assert "topic trace has no tool_age, force_walls, margin" in run.notes
    found = sections(run)
    assert found["Servo"]["rate"] == "4000 Hz" and "no topic operator/state" in found["Energy"]["not shown"]
    assert "positions" in drawn(run) and verdict(run)[:2] == (WARN, "No fault.")
    assert "topic trace has no tool_age, force_walls, margin" in verdict(run).rest
    run = read_run(of_columns(tmp_path / "bare", rows, ["tick", "deadline", "engage"]))
    assert verdict(run)[:2] == (WARN, "Not known whether there was a fault.")


@pytest.mark.parametrize("ticks", [3, 12, 40])
@pytest.mark.parametrize("period", [0, PERIOD_NS, 10**9])
def test_a_trace_of_few_ticks_or_strange_times_says_what_it_cannot_show(tmp_path, ticks, period):
    rows = swing(ticks)
    rows["deadline"] = 5e9 + rows["tick"] * period
    run = read_run(write_bag(tmp_path / "some", ("/haptic/trace", CLOUD, cloud(rows))))
    assert sections(run)["Oscillation of the force"]["not shown"] and compared(run)["oscillation"] == "—"
    assert "no topic operator/state" in sections(run)["Energy"]["not shown"] and verdict(run).level == WARN


def test_the_forces_of_a_run_by_a_method_that_is_no_more_are_not_judged(tmp_path, monkeypatch):
    bag = write_run(tmp_path / "some", swing(400))
    assert "Not judged" not in verdict(read_run(bag)).rest
    monkeypatch.setattr(summary, "METHODS", {"pspm": 2})
    assert "Not judged: forces (it was recorded with an exchange method" in verdict(read_run(bag)).rest


def test_force_that_was_withheld_is_told_with_its_time_and_cause(tmp_path):
    rows = swing(8000)
    rows["withheld"][1000:2000] = withheld.TANK  # .25 s
    rows["withheld"][3000:5000] = withheld.TANK + withheld.LIMIT
    rows["withheld"][6000:6790] = withheld.OLD_TOOL  # just not .2 s
    causes = {cause.name: cause.cause for cause in withheld.TABLE}
    assert sections(read_run(write_run(tmp_path / "some", rows)))["Force withheld"] == {
        "tank": f"0.75 s in all, 0.50 s at most: {causes['tank']}",
        "limit": f"0.50 s in all, 0.50 s at most: {causes['limit']}",
    }
    rows["withheld"][:6000] = 0
    told = sections(read_run(write_run(tmp_path / "none", rows)))["Force withheld"]
    assert told == {"found": "none for more than 0.2 s"}


def cloud_of(rows):
    """A block of any structured array of float64 columns."""
    packed = np.array(rows.tolist(), [(name, rows.dtype[name]) for name in rows.dtype.names])
    return CloudLayout(packed.dtype).pack(0, packed)


def said_meanwhile(folder, node, *said, touched=False):
    """The run of a trace, with contact from its 200th tick on or without, and of what a node said meanwhile."""
    rows = swing(400)
    rows["tool_contact"][200:] = touched
    values = [{name: str(value) for name, value in one.items()} for one in said]
    messages = [("/diagnostics", DIAGNOSTICS, diagnostics(node, one), i, i) for i, one in enumerate(values, 1)]
    return read_run(write_bag(folder, ("/haptic/trace", CLOUD, cloud(rows)), *messages))


@pytest.mark.parametrize(
    ("forces", "touched", "told"),
    [
        ((0.0, 3.5, 3.5), True, "3.5 N"),
        ((8.39, 8.39), False, "0 N"),
        ((8.39, 0.0, 9.0), True, "9 N"),
        ((8.39, 0.0, 2.0), True, "at most 8.39 N, which was before this recording"),
    ],
)
def test_the_strongest_contact_is_that_of_this_recording_and_not_of_before(tmp_path, forces, touched, told):
    said = [{"max_contact_force": force} for force in forces]
    run = said_meanwhile(tmp_path / "later", "haptic_simulation", *said, touched=touched)
    assert sections(run)["Contact"]["strongest contact"] == told
    value = quantities.figures(run)["contact"]["max_force_n"]
    assert (value is None) == told.startswith("at most")


def test_what_the_nodes_count_is_counted_from_their_first_message_and_a_new_world_counts_from_zero(tmp_path):
    said = ((10.0, 1.0, -0.5), (10.5, 1.25, -0.25), (0.25, 0.0, 0.125), (1.0, 0.5, -0.125))
    names = ("sub_steps", "waited_s", "tool_port_energy")
    run = said_meanwhile(tmp_path / "world", "haptic_simulation", *(dict(zip(names, one, strict=True)) for one in said))
    assert sections(run)["Exchange"]["time that the world left out"] == "750 ms"
    assert quantities.figures(run)["energy_j"]["tool_port_end"] == 0.25 + 0.125 - 0.25
    said = [
        {"trace_dropped": dropped, "telemetry_skipped": skipped} for dropped, skipped in ((3, 5), (8, 20), (10, 35))
    ]
    told = sections(said_meanwhile(tmp_path / "driver", "haptic_driver", *said))["Recording"]
    assert told["messages lost"] == "none" and told["rows that the servo had to drop"] == "7"
    assert told["samples that the driver had to skip"] == "30"


def test_the_servos_account_of_energy_begins_with_the_recording_and_lateness_of_0_was_not_measured(tmp_path):
    rows = swing(4000)
    rows["energy_given"][:, 0] = 5.0 - np.linspace(0.0, 0.25, 4000)
    rows["missed"], rows["lateness"] = 12.0, 0.0
    found = sections(read_run(write_run(tmp_path / "later", rows)))
    assert found["Energy"]["given to the operator, servo's account, end"] == "−250 mJ"
    assert found["Energy"]["given to the operator, truth, largest"] == "0 J"
    assert (found["Servo"]["missed ticks"], found["Servo"]["lateness p50, p99, max"]) == ("0", "not measured")


def test_stamps_that_go_back_or_stand_still_are_counted_topic_by_topic_and_those_without_one_are_not(tmp_path):
    stamps = {"handle": (5, 7, 7, 6, 8), "encoder": (5, 6, 7), "operator/target": (0, 0, 0)}
    stamped = [(f"/haptic/{topic}", JOINTS, joints(("x",), [1.0], one)) for topic, of in stamps.items() for one in of]
    swung = write_run(tmp_path / "well", swing(400))
    for folder, said in ((write_bag(tmp_path / "stamps", *stamped), "handle 1 back, 1 still"), (swung, "none, in ")):
        assert sections(read_run(folder))["Recording"]["stamps that go back, or stand still"].startswith(said)


def test_markers_are_told_with_their_time_from_the_first_message_on(tmp_path):
    said = [
        ("/haptic/mark", STRING, string(word), 1, time) for time, word in ((10**9, "begins"), (3 * 10**9, "lets go"))
    ]
    found = sections(read_run(write_bag(tmp_path / "marked", *said)))
    assert found["Trial and markers"] == {"mark at 0.000 s": "begins", "mark at 2.000 s": "lets go"}


def test_without_a_trace_the_force_on_the_handle_of_a_linkage_is_its_wrench_and_not_its_torques(tmp_path):
    torques = joints(("shoulder", "elbow"), [1.0, 2.0], 0, effort=[0.1, 0.2])
    wrench = bytes(StampedLayout(WRENCH, "haptic").pack(0, wrench_numbers([5.0, 6.0, 0.0])))
    bag = write_bag(tmp_path / "arm", ("/haptic/motor", JOINTS, torques), ("/haptic/wrench", WRENCH, wrench))
    assert [read_run(bag).forces(axis)["on handle"][1].tolist() for axis in (0, 1)] == [[5.0], [6.0]]


def foreign(folder):
    """A bag of somebody else, who has diagnostics too."""
    state = "/arm/joint_states", JOINTS, joints(("x",), [1.0], 0)
    return write_bag(folder, state, ("/diagnostics", DIAGNOSTICS, diagnostics("arm", {})))


def only(bag, folder, *topics):
    """The bag again, with these topics alone."""
    thin, channels = Bag(folder), {}
    with open(next(bag.glob("*.mcap")), "rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages(topics):
            if channel.topic not in channels:
                channels[channel.topic] = thin.add_topic(channel.topic, schema.name, [])
            times = message.log_time, message.publish_time, message.sequence
            thin.write(channels[channel.topic], message.data, *times)
    thin.close({})
    return folder


def test_bags_that_cannot_be_shown_are_left_out_of_the_page_which_says_so(bags, tmp_path, capsys, one_figure):
    with pytest.raises(typer.Exit) as ended:
        report([foreign(tmp_path / "arm"), bags[0], tmp_path / "nowhere"], tmp_path / "report")
    assert ended.value.exit_code == 1
    page, said = (tmp_path / "report" / "report.html").read_text(encoding="utf-8"), capsys.readouterr().err
    for sentence in ("arm is of no haptic display", "nowhere does not exist"):
        assert page.count(sentence) == said.count(sentence) == 1
    assert "<h1>Report: calm</h1>" in page and said.count("left out: ") == 2
    assert said.endswith(f"next: open {tmp_path / 'report' / 'report.html'}\n")


NO_TRACE = "there is no trace"
SAID_LAST = "Said last on /diagnostics, counted since each node's start"
OTHERS = ("/haptic/handle", "/haptic/tool", "/haptic/operator/state", "/diagnostics")


def drawn(run):
    """Names of the figures that show something of the run."""
    names = []
    for figure in FIGURES:
        with contextlib.suppress(ValueError):
            figure.check(run)
            pyplot.close(figure.draw([run], RUNS[:1]))
            names.append(figure.name)
    return names


def test_without_a_trace_the_other_topics_are_shown_and_the_page_says_what_is_left_out(bags, tmp_path):
    run = read_run(only(bags[0], tmp_path / "untraced", *OTHERS))
    assert run.notes[0].startswith(f"{NO_TRACE}: servo, exchange, passivity margin, impedance and spectrum")
    assert drawn(run) == ["positions", "forces", "angles", "path", "energies"]
    found = sections(run)
    assert found["Servo"] == found["Exchange"] == {"not shown": NO_TRACE}
    assert found["What ran"]["length"] == "2.000 s, no trace" and found["What ran"]["K"] == "1000 N/m"
    assert found["Energy"]["given to the operator, truth, end"] == "−2 J"
    assert found["Contact"]["deepest overlap"] == "30 µm"
    assert found["Recording"]["messages of each topic"].startswith("handle 2000, tool 2000, operator/state 2000, ")
    assert "tool_port_energy 0.125" in found[SAID_LAST]["haptic_simulation"]
    text = write_report([run], tmp_path / "report").read_text(encoding="utf-8")
    assert text.count("data:image/png;base64,") == 5 and f"<p>untraced: {NO_TRACE}" in text


def test_a_trace_of_one_tick_is_told_from_none(bags, tmp_path):
    encoder = "/haptic/encoder", JOINTS, joints(("x",), [1.0], 0)
    run = read_run(write_bag(tmp_path / "short", ("/haptic/trace", CLOUD, cloud(swing(1))), encoder))
    found = sections(run)
    assert run.notes[0].startswith("the trace has 1 ticks; two are needed: servo,")
    assert found["Servo"] == {"not shown": "the trace has 1 ticks; two are needed"}
    assert found["Recording"]["messages of each topic"] == "trace 1, encoder 1"
    with pytest.raises(ValueError, match="the trace has 1 ticks"):
        read_run(only(tmp_path / "short", tmp_path / "nothing", "/haptic/trace"))


def test_what_cannot_be_shown_is_refused_in_a_sentence_and_nothing_is_written(bags, tmp_path):
    odd, out = write_bag(tmp_path / "odd", ("/haptic/handle", JOINTS, b"")), tmp_path / "report"
    nowhere = tmp_path / "nowhere"
    for refused, said in (
        (lambda: read_run(odd), "no topic trace under /haptic.*topic /haptic/handle is left out"),
        (lambda: report([nowhere] * 7, out), "7 bags are given; at most 6"),
    ):
        with pytest.raises(ValueError, match=said):
            refused()
    assert not out.exists()


DONE = "task done: depth 95 %"


@pytest.fixture(scope="module", params=["peg_in_hole", "wall", None])
def pictured(bags, tmp_path_factory, request):
    """The picture of a run in this scene: its file, and its figure as drawn."""
    file = tmp_path_factory.mktemp("picture") / "report.png"
    scene = partial(draw, scene_of(request.param)) if request.param else None
    return file, draw_picture(Run(load(bags[0]), "a_run"), file, scene, [(0.75, DONE)])


def panels(shown):
    """The axes over time, by the label of y."""
    return {axes.get_ylabel(): axes for axes in shown.subfigs[1].axes}


def names(axes):
    """What the key of axes says."""
    return [text.get_text() for text in axes.get_legend().get_texts()]


def test_the_picture_fits_a_screen_with_every_word_in_it_and_large_enough_to_be_read(pictured):
    file, shown = pictured
    height, width, _ = imread(file).shape
    assert (width, height) == tuple(round(DPI * size) for size in SIZE) and width <= 1920 and height <= 900
    for axes in shown.axes:
        labels = [axes.title, axes.xaxis.label, axes.yaxis.label, *axes.texts]
        legends = axes.get_legend().get_texts() if axes.get_legend() else []
        for text in filter(Text.get_text, [*labels, *legends]):
            box, half = text.get_window_extent(), axes.get_figure(root=False).bbox
            assert half.x0 <= box.x0 and box.x1 <= half.x1 and box.y0 >= 0 and box.y1 <= height, text.get_text()
            assert text.get_fontsize() >= 9.0
        assert axes.lines or axes.texts, "no empty box"


def test_all_that_has_a_time_has_one_axis_with_one_label_and_shows_when_the_task_was_done(pictured):
    grid = panels(pictured[1])
    assert list(grid)[:3] == ["x [mm]", "y [mm]", "θ [°]"] and len(grid) == 6
    first, *others = grid.values()
    assert all(first.get_shared_x_axes().joined(first, other) for other in others)
    assert [bool(axes.get_xlabel()) for axes in grid.values()] == [False] * 5 + [True]
    for axes in grid.values():
        [at] = [line for line in axes.lines if set(line.get_xdata()) == {0.75}]
        assert [text.get_text() for text in axes.texts] == [DONE] and at.get_label() not in names(axes)


def test_the_verdict_comes_first_and_then_the_scene_or_without_one_the_path(pictured):
    words, place, *_ = pictured[1].subfigs[0].axes
    heading, said = (text.get_text() for text in words.texts)
    assert heading.startswith("A run: ") and words.get_position().y1 > place.get_position().y1
    assert said.startswith("No fault.") and "K\u00a01000\u00a0N/m" in said
    assert [name for name in names(place) if "recorded" in name] == ["handle, as recorded", "tool, as recorded"]
    assert ("way of the handle" in names(place)) == bool(place.get_title())


def test_a_path_that_is_a_line_has_one_scale_for_both_axes_and_a_border_on_all_sides(tmp_path):
    rows = swing(400)
    rows["position"][:, 1], rows["position"][:, 0] = rows["position"][:, 0] + 0.01, 0.0
    shown = draw_picture(Run(load(write_run(tmp_path / "up", rows)), "up"), tmp_path / "up.png")
    place = shown.subfigs[0].axes[1]
    (left, right), (bottom, top) = place.get_xlim(), place.get_ylim()
    assert place.get_aspect() == 1.0 and left < 0.0 < right and right - left > 0.3 * (top - bottom)
    assert bottom < 0.0 and top > 1e3 * rows["position"][:, 1].max()


def test_what_a_driver_alone_cannot_tell_has_no_panel_but_a_sentence(tmp_path):
    rows = swing(400)
    rows["tool_age"], rows["lateness"] = -1.0, 0.0
    shown = draw_picture(Run(load(write_run(tmp_path / "alone", rows)), "alone"), tmp_path / "alone.png")
    said = shown.subfigs[0].axes[0].texts[1].get_text().replace("\n", " ")
    assert "handle to tool [mm] is not shown: no tool sample was ever used." in said
    assert "Servo timing is not shown: it was not measured" in said
    assert len(panels(shown)) == 5 and len(shown.subfigs[0].axes) == 2


def test_curves_that_lie_within_a_lines_width_are_drawn_once_under_both_names():
    time = np.linspace(0.0, 1.0, 11)
    handle = curves.Curve("handle", time, 50.0 * time, "blue")
    for apart, told in ((0.999, ["handle = tool"]), (1.001, ["handle", "tool"])):
        late = np.repeat(time, 2)  # of another clock
        tool = curves.Curve("tool", late, 50.0 * late + apart, "blue")
        assert [curve.name for curve in curves.once([handle, tool], 50.0)] == told
    still = curves.Curve("tool", time, np.full(11, np.nan), "blue")
    assert len(curves.once([handle, still], 50.0)) == 2, "what is no number is not alike"


def test_an_axis_shows_every_value_with_a_border_and_no_less_than_its_least_range():
    time = np.linspace(0.0, 1.0, 11)
    for y, limits in ((2.0 * time, (-0.1, 2.1)), (1e-9 * time, (-0.5, 0.5)), (np.full(11, np.nan), (-0.5, 0.5))):
        assert curves.range_of([curves.Curve("x", time, y, "blue")], 1.0) == pytest.approx(limits)
