# SPDX-License-Identifier: Apache-2.0
"""A recorded run as pictures at an even rate, and the curves below them. Time 0 is that of the report."""

import json
import math
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from haptic_device.analysis.report.run import Run
from haptic_device.control import withheld
from haptic_device.parameter_types import SECTION
from haptic_device.recording import load
from haptic_device.recording.bag_contents import Joints
from haptic_device.recording.columns import CloudColumns
from haptic_device.recording.reader import Collector, Keep, read
from haptic_sim.scene.drawing import Drawing, drawing_of
from haptic_sim.scene.geometry import Outline, Vertices
from haptic_sim.scene.language import Scene, parse
from haptic_sim.scene.shapes import TOOL

RATE = 60.0  # pictures a second
MOST = 36_000  # pictures: of what is longer than ten minutes there are fewer a second
STALE = 0.5  # [s] after which what was said counts no more
EDGE = 0.005  # [m] that is seen around handle and tool
AXES = ("x", "y", "theta")
HANDLE, ENERGY = "handle", "energy"  # in scene/state, beside the solids
NOT_HELD = sum(
    getattr(withheld, name) for name in ("CLUTCH", "WAITING", "NO_TOOL", "FAR_TOOL", "OLD_TOOL", "TANK")
)  # causes by which the coupling does not hold the tool as it is drawn
Array = npt.NDArray[np.float64]


class Film(NamedTuple):
    """What is not known is NaN.

    rate: pictures a second. begin [s]: of the first one. places: (pictures, 3) [m, m, rad] of `handle`, the tool and
    each moving body. curves: (pictures,) of motor, felt [N], stretch [mm], given, supplied [mJ], age, oldest [ms].
    force: (pictures, 2) on the hand [N]. coupled: whether the coupling held. contacts: (picture, x, y [m], force x,
    force y [N]). marks: (time [s], text). first_contact [s]: None without one. room: left, bottom, right, top [m].
    walls: of the servo, as (normal x, normal y, offset [m]).
    """

    name: str
    scene: Drawing | None
    date: str
    facts: list[tuple[str, str]]
    notes: list[str]
    rate: float
    begin: float
    places: dict[str, Array]
    curves: dict[str, Array]
    force: Array
    coupled: npt.NDArray[np.bool_]
    contacts: list[tuple[int, float, float, float, float]]
    marks: list[tuple[float, str]]
    first_contact: float | None
    room: tuple[float, float, float, float]
    walls: list[tuple[float, float, float]]

    @property
    def pictures(self) -> int:
        """How many pictures."""
        return len(self.coupled)


class Clock:
    """The even times of a film from begin to end [s]."""

    def __init__(self, begin: float, end: float) -> None:
        self.rate = min(RATE, MOST / max(end - begin, 1.0))
        self.times = begin + np.arange(math.floor((end - begin) * self.rate) + 1) / self.rate

    def nearest(self, times: Array) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
        """Of each picture, which of these times [s], rising, is nearest, and whether it counts: what was said counts
        for STALE, what is said later does not yet."""
        if not len(times):
            return np.zeros(len(self.times), np.intp), np.zeros(len(self.times), bool)
        right = np.clip(np.searchsorted(times, self.times), 1, max(1, len(times) - 1))
        left = right - 1
        right = np.minimum(right, len(times) - 1)
        since, until = self.times - times[left], times[right] - self.times
        found = np.where((np.abs(until) < np.abs(since)) & (until <= 1.0 / self.rate), right, left)
        age = self.times - times[found]
        return found, (age >= -1.0 / self.rate) & (age <= STALE)

    def at(self, times: Array, values: Array) -> Array:
        """The values nearest to each picture; NaN where there is none."""
        order = np.argsort(times, kind="stable")
        found, near = self.nearest(times[order])
        shown = np.full((len(self.times), *values.shape[1:]), np.nan)
        shown[near] = values[order[found[near]]]
        return shown

    def mean(self, times: Array, values: Array) -> Array:
        """The mean of what belongs to each picture, else what is nearest."""
        shown, (place, known) = self.at(times, values), self._cells(times, values)
        count = np.bincount(place, minlength=len(self.times))
        total = np.bincount(place, known, len(self.times))
        return np.divide(total, count, out=shown, where=count > 0)

    def largest(self, times: Array, values: Array) -> Array:
        """The largest of what belongs to each picture, else what is nearest."""
        shown, (place, known) = self.at(times, values), self._cells(times, values)
        most = np.full(len(self.times), -np.inf)
        np.maximum.at(most, place, known)
        return np.where(np.isfinite(most), most, shown)

    def _cells(self, times: Array, values: Array) -> tuple[npt.NDArray[np.intp], Array]:
        place = np.round((times - self.times[0]) * self.rate)
        chosen = np.isfinite(values) & (place >= 0) & (place < len(self.times))
        return place[chosen].astype(np.intp), values[chosen]


