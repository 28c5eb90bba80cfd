# SPDX-License-Identifier: Apache-2.0
"""Layouts for PlotJuggler and Foxglove ask for what a bag has; the programs themselves are not run here."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import yaml

from haptic_device.message_fields import AXES, exchange_names, frame_id, truth_names
from haptic_device.nodes.recorded_topics import KNOWN

LAYOUTS = Path(__file__).parents[2] / "config" / "layouts"
NAMES = {
    "encoder": AXES,
    "motor": AXES,
    "handle": exchange_names(3),
    "tool": exchange_names(3),
    "operator/state": truth_names(3),
}
OWN = {"/haptic/markers"}  # of the viewer, not recorded by name


def test_every_curve_of_plotjuggler_is_a_joint_of_a_recorded_topic():
    curves = [curve.get("name") for curve in ElementTree.parse(LAYOUTS / "plotjuggler.xml").iter("curve")]
    known = {
        f"/haptic/{topic}/{name}/{part}"
        for topic, names in NAMES.items()
        for name in names
        for part in ("position", "velocity", "effort")
    }
    assert len(curves) >= 10 and set(curves) <= known


def test_every_splitter_of_plotjuggler_counts_its_plots():
    for splitter in ElementTree.parse(LAYOUTS / "plotjuggler.xml").iter("DockSplitter"):
        sizes = splitter.get("sizes").split(";")
        assert len(splitter) == int(splitter.get("count")) == len(sizes)
        assert abs(sum(map(float, sizes)) - 1.0) < 1e-9


def panels(layout):
    """Names of the panels in a tree of splits."""
    return [layout] if isinstance(layout, str) else panels(layout["first"]) + panels(layout["second"])


def test_every_panel_of_foxglove_exists_and_stands_once():
    layout = json.loads((LAYOUTS / "foxglove.json").read_text())
    assert sorted(panels(layout["layout"])) == sorted(layout["configById"])


def test_every_path_of_foxglove_is_an_entry_of_a_recorded_topic():
    layout = json.loads((LAYOUTS / "foxglove.json").read_text())
    paths = [path["value"] for panel in layout["configById"].values() for path in panel.get("paths", ())]
    assert len(paths) >= 8
    for path in paths:
        topic, rest = re.fullmatch(r"/haptic/([\w/]+)\.(.+)", path).groups()
        assert topic in KNOWN
        if found := re.fullmatch(r"(?:position|velocity|effort)\[(\d+)\]", rest):
            assert int(found.group(1)) < len(NAMES[topic])
    assert truth_names(3)[6] == "energy_given" and "/haptic/operator/state.position[6]" in paths
    for topic in layout["configById"]["3D!plane"]["topics"]:
        assert topic.removeprefix("/haptic/") in KNOWN or topic in OWN


def test_rviz_shows_the_markers_in_their_frame():
    manager = yaml.safe_load((LAYOUTS / "haptic.rviz").read_text())["Visualization Manager"]
    topics = {display["Topic"]["Value"] for display in manager["Displays"] if "Topic" in display}
    assert topics <= OWN
    assert manager["Global Options"]["Fixed Frame"] == frame_id("/haptic", "map")
    assert manager["Views"]["Current"]["Target Frame"] == "<Fixed Frame>", "which the launch file sets"
    assert json.loads((LAYOUTS / "foxglove.json").read_text())["configById"]["3D!plane"]["followTf"] == "haptic_map"
