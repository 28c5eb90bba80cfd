# SPDX-License-Identifier: Apache-2.0
"""A small bag with known figures, written by the project's own writer: a handle swinging, a tool that follows late."""

from pathlib import Path

import numpy as np
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from haptic_device.control.exchange_samples import TAIL
from haptic_device.recording.layouts import CLOUD, DIAGNOSTICS, JOINTS, STRING
from haptic_device.recording.writer import Bag

TYPES = get_typestore(Stores.ROS2_JAZZY)
SECOND = 1_000_000_000  # [ns]
AXES = ("x", "y", "theta")
SAID = {"max_contact_force": "2.5", "max_penetration": "3e-5", "tool_port_energy": "0.125"}
STIFFNESS, DAMPING = 1000.0, 2.0
PERIOD_NS, TICKS_PER_EXCHANGE, AGE_TICKS = 250_000, 4, 6
BOOT_TO_EPOCH = 1_790_000_000_000_000_000  # ns between CLOCK_MONOTONIC and the system clock
COLUMNS = (
    *((name, 1) for name in ("tick", "deadline", "lateness", "compute", "missed", "parameter_version", "command")),
    *((name, 3) for name in ("counts", "drag")),
    *((name, 1) for name in ("device_status", "tool_sequence", "tool_answered", "tool_age")),
    *((name, 3) for name in ("tool_position", "tool_velocity", "tool_effort")),
    *((name, 1) for name in ("tool_contact", "tool_energy", "handle_sequence")),
    *((name, 3) for name in ("position", "velocity", "coupling_position", "coupling_velocity")),
    *((f"force_{name}", 3) for name in ("walls", "coupling", "cancellation", "gravity", "on_handle")),
    ("motor", 3),
    *((name, 1) for name in ("engage", "exchange_fade", "cancellation_fade", "exchange_energy")),
    *((name, 3) for name in ("energy_given", "margin")),
    *((name, 1) for name in ("contact_set", "state", "fault", "withheld", "stamp_error", "exchange_shortened")),
)
ROW = np.dtype([(name, "f8", (count,)) if count > 1 else (name, "f8") for name, count in COLUMNS])


