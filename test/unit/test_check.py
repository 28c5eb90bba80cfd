# SPDX-License-Identifier: Apache-2.0
"""The `haptic` command on configuration files and on the table of parameters."""

import re
import subprocess
import sys
from pathlib import Path

from examples import few
from hypothesis import given
from hypothesis import strategies as st
from in_process import haptic

from haptic_display.run.config_problems import problems, remark
from haptic_sim.reduction import reduce_scene
from haptic_sim.reduction.promise import kept_rows, unkept_wish
from haptic_sim.scene.language import load

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = sorted((ROOT / "config").rglob("*.yaml"))


def broken(tmp_path, text):
    path = tmp_path / "broken.yaml"
    path.write_text(text)
    return path


def point(**nodes):
    """An operating point that gives nodes this."""
    return "".join(f"/**/haptic_{node}: {{ros__parameters: {{{given}}}}}\n" for node, given in nodes.items())


def test_of_every_file_that_is_shipped_the_command_says_ok_and_exits_with_zero():
    done = haptic("check", "--lateness", "0", *SHIPPED)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines() == [f"{path}: ok" for path in SHIPPED]


def test_the_command_prints_each_mistake_and_exits_with_one(tmp_path):
    path = broken(tmp_path, "/**/haptic_driver: {ros__parameters: {autostart: 1, autostrat: true}}")
    done = haptic("check", SHIPPED[0], path, "--lateness", "0")
    assert done.returncode == 1
    assert done.stdout.splitlines() == [
        f"{SHIPPED[0]}: ok",
        f"{path}: /**/haptic_driver: autostart is 1 (integer); true or false is needed",
        f"{path}: /**/haptic_driver: autostrat is not a parameter of haptic_driver; did you mean autostart?",
    ]
    assert done.stderr == ""


def test_checking_needs_no_ros():
    code = "import sys; import haptic_display.cli.check; print(sorted({'rclpy', 'sensor_msgs'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "[]\n", done.stderr


EVERYTHING = """
/**/haptic_driver:
  ros__parameters:
    device: desktop
    servo: {rate: 2000.0, rat: 1.0}
    engage: {time: 99.0}
    coupling: {stiffness: 90000.0, damping: 1.0}
    wall: {normals: [0.0, 1.0, 1.0, 1.0], offsets: [-0.02, 0.0], stiffness: [4000.0], damping: [0.2, 0.2]}
/**/haptic_loopback:
  ros__parameters:
    device: devices/mine.yaml
    motion: {name: circle, start: [9.0, 0.0, 0.0]}
/**/haptic_simulation:
  ros__parameters:
    scene: maize
"""


def test_an_operating_point_is_told_all_that_is_wrong_at_once(tmp_path):
    found = problems(broken(tmp_path, EVERYTHING))
    for words in (
        "/**/haptic_driver: servo.rat is not a parameter of haptic_driver; did you mean servo.rate?",
        "/**/haptic_driver: engage.time is 99.0 s; at most 10.0 s is allowed",
        f"haptic_loopback: device 'devices/mine.yaml' is neither the file {tmp_path}/devices/mine.yaml nor a name in",
        f"haptic_simulation: scene 'maize' is neither the file {tmp_path}/maize nor a name in config/scenes, which has",
        "wall.stiffness has 1 numbers; 2 walls (wall.offsets) need 2: set the four lists of wall together",
        "wall.normals of wall 1 is [1, 1], of length 1.41421; write a unit vector",
        "coupling.stiffness 90000 N/m with coupling.damping 1 N s/m needs b >",
    ):
        assert sum(sentence.startswith(words) for sentence in found) == 1, (words, found)
    assert len(found) == 7
    assert "(with the default of engage.time)" in found[-1]
    found = problems(broken(tmp_path, EVERYTHING.replace("devices/mine.yaml", "desktop")))
    assert "motion.start x is at 9 m of the device; its workspace is -0.12 to 0.12 m" in found
    assert len(found) == 7


