# SPDX-License-Identifier: Apache-2.0
"""The documents say what the code has: names, layouts, faults, priorities, files and functions."""

import json
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from in_process import haptic

from haptic_device.control import enable_state, records
from haptic_device.description import load_device
from haptic_device.message_fields import TAIL
from haptic_device.nodes import bridge, driver, exchange_server, loopback, recorded_topics, recorder
from haptic_device.parameters import EXCHANGE_METHODS
from haptic_device.realtime import scheduling, servo_thread
from haptic_device.yaml_reader import load as load_yaml
from haptic_sim.cli.docs import fault_table
from haptic_sim.cli.main import COMMANDS
from haptic_sim.config_problems import problems
from haptic_sim.node import simulation

ROOT = Path(__file__).parents[2]
TOPICS = ROOT / "docs/reference/topics.md"
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
README = ROOT / "README.md"
MODEL, PLATFORM, CLI = (ROOT / f"docs/{name}.md" for name in ("theory/model", "reference/platform", "reference/cli"))
ARCHITECTURE, PERFORMANCE = ROOT / "docs/theory/architecture.md", ROOT / "docs/benchmarks/performance.md"
SPEED_ERROR = ROOT / "docs/benchmarks/speed_error.md"
FORMATS = ROOT / "docs/reference/file_formats.md"


