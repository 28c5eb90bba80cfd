# SPDX-License-Identifier: Apache-2.0
"""Tables and examples of the documents, and the layouts of other programs, have the names that the code has."""

import itertools
import json
import math
import re
import struct
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import link_frames
import pytest

from haptic_device.config.description import load_device
from haptic_device.config.parameters import EXCHANGE_METHODS
from haptic_device.config.yaml_reader import load as load_yaml
from haptic_device.control import enable_state, records
from haptic_device.message_fields import AXES, TAIL, exchange_names, frame_id, truth_names
from haptic_device.nodes import driver, exchange_server, page_server, recorder
from haptic_device.nodes.recorded_topics import KNOWN
from haptic_device.realtime import scheduling, servo_thread
from haptic_device.recording import ENTRY_UNITS, TRACE_UNITS
from haptic_display.cli.docs import fault_table
from haptic_display.cli.main import COMMANDS
from haptic_display.run.config_problems import problems
from haptic_sim.method_registry import offered
from haptic_sim.node import simulation
from haptic_sim.scene import language
from haptic_sim.scene.joints import JOINTS, Joint
from haptic_sim.scene.shapes import SHAPES, Body, Material, Tool

ROOT = Path(__file__).parents[2]
LAYOUTS, BENCHMARKS = ROOT / "config" / "layouts", ROOT / "docs" / "benchmarks"
README = ROOT / "README.md"
TOPICS, LINK, SCENE, FORMATS, CLI, FAULTS, PLATFORM = (
    ROOT / f"docs/reference/{name}.md"
    for name in ("topics", "link_protocol", "scene_language", "file_formats", "cli", "faults", "platform")
)
TRACE = records.TRACE_ROW.names
COUNTED = ("counts", "motor")  # whose units are the device's
LETTERS = {"u8": "B", "u16": "H", "u32": "I", "i16": "h", "i32": "i", "i64": "q", "f32": "f", "f64": "d"}
PAYLOADS = {
    "greeting": link_frames.GREETING,
    "command": link_frames.COMMAND,
    "sample": link_frames.SAMPLE,
    "clock, clock answer": link_frames.CLOCK_ANSWER,
    "target": link_frames.TARGET,
    "truth": link_frames.TRUTH,
}
PARTS = {
    "Scene": language.Scene,
    "Materials": Material,
    "Bodies": Body,
    "Tool": Tool,
    "Measure": language.Measure,
    "Task": language.Task,
}


def cells(page, mark):
    """Cells of the table that begins with this line, or of the first one below this heading; without its head."""
    text = page.read_text(encoding="utf-8")
    begun = re.search(rf"^(?:#+ )?{re.escape(mark)}$", text, re.MULTILINE).start()
    shown = re.search(r"^\|.*?(?=\n\n|\Z)", text[begun:], re.DOTALL | re.MULTILINE).group()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in shown.splitlines()[2:]]


def rows(page, heading):
    """The same without the marks of code around a cell."""
    return [[cell.strip("`") for cell in row] for row in cells(page, heading)]


def first(page, heading):
    """The first column of it."""
    return [row[0] for row in rows(page, heading)]


def named(cell):
    """Names in backticks; what an inner mapping has is left out."""
    return re.findall(r"`(\w+)(?:: \{[^`]*)?`", cell)


def keys(part):
    """Keys of a part of the scene language, as a file writes them."""
    return {field.alias or name for name, field in part.model_fields.items()}


def size(kind):
    """Bytes of a type as the page of the link writes it: f32[3], char[24]."""
    letter, count = re.fullmatch(r"(\w+?)(?:\[(\d+)\])?", kind).groups()
    return int(count or 1) * (1 if letter == "char" else struct.calcsize(f"<{LETTERS[letter]}"))


def payload(name):
    """Offsets of the fields of a payload, and where the last one ends."""
    fields = cells(LINK, f"| offset | type | {name} |")
    return [int(offset) for offset, *_ in fields] + [int(fields[-1][0]) + size(fields[-1][1])]


def without_gaps(name):
    """What `payload` must be: each field begins where the one before it ends, and all are as long as a frame."""
    sizes = [size(kind) for _, kind, _ in cells(LINK, f"| offset | type | {name} |")]
    return [0, *itertools.accumulate(sizes[:-1]), struct.calcsize(link_frames.PAYLOADS[PAYLOADS[name]])]


def head_of_a_frame():
    """Format and length of the head as the page has them."""
    *fields, payload, _ = cells(LINK, "| offset | type | field |")
    return "<" + "".join(LETTERS[kind] for _, kind, _ in fields), int(payload[0])