def test_values_that_are_wrong_themselves_are_not_said_not_to_fit(tmp_path):
    text = "/**/haptic_driver: {ros__parameters: {wall: {normals: [0.0, 2.0], offsets: [0.0]}}}"
    assert len(problems(broken(tmp_path, text))) == 1


def test_a_device_is_told_all_that_is_wrong_at_once(tmp_path):
    text = (ROOT / "config/devices/desktop.yaml").read_text()
    for right, wrong in (("name: x", "nam: x"), ("mass: ", "mass: -"), ("workspace: [", "workspace: [9.0, ")):
        text = text.replace(right, wrong, 1)
    found = problems(broken(tmp_path, text + "colour: red\n"))
    assert len(found) >= 4
    assert sum(sentence.count("axes[0]") for sentence in found) == 3, found


def test_of_a_scene_every_key_of_the_motion_is_looked_at_beside_all_else(tmp_path):
    text = (ROOT / "config/scenes/wall.yaml").read_text()
    short = text.replace("start: [0.03, 0.0, 0.0]", "start: [0.03, 0.0]")
    assert problems(broken(tmp_path, short)) == ["motion.start has 2 numbers; write 3: x, y, theta"]
    text = text.replace("mass: 0.1", "mass: -0.1")
    text = text.replace("name: press_wall", "name: pres_wall\n  turn: 3.0\n  taps: 2.5")
    found = problems(broken(tmp_path, text))
    assert [sentence.split()[0] for sentence in found] == ["tool.mass", "motion.name", "motion.turn", "motion.taps"]


def test_docs_writes_the_table_of_parameters_to_standard_output_or_to_a_file_and_the_committed_one_is_as_new(tmp_path):
    path = tmp_path / "parameters.md"
    assert haptic("docs", "--out", path).returncode == 0
    assert path.read_text() == haptic("docs").stdout == (ROOT / "docs/reference/parameters.md").read_text()


def test_a_scene_that_wishes_for_less_error_than_its_method_has_is_told_of_and_is_right(tmp_path):
    scene = (ROOT / "config" / "scenes" / "push_block.yaml").read_text()
    path = broken(tmp_path, scene + "error: 1.0e-5\n")
    point = tmp_path / "point.yaml"
    point.write_text(f"/**/haptic_simulation: {{ros__parameters: {{scene: ./{path.name}}}}}\n")
    done = haptic("check", path, point)
    assert done.returncode == 0
    for line, file in zip(done.stdout.splitlines(), (path, point), strict=True):
        assert line.startswith(f"{file}: ok; but error 1e-05 is wanted, and partitioned in steps of")


def test_a_scene_that_no_method_takes_is_no_right_file(tmp_path):
    walls = [f"  - {{name: w{k}, fixed: true, pose: [1.0, {k}, 0.0], layers: [{k}], shapes: *disc}}" for k in range(90)]
    shapes = "[{circle: {radius: 0.01}}]"
    text = "name: crowd\ngravity: [0.0, -9.81]\nbodies:\n" + "\n".join(walls).replace("*disc", shapes)
    text += f"\ntool: {{mass: 0.1, layers: {list(range(90))}, shapes: {shapes}}}\n"
    [sentence] = problems(broken(tmp_path, text))
    assert sentence.startswith("bodies share 90 layers, of which impulse takes at most 32")


def test_an_operating_point_whose_method_does_not_take_its_scene_is_told(tmp_path):
    scene = tmp_path / "ball.yaml"
    scene.write_text(
        "name: ball\nmaterials: {rubber: {restitution: 0.5}}\ngravity: [0.0, -9.81]\nbodies:\n"
        "  - {name: ball, mass: 1.0, material: rubber, pose: [0.0, 1.0, 0.0], shapes: [{circle: {radius: 0.1}}]}\n"
        "  - {name: floor, fixed: true, material: rubber, shapes: [{half_plane: {normal: [0.0, 1.0]}}]}\n"
        "tool: {mass: 0.1, pose: [2.0, 1.0, 0.0], shapes: [{circle: {radius: 0.01}}]}\n"
    )
    for name, method, sentence in (
        ("gravel", "partitioned", "scene 'gravel': method is 'partitioned', but the scene has 102 bodies"),
        (scene, "penalty_implicit", "scene 'ball': 'ball' and 'floor' have a restitution of 0.5, which contacts"),
        (scene, "impulse", None),
    ):
        text = f"/**/haptic_simulation: {{ros__parameters: {{scene: {name}, method: {method}}}}}\n"
        found = problems(broken(tmp_path, text))
        assert [line[: len(sentence)] for line in found] == [sentence] if sentence else found == []


