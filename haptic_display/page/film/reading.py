# SPDX-License-Identifier: Apache-2.0
"""A recorded run as pictures at an even rate, and the curves below them. Time 0 is that of the report."""

import contextlib
import json
import math
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from haptic_device.config.description import parse as parse_device
from haptic_device.config.parameter_sections import sections
from haptic_device.recording import load
from haptic_device.recording.bag_contents import Joints
from haptic_device.recording.columns import CloudColumns
from haptic_device.recording.reader import Collector, Keep, read
from haptic_display.page.film.clock import Array, Clock
from haptic_display.page.film.curves import AXES, HANDLE, coupling_holds, curves_of, force_on_hand
from haptic_display.page.linkage import linkage_facts
from haptic_display.run.report.run import Run
from haptic_sim.scene.drawing import Drawing, drawing_of
from haptic_sim.scene.geometry import Outline, Pose, Vertices
from haptic_sim.scene.language import Scene, parse
from haptic_sim.scene.shapes import TOOL

EDGE = 0.005  # [m] that is seen around handle and tool
FOLLOWED = 0.5  # of the scene's room: so far outside it a body is still seen


class Film(NamedTuple):
    """What is not known is NaN.

    rate: pictures a second. begin [s]: of the first one. places: (pictures, 3) [m, m, rad] of `handle`, the tool and
    each moving body. curves: (pictures,) of motor, felt [N], stretch [mm], given, supplied [mJ], age, oldest [ms].
    force: (pictures, 2) on the hand [N]. coupled: whether the coupling held. contacts: (picture, x, y [m], force x,
    force y [N]). marks: (time [s], text). first_contact [s]: None without one. room: left, bottom, right, top [m].
    walls: of the servo, as (normal x, normal y, offset [m]). linkage: as page/linkage has it.
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
    linkage: dict[str, Any] | None = None

    @property
    def pictures(self) -> int:
        """How many pictures."""
        return len(self.coupled)

    def frame(self, number: int) -> dict[str, Any]:
        """One picture, as `shapes_of` takes it."""
        known = np.isfinite(self.force[number]).all()
        there = {name: _known(place[number]) for name, place in self.places.items()}
        solids = self.scene.solids[1:] if self.scene else ()
        return {
            "handle": there[HANDLE],
            "tool": there[TOOL],
            "target": None,
            "bodies": [solid.pose if solid.fixed else there.get(solid.name) for solid in solids],
            "coupled": bool(self.coupled[number]),
            "contacts": [(0.0, 0.0, x, y, 0.0, 0.0, *force) for at, x, y, *force in self.contacts if at == number],
            "felt": self.force[number].tolist() if known else None,
            "force": None,
        }


def _known(place: Array) -> Pose | None:
    x, y, angle = place.tolist()
    return (x, y, angle) if math.isfinite(x + y + angle) else None


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
    curves, force, coupled = curves_of(run, clock, state, places), force_on_hand(run, clock), coupling_holds(run, clock)
    told = run.name, drawing, _date(run), _facts(run, drawing), [*notes, *run.notes, *seen.notes]
    shown = places, curves, force, coupled, _contacts(run, clock, seen)
    around = run.marks, _first_contact(run), room_of(places, drawing), _walls(run), _linkage(run)
    return Film(*told, clock.rate, float(clock.times[0]), *shown, *around)


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
        contacts = contents.topics.get(f"{namespace}/scene/contacts")
        self.stamps = contacts.times.stamp[self.clouds.kept] if contacts else np.empty(0, np.int64)
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


def _contacts(run: Run, clock: Clock, seen: _Seen) -> list[tuple[int, float, float, float, float]]:
    clouds, stamps = seen.clouds, seen.stamps
    if not len(stamps):
        return []
    rows, ends = clouds.records(), [*clouds.begins[1:], None]
    if not {"x", "y", "force_x", "force_y"} <= set(rows.dtype.names or ()):
        return []
    found, near = clock.nearest(np.maximum.accumulate(run.since(stamps)))
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


def room_of(places: dict[str, Array], drawing: Drawing | None) -> tuple[float, float, float, float]:
    """Of the scene, and of everywhere that handle and tool went; a body that leaves the scene is followed a little."""
    corners = list(_corners(places[HANDLE], ((0.0, 0.0),), EDGE))
    for outline in drawing.solids[0].outlines if drawing else [Outline(((0.0, 0.0),))]:
        corners += _corners(places[TOOL], outline.vertices, outline.radius or EDGE)
    if drawing:
        low, high = np.reshape(drawing.room, (2, 2))
        corners += [low[None], high[None]]
        for solid in drawing.solids[1:]:
            for vertices, radius in solid.outlines if solid.name in places else ():
                led = np.concatenate(list(_corners(places[solid.name], vertices, radius or EDGE)))
                corners.append(np.clip(led, low - FOLLOWED * (high - low), high + FOLLOWED * (high - low)))
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
    for _, values in sections(run.attached("parameters/haptic_driver.yaml")):
        try:
            normals, offsets = (np.array(values.get(f"wall.{name}", []), float) for name in ("normals", "offsets"))
            walls = np.column_stack([normals.reshape(-1, 2), offsets])
        except (ValueError, TypeError):
            return []
        return [(x, y, offset) for x, y, offset in walls.tolist() if math.isfinite(x + y + offset)]
    return []


def _linkage(run: Run) -> dict[str, Any] | None:
    """Of the device, as attached; None of one that cannot be read."""
    for name in run.recording.attachments:
        if name.startswith("device/"):
            with contextlib.suppress(ValueError):
                return linkage_facts(parse_device(run.attached(name), name))
    return None


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