def film_of(run: Run) -> Film:
    """The film of a run. Raises ValueError if nothing of it can be seen: neither scene/state nor handle."""
    seen, notes = _Seen(run), []
    state, scene = seen.state, seen.scene
    clock = Clock(*_span(run, state))
    if state is None:
        notes.append("the scene was not recorded: handle and tool are shown as the driver has them, bodies are not")
    elif scene is None:
        notes.append("the bag does not describe the scene that scene/state is of: bodies are not shown")
    drawing = drawing_of(scene) if scene else None
    places = _places(run, clock, state, drawing, notes)
    curves = _curves(run, clock, state, places)
    return Film(
        run.name,
        drawing,
        _date(run),
        _facts(run, drawing),
        [*notes, *run.notes, *seen.notes],
        clock.rate,
        float(clock.times[0]),
        places,
        curves,
        _force(run, clock),
        _coupled(run, clock),
        _contacts(run, clock, seen.clouds),
        run.marks,
        _first_contact(run),
        _room(places, drawing),
        _walls(run),
    )


def _span(run: Run, state: Joints | None) -> tuple[float, float]:
    """Begin and end [s]: from the first to the last tick, and for as long as the scene was shown."""
    if state is None or not len(state.stamp):
        return 0.0, run.length
    shown = run.since(state.stamp)
    return min(0.0, float(shown.min())), max(run.length, float(shown.max()))


class _Seen:
    """What the simulation showed: `state` (scene/state), the `scene` that it is of, or None; `clouds` of contacts."""

    def __init__(self, run: Run) -> None:
        bag, namespace = run.recording.bag, run.recording.namespace
        self.state = load(bag, namespace, {"scene/state": None}).joints.get("scene/state")
        self.clouds, said = CloudColumns(), Keep()
        kept: dict[str, Collector] = {f"{namespace}/scene/contacts": self.clouds, f"{namespace}/scene": said}
        contents = read(bag, lambda topic, type_name: kept.get(topic))
        self.notes: list[str] = [t.refused for n, t in contents.topics.items() if n in kept and t.refused]
        self.scene = _scene_of(run, self.state.names, said.data) if self.state else None


def _scene_of(run: Run, names: tuple[str, ...], messages: list[bytes]) -> Scene | None:
    """The newest description whose bodies are those of scene/state: as the simulation said it, else as attached."""
    texts = [_text(message) for message in reversed(messages)]
    texts += [run.attached(name) for name in reversed(run.recording.attachments) if name.startswith("scene/")]
    for content in texts:
        try:
            scene = parse(content, "scene")
        except (ValueError, RecursionError):
            continue
        if names[: 3 * (2 + len(scene.bodies))] == tuple(_poses(scene)):
            return scene
    return None


def _poses(scene: Scene) -> Iterator[str]:
    """The first names of scene/state: its poses."""
    for solid in (HANDLE, TOOL, *(body.name for body in scene.bodies)):
        yield from (f"{solid}.{axis}" for axis in AXES)


def _text(message: bytes) -> Any:
    """A std_msgs/String in CDR, as JSON; None if it is none."""
    try:
        return json.loads(message[8 : 8 + int.from_bytes(message[4:8], "little")].rstrip(b"\0"))
    except (ValueError, RecursionError):
        return None