def test_of_a_shipped_scene_what_was_measured_counts_before_what_is_reckoned(monkeypatch):
    rows = {row.method: row for row in kept_rows(load("gravel"))}
    assert reduce_scene(load("gravel")).unkept.startswith("tool is 142.9 times as heavy as stone_47")
    assert unkept_wish("gravel") == ""
    far = rows["impulse"]._replace(error=0.7, doubt=0.1)
    monkeypatch.setattr("haptic_sim.reduction.promise.of_scene", lambda name: [far])
    assert unkept_wish("gravel") == "error 0.02 is wanted, and impulse was measured to have a relative error of 0.7"


def test_a_driver_that_is_attended_every_twentieth_of_a_second_is_not_asked_to_miss_it_sooner(tmp_path):
    for seconds, taken in (("0.0", True), ("0.2", True), ("0.19", False), ("0.01", False)):
        found = problems(broken(tmp_path, point(driver=f"fault: {{unattended: {seconds}}}")))
        sentence = f"fault.unattended is {float(seconds):g} s, and the driver says each 0.05 s that it is there"
        assert [one.startswith(sentence) for one in found] == ([] if taken else [True])


def test_an_operating_point_names_the_bad_file_that_it_names(tmp_path):
    axis = "{name: x, counts_per_unit: 1e5, motor_limit: 15.0, workspace: [-0.1, 0.1], mass: 0.1}"
    device = f"name: bad\naxes: [{axis}]\n", "velocity_limit is missing", "damping is missing"
    scene = "name: bad\ntool: {mass: 0, shapes: [{circle: {radius: 0}}]}\n", "tool.shapes[0].circle.radius", "tool.mass"
    for node, name, (text, *sentences) in (
        ("driver", "device", device),
        ("loopback", "device", device),
        ("simulation", "scene", scene),
    ):
        (tmp_path / "bad.yaml").write_text(text)
        found = problems(broken(tmp_path, point(**{node: f"{name}: ./bad.yaml"})))
        for sentence, words in zip(found, sentences, strict=True):
            assert sentence.startswith(f"{name} {tmp_path}/bad.yaml: ")
            assert words in sentence


UNDAMPED = "device: undamped, coupling: {stiffness: 100.0, damping: 0.0}"
DIRECT, CIRCLE = "exchange: {method: direct}", "name: circle, start: [0.11, 0.0, 0.0]"
METHODS = "exchange.method is 'direct' of haptic_driver and 'pspm' of haptic_simulation; both must have the same"
DEVICES = "device is 'undamped' of haptic_driver and 'desktop' of haptic_loopback, which differ in axes[0].damping, "
ENDS, ROOM = ("start", "target"), "of the device; its workspace is -0.12 to 0.12 m"


def moving(motion):
    return point(loopback=f"motion: {{{motion}}}")


