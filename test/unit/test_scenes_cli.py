# SPDX-License-Identifier: Apache-2.0
"""`haptic scenes`: the list, the pictures, the explanations, and how bad input is refused."""

import math

import numpy as np
import pytest
from in_process import haptic
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.image import imread

from haptic_device.config.files import find, names
from haptic_device.theory.palette import FIXED, TARGET
from haptic_sim.lockstep import verify
from haptic_sim.reduction import reduce_scene
from haptic_sim.reduction.explain import explain
from haptic_sim.reduction.measured import KEPT, Measured, of_scene, read, write
from haptic_sim.scene.draw import DRIVEN, draw
from haptic_sim.scene.drawing import drawing_of
from haptic_sim.scene.language import load, parse
from haptic_sim.scene.paint import SPRUNG

LIBRARY = "wall corner peg_in_hole wrench_on_nut push_block slider four_bar pendulum stack hammer_nail ratchet"
PNG = b"\x89PNG\r\n\x1a\n"


def test_the_list_names_every_scene_with_its_method():
    listed = haptic("scenes").stdout
    assert all(name in listed for name in names("scenes"))
    assert set(names("scenes")) >= {"free_space", *LIBRARY.split()}
    assert "closed_form" in listed


def test_a_drawn_scene_is_a_picture_with_tool_and_wall_in_it(tmp_path):
    done = haptic("scenes", "--draw", "wall", "--out", tmp_path / "picture.png")
    assert (done.returncode, done.stdout.strip()) == (0, str(tmp_path / "picture.png"))
    assert (tmp_path / "picture.png").read_bytes().startswith(PNG)
    pixels = imread(tmp_path / "picture.png")[..., :3]
    orange = (pixels[..., 0] > 0.9) & (pixels[..., 2] < 0.5)
    grey = (abs(pixels - (0.75 * np.array(to_rgb(FIXED)) + 0.25)) < 0.01).all(axis=2)
    assert orange.sum() > 1000
    assert grey.sum() > 1000


def axes_of(scene):
    axes = Figure().subplots()
    draw(scene, axes)
    return axes


def glyphs(joint=None, belt=None):
    """Axes, and curves by colour, of a picture of one block on that joint, or of a belt that runs at `belt`."""
    block = {"name": "block", "mass": 1.0, "shapes": [{"box": {"size": [0.02, 0.02]}}]}
    floor = {"name": "floor", "fixed": True, "shapes": [{"half_plane": {"point": [0.0, -0.05], "normal": [0.0, 1.0]}}]}
    tool = {"mass": 0.1, "pose": [0.05, 0.05, 0.0], "shapes": [{"circle": {"radius": 0.005}}]}
    bodies = [block, floor | ({"surface_velocity": belt} if belt else {})]
    joints = [{"bodies": ["world", "block"], "at": [0.0, 0.0], **joint}] if joint else []
    axes = axes_of(parse({"name": "one", "bodies": bodies, "tool": tool, "joints": joints}, "here"))
    return axes, {line.get_color(): line for line in axes.lines}


def direction(curve):
    """Where the arrow of a motor or a belt points [rad]; counter-clockwise of an arrow that turns: 1."""
    points = curve.get_marker().vertices
    if len(points) < 10:
        return math.atan2(*reversed(points[1] - points[0]))
    before, behind = points[:2]
    return math.copysign(1.0, before[0] * behind[1] - before[1] * behind[0])


def test_the_arrow_of_a_motor_or_a_belt_points_where_it_drives_and_one_that_brakes_has_none():
    for speed, way in ((0.1, math.pi / 4.0), (-0.1, -0.75 * math.pi)):
        axes, curves = glyphs({"type": "slider", "axis": [1.0, 1.0], "motor": {"speed": speed, "max_force": 1.0}})
        assert [text.get_text() for text in axes.texts] == [f"{speed:g} m/s"]
        assert direction(curves[DRIVEN]) == pytest.approx(way)
    for speed in (2.0, -2.0, 0.0):
        axes, curves = glyphs({"type": "pin", "motor": {"speed": speed, "max_torque": 1.0}})
        assert [text.get_text() for text in axes.texts] == [f"{speed:g} rad/s"]
        assert direction(curves[DRIVEN]) == math.copysign(1.0, speed) if speed else DRIVEN not in curves
    _, curves = glyphs(belt=[-0.2, 0.0])
    assert abs(direction(curves[DRIVEN])) == pytest.approx(math.pi)


def test_a_spring_is_a_zigzag_and_a_damper_alone_a_dashed_line():
    ends = {"type": "spring", "at": None, "anchors": [[0.0, 0.1], [0.0, 0.0]]}
    _, sprung = glyphs({**ends, "stiffness": 100.0, "damping": 1.0})
    _, damped = glyphs({**ends, "damping": 1.0})
    assert np.ptp(sprung[SPRUNG].get_xydata()[:, 0]) > 5.0
    assert damped[SPRUNG].get_linestyle() == "--"
    for joint in ({"type": "pin"}, {"type": "slider", "axis": [1.0, 0.0]}):
        assert SPRUNG in glyphs({**joint, "stiffness": 1.0})[1]
        assert SPRUNG not in glyphs(joint)[1]