def rows(page, heading):
    """Cells of the first table below this heading, without its head."""
    section = page.read_text(encoding="utf-8").split(f"# {heading}\n", 1)[1]
    table = re.search(r"^\|.*?(?=\n\n|\Z)", section, re.DOTALL | re.MULTILINE).group()
    return [[cell.strip().strip("`") for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]


def test_the_trace_table_lists_each_column_in_order_with_its_width():
    widths = [
        (name, int(records.TRACE_ROW[name].shape[0]) if records.TRACE_ROW[name].shape else 1)
        for name in records.TRACE_ROW.names
    ]
    assert [(name, int(width)) for name, width, *_ in rows(TOPICS, "Columns of `trace`")] == widths


def test_the_tail_table_lists_each_entry_in_order():
    assert tuple(row[0] for row in rows(TOPICS, "Tail of `handle` and `tool`")) == TAIL


def test_the_fault_table_is_that_of_the_law():
    assert (ROOT / "docs/reference/faults.md").read_text(encoding="utf-8") == fault_table()


def test_the_method_table_lists_each_exchange_method_in_order():
    assert tuple(row[0] for row in rows(MODEL, "Exchange")) == EXCHANGE_METHODS


def test_each_recorded_topic_stands_in_the_topic_table_with_its_type():
    types = {row[0]: row[1] for row in rows(TOPICS, "Topics")}
    known = {topic: kind.replace("/msg/", "/") for topic, kind in recorded_topics.KNOWN.items()}
    assert {topic: types.get(topic) for topic in known} == known


def test_states_of_the_driver_are_numbered_as_in_the_law():
    meaning = {row[0]: row[3] for row in rows(TOPICS, "Columns of `trace`")}["state"]
    assert meaning == ", ".join(f"{number} {name}" for number, name in enumerate(enable_state.STATES))


def test_each_service_of_a_node_stands_in_the_service_table():
    services = set(re.findall(r"^\| `(haptic_\w+/\w+)`", TOPICS.read_text(encoding="utf-8"), re.MULTILINE))
    for node, module in {"haptic_driver": driver, "haptic_simulation": simulation}.items():
        text = Path(module.__file__).read_text(encoding="utf-8")
        names = re.findall(r"def _on_(\w+)\(self, request, response\)", text)
        assert names and {f"{node}/{name}" for name in names} <= services


def test_priorities_on_the_platform_page_are_those_of_the_threads():
    listed = {row[0]: int(row[1]) for row in rows(PLATFORM, "Priorities")}
    assert listed == {
        "plant": loopback.PRIORITY,
        "bridge": bridge.PRIORITY,
        "servo": servo_thread.PRIORITY,
        "middleware": driver.MIDDLEWARE_PRIORITY,
        "exchange": exchange_server.PRIORITY,
        "recorder": recorder.PRIORITY,
        "interpreter": scheduling.INTERPRETER_PRIORITY,
    }
    assert driver.MIDDLEWARE_PRIORITY == simulation.MIDDLEWARE_PRIORITY
    assert {row.default for row in simulation.PARAMETERS if row.name == "realtime_priority"} == {listed["exchange"]}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_and_paths_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!https?:)([^)#]+)[^)]*\)|src=\"([^\"]+)\"", text):
        assert (page.parent / "".join(target)).exists(), target
    for path in re.findall(r"`((?:bench|config|docs|launch|test|haptic_device|haptic_sim)/[\w./]+\w)`", text):
        assert (ROOT / path).exists(), path


@pytest.mark.parametrize("page", [ARCHITECTURE, ROOT / "CONTRIBUTING.md"], ids=lambda page: page.name)
def test_each_file_that_a_tour_of_the_tree_names_exists(page):
    for part in re.split(r"\n\n|\n(?=\*|\d+\. )", page.read_text(encoding="utf-8")):
        room = ROOT
        for path in re.findall(r"`([\w./-]+\.(?:py|md|yaml|toml))`", part):
            assert (ROOT / path).exists() or (room / path).exists(), path
            room = (ROOT / path).parent if "/" in path else room  # a bare name is a neighbour of the path before it


def test_the_tour_of_the_tree_names_each_room():
    text = ARCHITECTURE.read_text(encoding="utf-8")
    folders = {file.parent for room in ("haptic_device", "haptic_sim") for file in (ROOT / room).rglob("*.py")}
    rooms = {str(folder.relative_to(ROOT)) for folder in folders} - {"haptic_device", "haptic_sim"}
    assert {room for room in rooms if f"`{room}`" not in text} == set()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_functions_are_in_the_files_that_the_page_says(page):
    for path, names in re.findall(r"`([\w/]+\.py): ([\w, ]+)`", page.read_text(encoding="utf-8")):
        files = [file for room in ("haptic_device", "haptic_sim", "test") for file in (ROOT / room).rglob("*.py")]
        text = "".join(file.read_text(encoding="utf-8") for file in files if f"/{file}".endswith(f"/{path}"))
        for name in names.split(", "):
            assert re.search(rf"^ *(?:def|class) {name}\b|^{name}\b.* = ", text, re.MULTILINE), f"{path}: {name}"


def test_the_operating_point_in_the_documents_passes_the_check(tmp_path):
    blocks = re.findall(r"```yaml\n(.*?)```", FORMATS.read_text(encoding="utf-8"), re.DOTALL)
    assert blocks
    for number, block in enumerate(blocks):
        file = tmp_path / f"{number}.yaml"
        file.write_text(block, encoding="utf-8")
        assert load_yaml(file) and problems(file) == []


def test_the_table_of_shipped_devices_says_what_their_files_say():
    said = set()
    for devices, links, axes, *numbers, workspaces in rows(FORMATS, "Shipped devices"):
        spaces = workspaces.replace("−", "-").split(", ")
        for device, link in zip(devices.split(", "), links.split(", "), strict=True):
            named = device.strip("`"), link.strip("`")
            said |= {(*named, axis, *numbers, space) for axis, space in zip(axes.split(", "), spaces, strict=True)}
    files = [load_device(str(file)) for file in (ROOT / "config/devices").glob("*.yaml")]
    assert said == {
        (device.name, device.link.type, axis.name, *_numbers(axis), "{:g} to {:g}".format(*axis.workspace))
        for device in files
        for axis in device.axes
    }


def _numbers(axis):
    return [f"{value:.4g}" for value in (axis.mass, axis.damping, axis.coulomb, 1e6 / axis.counts_per_unit)]


@pytest.mark.parametrize(
    "words",
    [
        "passivity --stiffness 1000 --damping 0.1 --physical-damping 1 --period 0.001",
        "zwidth --points 2 --seconds 0.05 --lateness 0.0001",
    ],
)
def test_each_key_of_the_json_of_a_command_stands_on_its_page(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = words.split()[0]
    section = CLI.read_text(encoding="utf-8").split(f"## `haptic {name}`")[1].split("\n## ")[0]
    found = json.loads(haptic(*words.split(), "--json").stdout)
    for key, value in found.items():
        names = [f"{key}.{inner}" for inner in value] if isinstance(value, dict) else [key]
        assert all(re.search(rf"`(\w+)?{re.escape(n)}`|`\.{n.split('.')[-1]}`", section) for n in names), names


def test_commands_in_the_readme_exist():
    text = README.read_text(encoding="utf-8")
    targets = re.findall(r"^(\w+): ", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(re.findall(r"`haptic (\w+)", text)) <= set(COMMANDS)
    assert {"demo", "test"} <= set(re.findall(r"make (\w+)", text)) <= set(targets)


def test_the_small_tables_of_the_readme_are_rows_of_the_long_ones():
    assert all(row in rows(PERFORMANCE, "Performance") for row in rows(README, "Speed"))
    columns = 0, 1, 3, 4, 7, 8, 9  # scene, method, error, of an exchange, pymunk, Box2D, MuJoCo RK4
    measured = [[row[column] for column in columns] for row in rows(SPEED_ERROR, "Speed against error")]
    assert all(row in measured for row in rows(README, "Speed against error"))


def test_the_policy_for_sros2_names_every_topic_of_the_table_and_nothing_else():
    policy = ElementTree.parse(ROOT / "docs/reference/sros2/policy.xml")
    named = {topic.text for topic in policy.iter("topic")}
    assert named == {row[0] for row in rows(TOPICS, "Topics")} - {"/parameter_events"}
    for included in policy.iter("{http://www.w3.org/2001/XInclude}include"):
        assert ElementTree.parse(ROOT / "docs/reference/sros2" / included.get("href")).getroot().tag == "profile"