TOGETHER = [
    (point(driver=DIRECT), METHODS),
    (point(driver=DIRECT, simulation="exchange: {method: pspm}"), METHODS),
    (point(driver=DIRECT, simulation=DIRECT), ""),
    (point(driver=UNDAMPED, loopback="device: desktop"), f"{DEVICES}axes[1].damping; both must have the same"),
    (point(driver=UNDAMPED), ""),  # hardware, and no loopback
    (moving("name: press_wall, target: [0.13, 0.0, 0.0]"), f"motion.target x is at 0.13 m {ROOM}"),
    (moving("name: press_wall, target: [0.12, 0.0, 12.0]"), ""),
    (moving("name: hold, target: [9.0, 0.0, 0.0]"), ""),  # which hold does not go to
    (moving("name: tap, target: [0.0, 0.17, 0.0]"), "motion.target y is at 0.17 m of the device"),
    (moving("name: waypoints, waypoints: [0.0, 0.0, 0.0, -0.2, 0.0, 0.0]"), "motion.waypoints 2 x is at -0.2 m of"),
    (moving(f"{CIRCLE}, radius: 0.14"), f"motion.radius, leftmost, x is at -0.17 m {ROOM}"),
    (moving(f"{CIRCLE}, radius: 0.115"), ""),
    (moving(f"{CIRCLE}, radius: 0.14, turns: 0.49"), ""),
    (moving("name: let_go, target: [0.0, 0.0, 12.5]"), "motion.target theta is at 12.5 rad of the device"),
]


def test_an_operating_point_whose_parts_cannot_run_together_is_refused_and_one_whose_parts_just_can_is_right(tmp_path):
    for text, sentence in TOGETHER:
        found = problems(broken(tmp_path, text))
        assert found[0].startswith(sentence) if sentence else found == [], (text, found)


def test_a_simulated_device_that_the_file_leaves_out_is_told_where_it_would_be_another(tmp_path):
    for text, told in (
        (point(driver=UNDAMPED), True),
        (point(driver=UNDAMPED, loopback="device: undamped"), False),
        (point(driver="device: desktop"), False),
        (point(driver="device: reference_udp"), False),  # what serves it is not the loopback
    ):
        assert remark(broken(tmp_path, text)).startswith("haptic_loopback has no section and is 'desktop'") == told


def test_the_motion_of_a_scene_that_an_operating_point_names_stays_in_the_workspace(tmp_path):
    scene = (ROOT / "config/scenes/wall.yaml").read_text()
    for x, told in (("0.12", []), ("0.121", [f"scene 'wall': motion.{name} x is at 0.121 m {ROOM}" for name in ENDS])):
        text = scene.replace("start: [0.03, 0.0, 0.0]", f"start: [{x}, 0.0, 0.0]")
        (tmp_path / "far.yaml").write_text(re.sub(r"target: \[[^,]*,", f"target: [{x},", text))
        assert problems(broken(tmp_path, point(simulation="scene: ./far.yaml"))) == told


def test_of_the_shipped_scenes_only_a_wrench_turned_ten_times_is_beyond_the_shipped_device(tmp_path):
    turns = "motion.target theta is at 62.8319 rad of the device; its workspace is -12 to 12 rad"
    for path in SHIPPED:
        if path.parent.name == "scenes":
            beyond = [f"scene 'spinning_wrench': {turns}"] if path.stem == "spinning_wrench" else []
            assert problems(broken(tmp_path, point(simulation=f"scene: {path.stem}"))) == beyond


def wall(tmp_path, **changed):
    """The scene of this name in which these lines have another value; None leaves a line out."""
    text = (ROOT / "config/scenes/wall.yaml").read_text()
    for key, value in changed.items():
        text, count = re.subn(rf"^  {key}: .*\n", "" if value is None else f"  {key}: {value}\n", text, flags=re.M)
        assert count == 1, key
    path = tmp_path / "wall.yaml"
    path.write_text(text)
    return path


INSIDE = "which leads the tool into a body: bodies[0] ('wall') overlaps tool ('tool') by"


def test_a_scene_whose_hand_starts_inside_a_body_is_told_the_body_and_the_depth(tmp_path):
    starts = {"[0.01, 0.0, 0.0]": "", "[0.0099, 0, 0]": "0.1 mm", "[-0.02, 0, 0]": "30 mm", None: "10 mm"}
    for start, depth in starts.items():
        found = problems(wall(tmp_path, start=start))
        assert len(found) == bool(depth), (start, found)
        for sentence in found:
            assert sentence.startswith("motion.start is [") and f"], {INSIDE} {depth} at the start" in sentence
    text = wall(tmp_path, start=None).read_text()
    assert problems(broken(tmp_path, text[: text.index("motion:")])) == []  # no hand is simulated for it