def services():
    """Services that driver and simulation offer."""
    for node, module in {"haptic_driver": driver, "haptic_simulation": simulation}.items():
        text = Path(module.__file__).read_text(encoding="utf-8")
        yield from (f"{node}/{name}" for name in re.findall(r"def _on_(\w+)\(self, request, response\)", text))


def shipped_devices():
    """(name, link, axis, mass, damping, friction, step [µm], workspace) of each axis of each shipped device."""
    for file in (ROOT / "config/devices").glob("*.yaml"):
        device = load_device(str(file))
        for axis in device.axes:
            numbers = (f"{value:.4g}" for value in (axis.mass, axis.damping, axis.coulomb, 1e6 / axis.counts_per_unit))
            yield device.name, device.link.type, axis.name, *numbers, "{:g} to {:g}".format(*axis.workspace)


def told_devices():
    """The same, as the page tells it."""
    for devices, links, axes, *numbers, workspaces in rows(FORMATS, "Shipped devices"):
        spaces = workspaces.replace("−", "-").split(", ")
        for device, link in zip(devices.split(", "), links.split(", "), strict=True):
            for axis, space in zip(axes.split(", "), spaces, strict=True):
                yield device.strip("`"), link.strip("`"), axis, *numbers, space


EQUAL = {  # what the page has, and what the code has
    "columns of the trace": lambda: (
        [(name, int(width)) for name, width, *_ in rows(TOPICS, "Columns of `trace`")],
        [(name, math.prod(records.TRACE_ROW[name].shape)) for name in TRACE],
    ),
    "units of the trace": lambda: (
        {name: unit.split(" or ")[0] for name, _, unit, _ in rows(TOPICS, "Columns of `trace`") if name not in COUNTED},
        {name: re.split(r" \||,", TRACE_UNITS.get(name, ""))[0] for name in TRACE if name not in COUNTED},
    ),
    "tail of handle and tool, and its units": lambda: (
        [(name, unit) for name, unit, _ in rows(TOPICS, "Tail of `handle` and `tool`")],
        [(name, ENTRY_UNITS.get(name, "")) for name in TAIL],
    ),
    "faults": lambda: (FAULTS.read_text(encoding="utf-8"), fault_table()),
    "exchange methods": lambda: (first(ROOT / "docs/theory/model.md", "Exchange"), list(EXCHANGE_METHODS)),
    "types of recorded topics": lambda: (
        {row[0]: row[1] for row in rows(TOPICS, "Topics") if row[0] in KNOWN},
        {topic: kind.replace("/msg/", "/") for topic, kind in KNOWN.items()},
    ),
    "states of the driver": lambda: (
        {row[0]: row[3] for row in rows(TOPICS, "Columns of `trace`")}["state"],
        ", ".join(f"{number} {name}" for number, name in enumerate(enable_state.STATES)),
    ),
    "priorities": lambda: (
        {row[0]: int(row[1]) for row in rows(PLATFORM, "Priorities")},
        {
            "plant": page_server.PRIORITY,
            "bridge": page_server.PRIORITY,
            "servo": servo_thread.PRIORITY,
            "middleware": driver.MIDDLEWARE_PRIORITY,
            "exchange": exchange_server.PRIORITY,
            "recorder": recorder.PRIORITY,
            "interpreter": scheduling.INTERPRETER_PRIORITY,
        },
    ),
    "shipped devices": lambda: (set(told_devices()), set(shipped_devices())),
    **{f"payload of {name}": lambda name=name: (payload(name), without_gaps(name)) for name in PAYLOADS},
    "head of a frame": lambda: (head_of_a_frame(), (link_frames.HEAD.format, link_frames.HEAD.size)),
    "lengths of each kind of frame": lambda: (
        {int(kind): int(length) for kind, _, _, length in cells(LINK, "| kind | name | from | payload bytes |")},
        {kind: struct.calcsize(payload) for kind, payload in link_frames.PAYLOADS.items()},
    ),
    "bits of a sample": lambda: (
        [1 << int(bit) for bit, _ in cells(LINK, "| bit | status |")],
        [getattr(link_frames, bit) for bit in ("CUT", "ESTOP", "HOT", "END_SWITCH", "BROKEN_ENCODER", "CLAMPED")],
    ),
    **{
        f"keys of {part} in a scene": lambda part=part, kind=kind: (
            sorted(name for row in cells(SCENE, part) for name in named(row[0])),
            sorted(keys(kind)),
        )
        for part, kind in PARTS.items()
    },
    "shapes of a scene": lambda: (
        {named(row[0])[0]: {*named(row[1])} for row in cells(SCENE, "Shapes")},
        {name: keys(kind) - {"vertices"} for name, kind in SHAPES.items()},
    ),
    "keys of every joint": lambda: (
        {name for row in cells(SCENE, "Joints") for name in named(row[0])},
        keys(Joint) | {"type"},
    ),
    "keys of each joint": lambda: (
        {named(row[0])[0]: {*named(row[2])} for row in cells(SCENE, "| type | coordinate | keys of its own |")},
        {name: keys(kind) - keys(Joint) - {"type"} for name, kind in JOINTS.items()},
    ),
    "methods that a scene may ask for": lambda: (
        [named(row[2]) for row in cells(SCENE, "Scene") if row[0] == "`method`"],
        [list(offered())],
    ),
    "topics of the policy for sros2": lambda: (
        {topic.text for topic in ElementTree.parse(ROOT / "docs/reference/sros2/policy.xml").iter("topic")},
        {*first(TOPICS, "Topics")} - {"/parameter_events"},
    ),
}


