# SPDX-License-Identifier: Apache-2.0
"""A scene in the memory of a compiled method, and what the outside asks of it; the kernel given is the method."""

import numpy as np

from haptic_sim.method.joints import stored_in_springs
from haptic_sim.method.penalty_kernel import contact_energy
from haptic_sim.method.records import records
from haptic_sim.method.sub_step import sub_steps
from haptic_sim.protocol import Contact, Coupling, Planar, StepResult, held
from haptic_sim.reduction import ReducedScene
from haptic_sim.reduction.method_choice import elastic_pair
from haptic_sim.reduction.model import energy_of

RESULTS = [
    *(("port", name) for name in ("supplied", "touched", "largest_force", "deepest_overlap")),
    *(("counters", "left_out"), ("accounts", "contacts"), ("accounts", "correction")),
]
"""Where in the work the parts of a `StepResult` are, in its order."""


class PlanarWorld:
    """A scene stepped by `sub_step` [s] with the kernel `advance`. Implements `World`.

    `stiffness` [N/m] and `damping` [N s/m] of a contact, if not those of the class; stiffness 0 is rigid. ValueError if
    a pair that can touch has a restitution that an elastic contact would not keep.
    """

    inner = 1
    by_events = False
    """Whether the tool too goes from event to event, with the coupling as a force along its way."""

    contact = 0.0, 0.0
    advance = staticmethod(sub_steps)

    def __init__(
        self, reduced: ReducedScene, sub_step: float, stiffness: float | None = None, damping: float | None = None
    ):
        self.scene, self.sub_step, self._reduced = reduced.scene, sub_step, reduced
        given = zip((stiffness, damping), self.contact, strict=True)
        self.contact = tuple(own if one is None else one for one, own in given)
        self._gains = Coupling()
        if self.contact[0] > 0.0 and (refused := elastic_pair(reduced.model, reduced.shape_names)):
            raise ValueError(refused)
        self.reset()
        self.step(held(self.position), 0)  # compiled here, not in the second exchange, which then took 20 s

    def reset(self) -> None:
        """Everything back to the scene's start, with the same gains."""
        self._records = records(self._reduced.model)
        model, work = self._reduced.model, self._records[1]
        self._count = len(model.mass) - 1
        self._tool_pairs = set(np.flatnonzero((model.pair_bodies == 0).any(axis=1)).tolist())
        self._q, self._v, self._force = work["q"][0], work["v"][0], work["port"]["force"][0]
        self._report = work["report"]
        self._pushing, self._pushing_pairs = self._report["count"], self._report["pair"][0]
        self._results = [work[group][name] for group, name in RESULTS]  # an .item() takes .1 µs, a named field 1.5
        work["coupling"]["event_driven"] = self.by_events
        work["contact_model"] = self.contact
        self._couple()
        self._elastic = self._stored_in_contacts()
        self._read()

    def couple(self, coupling: Coupling) -> None:
        """Take these gains from the next sub-step on; ValueError if one is negative or not finite."""
        self._gains = coupling.checked()
        self._couple()

    def step(self, target: np.ndarray, n: int) -> StepResult:
        """Advance `n` sub-steps from each row of the handle's way (m, 6: position, velocity) evenly to the next."""
        for field in self._results:
            field[0] = 0
        self.advance(*self._records, self.sub_step, n, target)
        self._read()
        before, self._elastic = self._elastic, self._stored_in_contacts()
        supplied, touched, force, depth, left_out, taken, correction = (field.item() for field in self._results)
        return StepResult(supplied, touched > 0, force, depth, left_out, taken - (self._elastic - before), correction)

    def contacts(self) -> list[Contact]:
        """Contacts of the last sub-step, sorted by bodies and place."""
        return sorted(self._contact_at(k) for k in range(self._pushing.item()))

    def bodies(self) -> list[tuple[Planar, Planar]]:
        """Pose and velocity of every moving body's mass centre, as in the reduced model."""
        return list(zip(self._q[: self._count].tolist(), self._v[: self._count].tolist(), strict=True))

    def pose(self, body: str) -> Planar:
        """Pose of a body's frame at the end of the sub-step."""
        place = self._reduced.places[body]
        return place.at(self._q[place.body].tolist())

    def energy(self) -> tuple[float, float]:
        """Kinetic and potential energy [J] of bodies, springs and elastic contacts; gravity's is 0 at the origin."""
        model, n = self._reduced.model, self._count
        kinetic, weight = energy_of(model, self._q[:n], self._v[:n])
        springs = stored_in_springs(*self._records) if len(model.joint_kind) else 0.0
        return kinetic, springs + self._elastic + weight

    @property
    def refusals(self) -> int:
        """Sub-steps since the start in which event-driven flight gave up and a backward difference took over."""
        return self._records[1]["counters"]["refusals"].item()

    def _couple(self):
        stiffness, damping, turning_stiffness, turning_damping = self._gains
        coupling = self._records[1]["coupling"][0]
        coupling["stiffness"] = stiffness, stiffness, turning_stiffness
        coupling["damping"] = damping, damping, turning_damping

    def _stored_in_contacts(self):
        return contact_energy(*self._records) if self.contact[0] > 0.0 else 0.0

    def _read(self):
        self.position: Planar = tuple(self._q[0].tolist())
        self.velocity: Planar = tuple(self._v[0].tolist())
        self.force_on_tool: Planar = tuple(self._force.tolist())
        pushing = self._pushing_pairs[: self._pushing.item()].tolist()
        self.touching = any(pair in self._tool_pairs for pair in pushing)

    def _contact_at(self, k):
        a, b = (self._reduced.shape_names[shape] for shape in self._reduced.model.pairs[self._pushing_pairs[k]])
        place, normal, (px, py), overlap = (
            self._report[name][0, k].tolist() for name in ("place", "normal", "impulse", "overlap")
        )
        force = -px / self.sub_step, -py / self.sub_step
        return Contact(a, b, tuple(place), tuple(normal), force, max(overlap, 0.0))