def test_of_an_operating_point_its_own_motion_goes_before_that_of_the_scene(tmp_path):
    wall(tmp_path, start="[-0.02, 0.0, 0.0]")
    inside, outside = "motion: {start: [0.0, 0.0, 0.0]}", "motion: {start: [0.02, 0.0, 0.0]}"
    for loopback, depth in ((None, "30 mm"), (inside, "10 mm"), (outside, "")):
        nodes = {"simulation": "scene: ./wall.yaml"} | ({"loopback": loopback} if loopback else {})
        found = problems(broken(tmp_path, point(**nodes)))
        assert len(found) == bool(depth) and all(f"{INSIDE} {depth} at the start" in sentence for sentence in found)


def test_numbers_of_a_motion_are_taken_without_a_point_as_those_of_bodies_are(tmp_path):
    ints = {"start": "[1, 0, 0]", "target": "[-0.02, 0, 0]", "duration": "1"}
    assert problems(wall(tmp_path, **ints)) == []
    motion = load(tmp_path / "wall.yaml").motion
    assert all(type(number) is float for number in (*motion["start"], *motion["target"], motion["duration"]))
    for key, value, said in (
        ("duration", "true", "motion.duration is true (boolean); "),
        ("duration", "0", "motion.duration is 0.0 s; at least 0.1 s"),
        ("start", "[1, 0, true]", "motion.start[2] is true (boolean); "),
        ("start", "[1, 0]", "motion.start has 2 numbers; write 3"),
        ("start", "[11, 0, 0]", "motion.start[0] is 11.0 m, m, rad; at most 10.0"),
        ("name", "tap\n  taps: 2.0", "motion.taps is 2.0 (decimal number); "),
    ):
        [sentence] = problems(wall(tmp_path, **{key: value}))
        assert sentence.startswith(said)
    assert problems(wall(tmp_path, name="tap\n  taps: 2")) == []


TOO_LARGE = "tool is {:.4g} m across; the limit is {} m: write lengths in m, not in mm"


def tool_of(tmp_path, size):
    """A scene that has nothing but a tool of this size."""
    path = tmp_path / "tool.yaml"
    path.write_text(f"name: tool\ntool: {{mass: 0.1, shapes: [{{box: {{size: [{size}, 1.0e-3]}}}}]}}\n")
    return path


@given(st.floats(1.001e-3, 1.0))
@few(30)
def test_a_tool_is_taken_in_metres_and_in_millimetres_it_is_told_that_it_is_too_large(tmp_path_factory, size):
    folder = tmp_path_factory.mktemp("tool")
    assert problems(tool_of(folder, size)) == []
    assert problems(tool_of(folder, 1e3 * size)) == [TOO_LARGE.format(1e3 * size, 1)]


def test_a_device_that_makes_its_world_larger_leads_a_tool_as_much_larger(tmp_path):
    large = (ROOT / "config/devices/desktop.yaml").read_text() + "scale: [3.0, 1.0]\n"
    (tmp_path / "large.yaml").write_text(large)
    driver = "device: ./large.yaml, passivity: {policy: warn}"
    for size, told in ((3.0, False), (3.001, True)):
        tool_of(tmp_path, size)
        found = problems(broken(tmp_path, point(driver=driver, simulation="scene: ./tool.yaml")))
        assert found == ([f"scene 'tool': {TOO_LARGE.format(size, 3)}"] if told else [])


def stiff(stiffness, policy="enforce"):
    gains = f"coupling: {{stiffness: {stiffness}, damping: 1.0}}, passivity: {{policy: {policy}}}"
    return point(driver=f"servo: {{rate: 4000.0}}, {gains}")