def _places(
    run: Run, clock: Clock, state: Joints | None, drawing: Drawing | None, notes: list[str]
) -> dict[str, Array]:
    if state is not None and len(state.stamp):
        bodies = [solid.name for solid in drawing.solids if not solid.fixed] if drawing else [TOOL]
        names = dict.fromkeys([HANDLE, TOOL, *bodies])
        since = run.since(state.stamp)
        found = {name: clock.at(since, np.stack([state.entry(f"{name}.{a}") for a in AXES], 1)) for name in names}
        if np.isfinite(found[TOOL]).any():
            return found
    by_axis = [run.places(axis) for axis in range(3)]
    found = {
        name: np.stack([clock.at(np.asarray(one[name][0]), np.asarray(one[name][1], float)) for one in by_axis], 1)
        for name in by_axis[0]
    }
    if HANDLE not in found or not np.isfinite(found[HANDLE]).any():
        raise ValueError(
            f"bag {run.recording.bag} says neither where the handle was nor the scene: a film has nothing to show"
        )
    if TOOL not in found or not np.isfinite(found[TOOL]).any():
        notes.append("no tool was heard of: the handle is shown alone")
    return {TOOL: np.full_like(found[HANDLE], np.nan)} | found


def _curves(run: Run, clock: Clock, state: Joints | None, places: dict[str, Array]) -> dict[str, Array]:
    nothing = np.full(len(clock.times), np.nan)
    distance = 1e3 * np.hypot(*(places[TOOL] - places[HANDLE])[:, :2].T)
    curves = {"motor": nothing, "felt": nothing, "stretch": distance, "given": nothing, "supplied": nothing}
    curves |= {"age": nothing, "oldest": nothing}
    if (motor := _motor(run)) is not None:
        curves["motor"] = clock.mean(motor[0], np.hypot(*motor[1].T))
    if (felt := _felt(run)) is not None:
        curves["felt"] = clock.mean(felt[0], np.hypot(*felt[1].T))
        if "energy_given" in run.ground_truth.names:
            curves["given"] = 1e3 * clock.at(felt[0], run.ground_truth.entry("energy_given"))
    if state is not None and ENERGY in state.names:
        curves["supplied"] = 1e3 * clock.at(run.since(state.stamp), state.entry(ENERGY))
    if run.traced:
        age = np.where(run.rows["tool_age"] >= 0.0, 1e3 * run.rows["tool_age"].astype(float), np.nan)
        curves["age"], curves["oldest"] = clock.mean(run.seconds, age), clock.largest(run.seconds, age)
        if felt is None:  # nobody tells the truth: the servo's own account
            curves["given"] = 1e3 * clock.at(run.seconds, run.rows["energy_given"].sum(axis=1, dtype=float))
    return curves


def _motor(run: Run) -> tuple[Array, Array] | None:
    """Times [s], and force of the motor on the handle in x and y [N]; None if it was not recorded."""
    if run.traced:
        return run.seconds, run.rows["force_on_handle"][:, :2].astype(float)
    try:
        parts = [run.forces(axis).get("on handle") for axis in (0, 1)]
    except ValueError:
        return None
    return None if parts[0] is None else (parts[0][0], np.stack([part[1] for part in parts if part], 1))


def _felt(run: Run) -> tuple[Array, Array] | None:
    """Times [s], and force that the operator's model felt in x and y [N]; None if it was not recorded."""
    if "operator/state" not in run.recording.joints:
        return None
    truth = run.ground_truth
    zero = np.zeros(len(truth.stamp))
    force = [-truth.entry(axis, "effort") if axis in truth.names else zero for axis in AXES[:2]]
    return np.asarray(run.ground_truth_seconds), np.stack(force, 1)


