# SPDX-License-Identifier: Apache-2.0
"""What a scene needs, as launch file, demo and page are told it."""

import pytest

from haptic_device.config.description import load_device
from haptic_device.config.files import find, names
from haptic_display.run.system import Order, programs_of
from haptic_sim.scene.language import load
from haptic_sim.scene.needs import LOOPBACK, needs_of, served_by


def test_motion_and_start_of_every_shipped_scene_are_those_that_its_language_reads():
    for name in names("scenes"):
        needs, scene = needs_of(name), load(name)
        assert needs.motion == {f"motion.{key}": value for key, value in scene.motion.items()}
        assert tuple(needs.start) == scene.tool.pose


def test_every_shipped_device_is_served_by_its_link_and_no_device_is_the_simulated_one():
    for name in names("devices"):
        assert needs_of("", name).serving == served_by(load_device(name).link.type)
    assert needs_of("") == ("", LOOPBACK, {}, (0.0, 0.0, 0.0))


def test_a_device_that_is_given_goes_before_that_of_files_and_the_last_file_before_the_first(tmp_path):
    files = [tmp_path / f"{k}.yaml" for k in range(3)]
    for file, device in zip(files, ("moteus_knob", "./own.yaml", 7), strict=True):
        file.write_text(f"/**/haptic_driver: {{ros__parameters: {{device: {device}}}}}")
    (tmp_path / "own.yaml").write_text(find("devices", "own_device").read_text())
    assert needs_of("", "", files)[:2] == (str(tmp_path / "own.yaml"), "")
    assert needs_of("", "undamped", files)[:2] == ("undamped", LOOPBACK)


@pytest.mark.parametrize("link", ["[1]", "{type: [1]}", "{}", "text", "{port: 3}"])
def test_a_link_that_is_none_is_left_to_the_nodes(tmp_path, link):
    (tmp_path / "own.yaml").write_text(f"link: {link}\n")
    assert needs_of("", str(tmp_path / "own.yaml")).serving


def test_waypoints_that_are_none_are_refused_in_one_sentence(tmp_path):
    (tmp_path / "own.yaml").write_text("motion: {name: waypoints, waypoints: [[0.0]]}")
    with pytest.raises(ValueError, match=r"own\.yaml: motion\.waypoints\[0\] is \[0\.0\]; write \[x, y\]"):
        needs_of(tmp_path / "own.yaml")


def test_a_demo_starts_what_the_scene_needs_with_its_motion(tmp_path):
    needs = needs_of("peg_in_hole")
    for device, serving in (("undamped", LOOPBACK), ("moteus_knob", "haptic_bridge"), ("own_device", "")):
        order = Order("peg_in_hole", 1.0, tmp_path / "run", None, None, find("", "demo"), device=device)
        programs = {program.name: program.parameters for program in programs_of(order)}
        assert needs_of("", device).serving == serving
        assert {*programs} == {"haptic_recorder", "haptic_simulation", "haptic_driver", serving} - {""}
    order = order._replace(device=None)
    hand = next(program.parameters for program in programs_of(order) if program.name == LOOPBACK)
    assert needs.motion.items() <= hand.items()