@pytest.mark.parametrize("what", EQUAL)
def test_a_page_has_what_the_code_has_and_nothing_else(what):
    told, known = EQUAL[what]()
    assert told and told == known


def test_each_service_of_a_node_stands_in_the_service_table():
    told = set(re.findall(r"^\| `(haptic_\w+/\w+)`", TOPICS.read_text(encoding="utf-8"), re.MULTILINE))
    assert {"haptic_driver/enable", "haptic_simulation/reset_scene"} <= {*services()} <= told


def test_profiles_that_the_policy_for_sros2_includes_are_there():
    folder = ROOT / "docs/reference/sros2"
    for included in ElementTree.parse(folder / "policy.xml").iter("{http://www.w3.org/2001/XInclude}include"):
        assert ElementTree.parse(folder / included.get("href")).getroot().tag == "profile"


def test_commands_in_the_readme_exist_and_its_small_table_has_rows_of_the_long_one():
    text = README.read_text(encoding="utf-8")
    targets = re.findall(r"^([\w-]+): ", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(re.findall(r"`haptic (\w+)", text)) <= set(COMMANDS)
    assert {"demo", "test"} <= set(re.findall(r"make ([\w-]+)", text)) <= set(targets)
    performance = rows(BENCHMARKS / "performance.md", "Performance")
    assert all(row in performance for row in rows(README, "Speed"))


def examples(page, folder):
    """Files of the YAML blocks of a page."""
    for number, block in enumerate(re.findall(r"```yaml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)):
        file = folder / f"{number}.yaml"
        file.write_text(block, encoding="utf-8")
        yield file


@pytest.mark.parametrize("page", [FORMATS, SCENE], ids=lambda page: page.stem)
def test_the_files_that_a_page_shows_pass_the_check(page, tmp_path):
    shown = list(examples(page, tmp_path))
    assert shown and all(load_yaml(file) for file in shown)
    assert [problem for file in shown for problem in problems(file)] == []


NAMES = {"encoder": AXES, "motor": AXES, "handle": exchange_names(3), "tool": exchange_names(3)}
NAMES |= {"operator/state": truth_names(3)}


def test_every_curve_of_plotjuggler_is_a_joint_of_a_recorded_topic():
    layout = ElementTree.parse(LAYOUTS / "plotjuggler.xml")
    curves = {curve.get("name") for curve in layout.iter("curve")}
    entries = [f"/haptic/{topic}/{name}" for topic, names in NAMES.items() for name in names]
    known = {f"{entry}/{part}" for entry in entries for part in ("position", "velocity", "effort")}
    assert len(curves) >= 10 and curves <= known


def panels(layout):
    """Names of the panels in a tree of splits."""
    return [layout] if isinstance(layout, str) else panels(layout["first"]) + panels(layout["second"])


def test_every_path_of_foxglove_is_an_entry_of_a_recorded_topic_and_every_panel_stands_once():
    layout = json.loads((LAYOUTS / "foxglove.json").read_text())
    shown = layout["configById"]
    assert sorted(panels(layout["layout"])) == sorted(shown)
    paths = [path["value"] for panel in shown.values() for path in panel.get("paths", ())]
    for path in paths:
        topic, rest = re.fullmatch(r"/haptic/([\w/]+)\.(.+)", path).groups()
        assert topic in KNOWN
        if found := re.fullmatch(r"(?:position|velocity|effort)\[(\d+)\]", rest):
            assert int(found.group(1)) < len(NAMES[topic])
    assert shown["3D!plane"]["followTf"] == frame_id("/haptic", "map")