def _force(run: Run, clock: Clock) -> Array:
    """On the hand in x and y [N], (pictures, 2): as felt, else that of the motor."""
    felt = _felt(run)
    found = felt if felt is not None and len(felt[0]) else _motor(run)
    if found is None:
        return np.full((len(clock.times), 2), np.nan)
    return np.stack([clock.mean(found[0], found[1][:, axis]) for axis in (0, 1)], 1)


def _coupled(run: Run, clock: Clock) -> npt.NDArray[np.bool_]:
    if not run.traced:
        return np.ones(len(clock.times), bool)
    bits = clock.at(run.seconds, np.asarray(run.rows["withheld"], float))
    return (np.nan_to_num(bits).astype(np.int64) & NOT_HELD) == 0


def _contacts(run: Run, clock: Clock, clouds: CloudColumns) -> list[tuple[int, float, float, float, float]]:
    if not clouds.stamps:
        return []
    rows, ends = clouds.records(), [*clouds.begins[1:], None]
    if not {"x", "y", "force_x", "force_y"} <= set(rows.dtype.names or ()):
        return []
    found, near = clock.nearest(np.maximum.accumulate(run.since(np.array(clouds.stamps, np.int64))))
    return [
        (picture, float(row["x"]), float(row["y"]), float(row["force_x"]), float(row["force_y"]))
        for picture in np.flatnonzero(near).tolist()
        for row in rows[clouds.begins[found[picture]] : ends[found[picture]]]
        if math.isfinite(sum(row[name] for name in ("x", "y", "force_x", "force_y")))
    ]


def _first_contact(run: Run) -> float | None:
    try:
        return run.contacts[0].begin if run.contacts else None
    except ValueError:  # there is neither trace nor tool
        return None


def _room(places: dict[str, Array], drawing: Drawing | None) -> tuple[float, float, float, float]:
    """Of the scene, and of everywhere that handle and tool went."""
    corners = list(_corners(places[HANDLE], ((0.0, 0.0),), EDGE))
    for outline in drawing.solids[0].outlines if drawing else [Outline(((0.0, 0.0),))]:
        corners += _corners(places[TOOL], outline.vertices, outline.radius or EDGE)
    if drawing:
        corners += [np.reshape(drawing.room, (2, 2))]
    seen = np.concatenate(corners)
    (left, bottom), (right, top) = seen.min(axis=0).tolist(), seen.max(axis=0).tolist()
    return left, bottom, right, top


def _corners(place: Array, vertices: Vertices, around: float) -> Iterator[Array]:
    """Each of these points of a frame at all its poses, with as much around it [m]."""
    x, y, angle = place[np.isfinite(place).all(axis=1)].T
    c, s = np.cos(angle), np.sin(angle)
    for px, py in vertices:
        point = np.stack([x + c * px - s * py, y + s * px + c * py], 1)
        yield from (point - around, point + around)


def _walls(run: Run) -> list[tuple[float, float, float]]:
    """Of the servo, as attached; none that cannot be read."""
    for node in run.attached("parameters/haptic_driver.yaml").values():
        given = node.get(SECTION) if isinstance(node, dict) else None
        values = given if isinstance(given, dict) else {}
        try:
            normals, offsets = (np.array(values.get(f"wall.{name}", []), float) for name in ("normals", "offsets"))
            walls = np.column_stack([normals.reshape(-1, 2), offsets])
        except (ValueError, TypeError):
            return []
        return [(x, y, offset) for x, y, offset in walls.tolist() if math.isfinite(x + y + offset)]
    return []


def _date(run: Run) -> str:
    try:
        return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(run.span[0] * 1e-9))
    except ValueError:  # there is no message with a time
        return ""


def _facts(run: Run, drawing: Drawing | None) -> list[tuple[str, str]]:
    said, trial = run.recording.last_values("haptic_simulation"), run.attached("trial.yaml")
    facts = [("recording", run.name), ("scene", drawing.name if drawing else said.get("scene", "not recorded"))]
    facts += [("method", said["method"])] if "method" in said else []
    facts += [("date", _date(run)), ("length", f"{run.length:.1f} s")]
    facts += [(name, str(value)) for name, value in trial.items() if value]
    return facts + list(run.conditions.items())