def swing(ticks: int) -> np.ndarray:
    """Trace rows: a tool held at zero by a wall, whose every answer is AGE_TICKS old when the servo uses it."""
    rows = np.zeros(ticks, ROW)
    tick = np.arange(ticks)
    time = tick * PERIOD_NS * 1e-9
    rows["tick"] = tick
    rows["deadline"] = 5e9 + tick * PERIOD_NS
    rows["lateness"], rows["compute"] = 8e-6, 1e-6
    rows["position"][:, 0], rows["velocity"][:, 0] = 0.01 * np.sin(20 * time), 0.2 * np.cos(20 * time)
    rows["handle_sequence"] = 1 + tick // TICKS_PER_EXCHANGE
    rows["tool_answered"] = np.maximum(rows["handle_sequence"] - AGE_TICKS // TICKS_PER_EXCHANGE, 1)
    rows["tool_age"] = 1.5e-3
    sampled = ((rows["tool_answered"] - 1) * TICKS_PER_EXCHANGE).astype(int)
    rows["tool_effort"] = STIFFNESS * rows["position"][sampled] + DAMPING * rows["velocity"][sampled]
    rows["force_coupling"] = -STIFFNESS * rows["position"] - DAMPING * rows["velocity"]
    rows["force_on_handle"] = rows["motor"] = rows["force_coupling"]
    rows["engage"] = rows["exchange_fade"] = rows["device_status"] = 1.0  # the device's samples are fresh
    return rows


def joints(names, position, stamp_ns: int, velocity=None, effort=None) -> bytes:
    """A serialized JointState; missing arrays are zeros."""
    kinds = TYPES.types
    stamp = kinds["builtin_interfaces/msg/Time"](stamp_ns // 10**9, stamp_ns % 10**9)
    zeros = np.zeros(len(names))
    parts = (np.asarray(zeros if part is None else part, float) for part in (position, velocity, effort))
    message = kinds[JOINTS](kinds["std_msgs/msg/Header"](stamp, "haptic"), list(names), *parts)
    return bytes(TYPES.serialize_cdr(message, JOINTS))


def cloud(rows: np.ndarray) -> bytes:
    """A serialized block of trace rows."""
    kinds = TYPES.types
    stamp = int(rows["deadline"][0]) + BOOT_TO_EPOCH
    header = kinds["std_msgs/msg/Header"](kinds["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9), "haptic")
    fields = [
        kinds["sensor_msgs/msg/PointField"](name, rows.dtype.fields[name][1], 8, count) for name, count in COLUMNS
    ]
    data = np.frombuffer(rows.tobytes(), np.uint8)
    step = rows.dtype.itemsize
    message = kinds[CLOUD](header, 1, len(rows), fields, False, step, len(data), data, True)
    return bytes(TYPES.serialize_cdr(message, CLOUD))


def string(text: str) -> bytes:
    """A serialized String."""
    return bytes(TYPES.serialize_cdr(TYPES.types[STRING](text), STRING))


def diagnostics(name: str, values: dict[str, str]) -> bytes:
    """A serialized DiagnosticArray with one status."""
    kinds = TYPES.types
    header = kinds["std_msgs/msg/Header"](kinds["builtin_interfaces/msg/Time"](0, 0), "")
    pairs = [kinds["diagnostic_msgs/msg/KeyValue"](key, value) for key, value in values.items()]
    status = kinds["diagnostic_msgs/msg/DiagnosticStatus"](0, name, "fine", "", pairs)
    return bytes(TYPES.serialize_cdr(kinds[DIAGNOSTICS](header, [status]), DIAGNOSTICS))


def write_run(folder: Path, rows: np.ndarray, block: int = 80, namespace: str = "/haptic") -> Path:
    """The rows as a bag with trace, handle, tool, operator/state and diagnostics: zeros, then SAID; closed."""
    bag = Bag(folder)
    names = {"trace": CLOUD, "handle": JOINTS, "tool": JOINTS, "operator/state": JOINTS}
    channel = {name: bag.add_topic(f"{namespace}/{name}", kind, []) for name, kind in names.items()}
    channel["diagnostics"] = bag.add_topic("/diagnostics", DIAGNOSTICS, [])
    for number, start in enumerate(range(0, len(rows), block)):
        part = rows[start : start + block]
        now = int(part["deadline"][-1]) + BOOT_TO_EPOCH
        bag.write(channel["trace"], cloud(part), now, now, number + 1)
        if number % 10 == 9:
            bag.flush()
    for row in rows[::TICKS_PER_EXCHANGE]:
        _write_exchange(bag, channel, row)
    begin = int(rows["deadline"][0]) + BOOT_TO_EPOCH + 200_000
    bag.write(channel["diagnostics"], diagnostics("haptic_simulation", dict.fromkeys(SAID, "0")), begin, begin, 1)
    bag.write(channel["diagnostics"], diagnostics("haptic_simulation", SAID), now, now, 2)
    bag.close({"namespace": namespace})
    return folder


def _write_exchange(bag: Bag, channel: dict, row: np.ndarray) -> None:
    now, sequence = int(row["deadline"]) + BOOT_TO_EPOCH, int(row["handle_sequence"])
    known = {"layout_version": 1, "sequence": sequence, "answered": row["tool_answered"]}
    known |= {"stiffness": STIFFNESS, "damping": DAMPING, "rotational_stiffness": 1.0, "rotational_damping": 0.01}
    tail = [known.get(name, 0) for name in TAIL]
    for topic in ("handle", "tool"):
        port = "" if topic == "handle" else "tool_"
        data = joints(AXES + TAIL, [*row[port + "position"], *tail], now, [*row[port + "velocity"], *[0.0] * len(TAIL)])
        bag.write(channel[topic], data, now + 100_000, now + 50_000, sequence)
    truth = joints((*AXES, "energy_given", "time"), [*row["position"], -1e-3 * sequence, row["deadline"] * 1e-9], now)
    bag.write(channel["operator/state"], truth, now + 100_000, now + 50_000, sequence)


def write_bag(folder, *messages):
    """A bag of these: each a topic, its type, the data, and its number and time [ns] where they matter. Its folder."""
    bag, channels = Bag(folder), {}
    for topic, kind, data, *rest in messages:
        if topic not in channels:
            channels[topic] = bag.add_topic(topic, kind, [])
        number, time = (*rest, 1, 1)[:2]
        bag.write(channels[topic], data, time, time, number)
    bag.close({})
    return folder


def fill(bag, count, size=40, first=0, seed=0):
    """Writes numbered messages, one each millisecond, that do not compress."""
    channel = bag.add_topic("/haptic/encoder", JOINTS, []) if first == 0 else 1
    names = [f"n{i}" for i in range(size)]
    numbers = np.random.default_rng(seed).normal(size=(count, size))
    for number in range(first, first + count):
        numbers[number - first, 0] = number
        data = joints(names, numbers[number - first], number)
        bag.write(channel, data, number * SECOND // 1000, number * SECOND // 1000, number + 1)
        if number % 50 == 49:
            bag.flush()


def numbered(folder, topics, **limit):
    """An open bag in which each topic has messages of these publishers' numbers, one a second."""
    bag = Bag(folder, **limit)
    channels = {topic: bag.add_topic(topic, JOINTS, []) for topic in topics}
    numbers = [(number, topic, one) for topic, all_of in topics.items() for number, one in enumerate(all_of, 1)]
    for number, topic, sequence in sorted(numbers, key=lambda one: one[0]):
        bag.write(channels[topic], joints(("x",), [1], 0), number * SECOND, number * SECOND, sequence)
        bag.flush()
    return bag


def information(folder):
    return yaml.safe_load((folder / "metadata.yaml").read_text())["rosbag2_bagfile_information"]


def values_by_rosbags(folder):
    with AnyReader([folder]) as reader:
        return [reader.deserialize(data, connection.msgtype).position[0] for connection, _, data in reader.messages()]


def mcap_summary(file):
    with open(file, "rb") as stream:
        return make_reader(stream, validate_crcs=True).get_summary()