def most(sentence, words):
    return float(re.search(rf"([\d.e+]+) N/m{words}", sentence)[1])


def test_a_gain_too_stiff_is_told_what_it_may_be_on_time_and_as_late_as_this_machine(tmp_path):
    [alone] = problems(path := broken(tmp_path, stiff("50000.0")))
    [sentence] = problems(path, lambda driver: 2e-4)
    assert (
        sentence == f"{alone}, and under {most(sentence, ' where'):g} N/m where forces act 0.2 ms late, as they do here"
    )
    on_time, late = most(alone, "$"), most(sentence, " where")
    assert late < on_time
    for stiffness, lateness in ((on_time, 0.0), (late, 2e-4)):
        for step, fits in ((-1.0, True), (1.0, False)):
            path = broken(tmp_path, stiff(stiffness + step))
            assert (problems(path) == [] and remark(path, lambda driver, late=lateness: late) == "") == fits


def test_gains_that_only_this_machine_is_too_late_for_are_right_and_told_of(tmp_path):
    path = broken(tmp_path, stiff("3000.0"))
    assert problems(path, lambda driver: 1e-3) == []
    done = haptic("check", "--lateness", "1", path)
    begin = f"{path}: ok; but 99 % of the writes here are within 1 ms, and coupling.stiffness 3000 N/m with "
    assert done.returncode == 0 and done.stdout.startswith(begin) and " 1 ms late" in done.stdout
    assert most(done.stdout, ", and") < 3000.0 < most(done.stdout, " on time")
    assert haptic("check", "--lateness", "0", path).stdout == f"{path}: ok\n"


def test_where_gains_are_not_enforced_nothing_is_measured(tmp_path):
    for policy in ("warn", "'off'"):
        path = broken(tmp_path, stiff("3000.0", policy))
        assert problems(path, None) == []
        assert remark(path, None) == ""


def test_where_nothing_can_be_measured_the_limit_on_time_is_told_alone(tmp_path, monkeypatch):
    monkeypatch.setattr("haptic_device.jit.missing", lambda entries: list(entries))
    done = haptic("check", path := broken(tmp_path, stiff("50000.0")))
    assert done.returncode == 1 and done.stdout == f"{path}: {problems(path)[0]}\n"


def test_lateness_is_measured_for_an_operating_point_alone():
    asked = []
    for file, rates in ((ROOT / "config/scenes/wall.yaml", []), (SHIPPED[0], [4000.0])):
        assert problems(file, asked.append) == []
        assert remark(file, asked.append) == ""
        assert [driver["servo.rate"] for driver in asked] == rates


def test_the_page_on_passivity_explains_a_refusal_with_the_numbers_that_the_command_prints(tmp_path):
    page = (ROOT / "docs/theory/passivity.md").read_text(encoding="utf-8")

    def said(stiffness, rate=4000.0, lateness=0.0):
        wall = f"wall: {{normals: [0.0, 1.0], offsets: [-0.02], stiffness: [{stiffness}], damping: [0.0]}}"
        path = broken(tmp_path, point(driver=f"device: desktop, servo: {{rate: {rate}}}, {wall}"))
        done = haptic("check", path, "--lateness", lateness)
        return " ".join((done.stdout + done.stderr).split())

    [sentence] = re.findall(r"^wall\.stiffness .*$", page, re.MULTILINE)
    assert sentence in said(30000.0)
    limit = float(re.search(r"= (\d+)\$ N/m", page)[1])
    assert "needs b >" in said(limit)
    assert "needs b >" not in said(0.999 * limit)
    late, limit = re.search(r"([\d.]+) ms late, the limit is (\d+) N/m", page).groups()
    limited = rf"under {limit} N/m \(\d+ N/m with this coupling\) where forces act {re.escape(late)} ms late"
    assert re.search(limited, said(30000.0, lateness=late))
    rate = 1e3 * float(re.search(r"at (\d+) kHz the same wall needs 1\.875 N s/m", page)[1])
    assert "needs b >" not in said(30000.0, rate)