def inside(axes, places):
    """Whether these places [mm] are in the picture."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    return bool((places > np.array([left, low])).all() and (places < np.array([right, high])).all())


def test_the_far_end_of_a_spring_is_in_the_picture():
    for anchor in ([0.4, 0.0], [0.0, -0.4]):
        axes, _ = glyphs({"type": "spring", "at": None, "anchors": [anchor, [0.0, 0.0]], "stiffness": 100.0})
        assert inside(axes, 1e3 * np.array([anchor]))


def test_two_scene_files_of_one_name_get_two_pictures(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = find("scenes", "wall").read_text(encoding="utf-8")
    for name in ("near", "far"):
        (tmp_path / f"{name}.yaml").write_text(text, encoding="utf-8")
    drawn = [haptic("scenes", "--draw", f"{name}.yaml").stdout.strip() for name in ("near", "far")]
    assert drawn == ["near.png", "far.png"]
    assert all((tmp_path / name).read_bytes().startswith(PNG) for name in drawn)


def test_every_scene_suggests_a_motion_and_its_picture_shows_the_whole_way_with_title_units_and_legend():
    for name in names("scenes"):
        scene = load(name)
        axes, way = axes_of(scene), np.array(drawing_of(scene).way)
        assert way[0] == pytest.approx(scene.tool.pose, abs=1e-9)
        moving = [body.pose[:2] for body in scene.bodies if not body.fixed]
        assert inside(axes, 1e3 * np.array([scene.tool.pose[:2], *moving, *way[:, :2]])), name
        assert scene.description
        assert scene.measure or name == "free_space"
        assert " ".join(axes.get_title().split()) == scene.description
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [mm]", "y [mm]")
        labels = axes.get_legend_handles_labels()[1]
        assert "tool" in labels
        assert len(set(labels)) == len(labels)


def drawn(name, **changed):
    """Axes with the picture of a scene, some of its fields changed."""
    return axes_of(load(name).model_copy(update=changed))


def texts(axes):
    """Words in the picture."""
    return [text.get_text() for text in axes.texts if text.get_text()]


def test_what_is_measured_is_a_line_from_where_it_is_0_to_where_it_is_1():
    axes = drawn("push_block")
    line = next(line for line in axes.lines if line.get_color() == TARGET)
    measure, block = load("push_block").measure["pushed"], load("push_block").solids["block"]
    ends = [(1e-3 * x, 1e-3 * y, block.pose[2]) for x, y in line.get_xydata()]
    assert [measure.fraction(end) for end in ends] == pytest.approx([0.0, 1.0])
    assert "measured: pushed" in axes.get_legend_handles_labels()[1]
    assert TARGET not in [line.get_color() for line in drawn("push_block", measure={}).lines]


def test_gravity_is_an_arrow_that_points_where_it_pulls_and_says_its_tilt():
    for gravity in ((0.0, -9.81), (4.905, -8.4957), (-1.0, 0.0)):
        arrow = next(text for text in drawn("incline", gravity=gravity).texts if not text.get_text())
        way = np.array(arrow.xy) - arrow.get_position()
        assert math.atan2(*way) == pytest.approx(math.atan2(*gravity))
    assert texts(drawn("incline")) == ["gravity, tilted 30°"]
    assert texts(drawn("incline", gravity=(0.0, 0.0))) == []


def test_a_body_that_moves_at_the_start_has_an_arrow_along_its_way():
    for velocity in ((2.0, 0.0, 0.0), (0.0, -2.0, 0.0), (1.2, 1.6, 0.0)):
        body = load("slider_stop").bodies[0].model_copy(update={"velocity": velocity})
        axes = drawn("slider_stop", bodies=(body,))
        assert "2 m/s" in texts(axes)
        arrow = next(line for line in axes.lines if line.get_color() == DRIVEN)
        assert direction(arrow) == pytest.approx(math.atan2(velocity[1], velocity[0]))


def test_an_explanation_says_dof_contacts_and_method():
    for name, words in (
        ("wall", ["contact acts only along [1, 0], in closed form", "closed_form"]),
        ("four_bar", ["2 of 12", "none can happen", "impulse"]),
        ("peg_in_hole", ["3 of 3 pairs of shapes", "tool-hole", "must be solved together", "matters"]),
        ("stack_20", ["63, three each", "partitioned: 20 bodies stand on one another, and impulse takes at most 15"]),
        ("heavy_on_light_1e3", ["partitioned: heavy is 1000 times as heavy as light, and 2 bodies stand on one"]),
    ):
        said = " ".join(answer for _, answer in explain(reduce_scene(load(name))))
        assert [word for word in words if word not in said] == []


def test_a_scene_that_is_not_shipped_as_it_stands_is_not_measured_and_says_how_to(tmp_path):
    """One of the same name counts by what is in it."""
    said = haptic("scenes", "--explain", "wall").stdout.splitlines()[-3:]
    for line, row in zip(said, of_scene("wall"), strict=True):
        assert f"error {100 * row.error:.2g} %" in line
    for content, known in ((find("scenes", "wall").read_text(), True), (find("scenes", "corner").read_text(), False)):
        own = tmp_path / "own.yaml"
        own.write_text(content.replace("name: corner", "name: wall"))
        last = haptic("scenes", "--explain", own).stdout.splitlines()[-1]
        assert (f"not measured; haptic check --verify {own} measures them" in last) != known


def test_a_scene_of_ones_own_is_verified_and_its_rows_are_kept_beside_those_of_others(tmp_path, monkeypatch):
    kept, own = tmp_path / "table.csv", tmp_path / "own.yaml"
    own.write_text(find("scenes", "corner").read_text().replace("name: corner", "name: own\nmethod: penalty_implicit"))
    monkeypatch.setattr(verify, "SECONDS", 0.6)  # until it is pressed into the corner
    monkeypatch.setattr(verify, "FINE", {"partitioned": (8000, 4000)})
    old = Measured("own", "impulse", 250.0, 0.0, 0.0, 0.0, 0.0, 100.0, "stable")
    write([old, *(row for row in read(KEPT) if row.scene == "thin_plate")], kept)
    done = haptic("check", "--verify", own, "--out", kept)
    assert done.returncode == 0, done.stdout
    assert [(row.scene, row.method) for row in read(kept)] == [
        *(("own", method) for method in ("impulse", "partitioned", "penalty_implicit")),
        *(("thin_plate", method) for method in ("impulse", "partitioned")),
    ]
    impulse, partitioned, elastic = read(kept)[:3]
    assert 0.0 < partitioned.doubt < 0.1 * partitioned.error
    assert partitioned.error < 0.01
    assert partitioned.overlap_m < 1e-9 < 1e-6 < elastic.overlap_m
    assert all(row.exchange_us > 0.0 for row in (impulse, partitioned, elastic))
    assert [line.split(" | ")[-1] for line in done.stdout.splitlines()[2:]] == [" |", " |", "kept |"]


def test_a_method_that_is_chosen_and_beyond_its_bounds_is_told_by_the_exit_code(tmp_path):
    own = tmp_path / "own.yaml"
    text = find("scenes", "heavy_on_light_1e6").read_text()
    own.write_text(text.replace("name: heavy_on_light_1e6", "name: own\nmethod: impulse").replace("2.0\n", "0.2\n"))
    done = haptic("check", own, "--verify")
    assert done.returncode == 1
    assert "**beyond**" in done.stdout


def test_what_a_motor_or_a_belt_gives_is_no_energy_from_nowhere(tmp_path):
    """A sled that its motor sets going: exact to 1e-4 of its way, and all its energy is the motor's."""
    own = tmp_path / "own.yaml"
    own.write_text(
        "name: own\nbodies:\n  - {name: sled, mass: 1.0, shapes: [{box: {size: [0.02, 0.02]}}]}\njoints:\n"
        "  - {type: slider, bodies: [world, sled], at: [0.0, 0.0], axis: [1.0, 0.0], "
        "motor: {speed: 0.1, max_force: 1.0}}\n"
        "tool: {mass: 0.1, pose: [0.0, 0.2, 0.0], shapes: [{circle: {radius: 0.01}}]}\n"
        "motion: {name: press_wall, start: [0.0, 0.2, 0.0], target: [0.01, 0.2, 0.0], duration: 0.3}\n"
    )
    done = haptic("check", own, "--verify")
    assert done.returncode == 0, done.stdout
    chosen = next(line for line in done.stdout.splitlines() if line.startswith("| own | impulse"))
    assert "| of drives too |" in chosen and chosen.endswith("| kept |")


def test_bounds_are_kept_up_to_each_of_them_and_an_error_below_the_doubt_of_its_reference_is_none():
    row = Measured("own", "impulse", 250.0, 0.0, 0.0, 0.0, 0.0, 100.0, "stable")
    for field, bound in (("error", 0.02), ("created", 0.01), ("overlap_m", 1e-4)):
        assert verify.within(row._replace(**{field: 0.999 * bound}), 0.02)
        assert not verify.within(row._replace(**{field: 1.001 * bound}), 0.02)
    assert verify.within(row._replace(created=math.nan), 0.02)
    assert verify.within(row._replace(error=0.04, doubt=0.03), 0.02)
    assert not verify.within(row._replace(error=0.04, doubt=0.01), 0.02)
    assert not verify.within(row._replace(status="unstable"), 0.02)
