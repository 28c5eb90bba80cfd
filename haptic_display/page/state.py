# SPDX-License-Identifier: Apache-2.0
"""What the running nodes say, as frames for the page. Takes what has come when it looks; nothing wakes it in between.

It listens to what is published for people: `operator/state`, `wrench`, `scene…`, `/diagnostics`; never to the exchange.
"""

import json
import math
import struct
import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from haptic_device.control.withheld import TABLE
from haptic_device.message_fields import AXES, frame_id
from haptic_device.nodes.messages import LATEST, STATE
from haptic_device.recording.layouts import CLOUD, JOINTS, STRING, WRENCH, JointLayout
from haptic_device.recording.status import Status
from haptic_display.client import Client
from haptic_display.page.settings import DRIVER
from haptic_sim.node.scene_publisher import CONTACT, ENERGY, HANDLE, state_names
from haptic_sim.scene.drawing import Drawing, drawing_of
from haptic_sim.scene.language import SceneError, parse
from haptic_sim.scene.shapes import TOOL

STALE = 0.5  # s after which what was said counts no more
NOT_HELD = frozenset(cause.name for cause in TABLE if not cause.holds)
SILENT = 3.0  # s after which a node that said nothing counts as gone
_WRENCH = struct.Struct("<6d")


class Truth(NamedTuple):
    """The loopback's truth in device units: position, target, force of operator and motor on the handle; energy [J]."""

    position: tuple[float, ...]
    target: tuple[float, ...]
    operator_force: tuple[float, ...]
    motor_force: tuple[float, ...]
    energy_given: float


class State:
    """`scene`, `truth`, `statuses` and what `frame` gives are as of the last look."""

    def __init__(self, client: Client):
        self._client = client
        self._wrenches = client.subscribe("wrench", WRENCH, LATEST, raw=True)
        self._scenes = client.subscribe("scene", STRING, STATE)
        self._places = client.subscribe("scene/state", JOINTS, LATEST, raw=True)
        self._clouds = client.subscribe("scene/contacts", CLOUD, LATEST)
        self._layout: JointLayout | None = None
        self._heard: dict[str, float] = {}
        self._map = frame_id(client.node.get_namespace(), "map")
        self.scale = (1.0, 1.0)  # of the device: world metres per device metre, and radians
        self.scene: Drawing | None = None
        self.scene_number = 0
        self.problem = ""
        self.truth: Truth | None = None
        self.statuses: dict[str, Status] = {}
        self.places: dict[str, Any] = {}
        self.contacts: list[list[float]] = []
        self.wrench: list[float] | None = None

    @property
    def axes(self) -> int:
        """How many axes the device has; 0 while no loopback is heard of."""
        return len(self.truth.position) if self.truth else 0

    def look(self) -> None:
        """Takes the newest of everything."""
        now, client = time.monotonic(), self._client
        client.look()
        self.truth = _truth(client.truth) if now < client.truth_heard + STALE else None
        self.statuses = {name: said for name, said in client.statuses.items() if now < client.heard[name] + SILENT}
        for scene in self._scenes.take():
            self._introduce(scene.message.data)
        for name, topic, read in (
            ("places", self._places, self._read_places),
            ("contacts", self._clouds, self._read_contacts),
            ("wrench", self._wrenches, self._read_wrench),
        ):
            sample = topic.latest()
            if sample is not None and read(sample.message):
                self._heard[name] = now
        self._forget(now)

    def frame(self) -> dict[str, Any]:
        """What moves, for one picture; coordinates of handle, target, tool and bodies in the world [m, m, rad]. None is
        what is not known, or is no number. coupled: whether the coupling holds the tool as it is wished for."""
        truth, places = self.truth, self.places
        return {
            "time": time.monotonic(),
            "handle": _known(self._handle()),
            "target": truth and _known(self.to_world(truth.target)),
            "tool": _known(places.get(TOOL)),
            "coupled": NOT_HELD.isdisjoint(self.said(DRIVER, "withheld").split(", ")),
            "bodies": [_known(pose) for pose in places.get("bodies", [])],
            "contacts": [contact for contact in self.contacts if _known(contact)],
            "force": _known(_three(truth.motor_force) if truth else self.wrench),
            "felt": truth and _known([-force for force in _three(truth.operator_force)]),
            "energy": [truth and truth.energy_given, places.get(ENERGY)],
            "results": places.get("results", []),
        }

    def said(self, node: str, entry: str, otherwise: str = "") -> str:
        """Last value of a node's diagnostic entry."""
        return self.statuses[node].values.get(entry, otherwise) if node in self.statuses else otherwise

    def to_world(self, place: Sequence[float]) -> list[float]:
        """A place of the device in the world, the clutch never opened; axes that it lacks are 0."""
        length, angle = self.scale
        return [scale * x for scale, x in zip((length, length, angle), _three(place), strict=True)]

    def _handle(self) -> list[float] | None:
        """As the driver last told the simulation, while there is a driver; else the truth."""
        told = self.places.get(HANDLE) if DRIVER in self.statuses else None
        return told or (self.truth and self.to_world(self.truth.position))

    def _introduce(self, text: str) -> None:
        try:
            scene = parse(json.loads(text), "scene")
            self.scene, self.problem = drawing_of(scene), ""
            self._layout = JointLayout(state_names(scene), self._map)
        except (ValueError, RecursionError, SceneError) as error:
            self.scene, self._layout = None, None
            self.problem = f"the simulation's scene cannot be read: {error}"
        self.scene_number += 1
        self.places, self.contacts = {}, []

    def _read_places(self, data: bytes) -> bool:
        if self._layout is None or self.scene is None or not self._layout.matches(data):
            return False
        _, position, _, _ = self._layout.numbers(data)
        count = 3 * (1 + len(self.scene.solids))
        poses = [position[i : i + 3] for i in range(0, count, 3)]
        self.places = {TOOL: poses[1], "bodies": poses[2:], ENERGY: position[count], "results": position[count + 1 :]}
        if not math.isnan(position[0]):
            self.places[HANDLE] = poses[0]
        return True

    def _read_contacts(self, cloud: Any) -> bool:
        if cloud.point_step != CONTACT.itemsize or len(cloud.data) % CONTACT.itemsize:
            return False
        self.contacts = [row.tolist() for row in np.frombuffer(cloud.data, CONTACT)]
        return True

    def _read_wrench(self, data: bytes) -> bool:
        numbers = _WRENCH.unpack_from(data, len(data) - _WRENCH.size)
        self.wrench = [numbers[0], numbers[1], numbers[5]]
        return True

    def _forget(self, now: float) -> None:
        for name, nothing in (("places", {}), ("contacts", []), ("wrench", None)):
            if now >= self._heard.get(name, -math.inf) + STALE:
                setattr(self, name, nothing)


def _truth(parts: dict[str, tuple[float, float, float]]) -> Truth:
    axes = [axis for axis in AXES if axis in parts]
    hand, motor = [parts[axis] for axis in axes], [parts[f"motor_{axis}"] for axis in axes]
    (position, _, operator), (target, _, force) = zip(*hand, strict=True), zip(*motor, strict=True)
    return Truth(position, target, operator, force, parts["energy_given"][0])


def _known(numbers: Sequence[float] | None) -> Sequence[float] | None:
    return numbers if numbers and all(map(math.isfinite, numbers)) else None


def _three(numbers: Sequence[float]) -> list[float]:
    return [*numbers, *[0.0] * (3 - len(numbers))]
