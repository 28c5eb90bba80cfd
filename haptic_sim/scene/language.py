# SPDX-License-Identifier: Apache-2.0
"""The scene language: bodies, materials, the tool and its grip, what to measure; immutable, SI, read from YAML.

The plane is x right, y up, theta counter-clockwise. A shape is given in its body's frame. Two materials in contact act
by the geometric mean of their friction and of their restitution, so that like on like gives the number written down.
"""

import math
from collections import Counter
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, ValidationError, field_validator, model_validator

from haptic_device.config import yaml_reader
from haptic_device.config.files import ConfigError, find
from haptic_device.config.refusal import Part, Unit
from haptic_sim.method_registry import offered
from haptic_sim.scene import checks
from haptic_sim.scene.geometry import finest_feature
from haptic_sim.scene.joints import AnyJoint
from haptic_sim.scene.motion import SECONDS, flat_motion
from haptic_sim.scene.refusal import Unfit, found_wrong, is_unfit, with_stand_ins
from haptic_sim.scene.shapes import TOOL, AnySolid, Body, Direction, Material, Number, Point, Pose, Positive, Tool

LONGEST, MOST_PLACES = 200, 31  # characters of a text for people; poses of a way that is shown
Words = Annotated[str, Field(min_length=1, max_length=LONGEST)]
Share = Annotated[Number, Field(gt=0.0, le=1.0)]


class SceneError(ConfigError):
    """A scene that cannot be used: one sentence with file, place in the file, value and what to do.

    Attributes:
        found: one sentence for each error, without the name of the file.

    Examples:
        >>> from haptic_sim.scene.language import SceneError, load
        >>> try:
        ...     load("wal")
        ... except SceneError as error:
        ...     print(str(error)[-18:])
        did you mean wall?
    """


class Measure(Part):
    """How far a point of a body has moved along an axis, as a fraction. Without an axis: how far the body has turned.

    Attributes:
        body: name of the body.
        point: point of the body's frame [m, m].
        axis (Point | None): direction in the plane, of any length; or None.
        start (float): where the fraction is 0 [m | rad]; `from` in YAML.
        end (float): where the fraction is 1 [m | rad]; `to` in YAML.

    Examples:
        >>> from haptic_sim.scene.language import load
        >>> reached = load("wall").measure["reached"]
        >>> round(reached.fraction((0.03, 0.0, 0.0)), 9), round(reached.fraction((0.01, 0.0, 0.0)), 9)
        (0.0, 1.0)
    """

    body: str = TOOL
    point: Point = (0.0, 0.0)
    axis: Direction | None = None
    start: Annotated[Number, Field(alias="from")]
    end: Annotated[Number, Field(alias="to")]

    @model_validator(mode="after")
    def _some_way_to_go(self) -> Self:
        if self.start == self.end:
            raise ValueError("needs from and to that differ")
        return self

    def fraction(self, pose: tuple[float, float, float]) -> float:
        """Fraction of the motion with the body at `pose` (x, y, theta) [m, m, rad]."""
        return (self._come(pose) - self.start) / (self.end - self.start)

    def _come(self, pose: tuple[float, float, float]) -> float:
        if self.axis is None:
            return pose[2]
        (x, y), (ax, ay), (px, py, theta) = self.point, self.axis, pose
        c, s = math.cos(theta), math.sin(theta)
        return ((px + c * x - s * y) * ax + (py + s * x + c * y) * ay) / math.hypot(ax, ay)


class Task(Part):
    """A task for a person in a scene, in words.

    The task is done when each measure of `done` has reached its fraction and, if `force` is given, the hand has felt
    this force in contact.

    Attributes:
        title (str): name of the task.
        goal (str): what to do.
        hint (str): how to do it.
        done (dict[str, float]): {measure: least fraction}.
        force (float | None): required force on the hand [N], or None.
        words (str): text for the progress; `{percent}` stands for the number.
        next: name of the scene that is offered after the task.
        way (tuple[Pose, ...]): poses of the tool that are shown as a guide [m, m, rad]; if there are none, those of the
            scene's motion.
        seconds (float): time of this motion in the guide [s].

    Examples:
        >>> from haptic_sim.scene.language import load
        >>> task = load("wall").task
        >>> task.title, task.force
        ('Press against a wall', 5.0)
    """

    title: Words
    goal: Words
    hint: Annotated[str, Field(max_length=LONGEST)] = ""
    done: dict[str, Share] = {}
    force: Annotated[Positive, Unit("N")] | None = None
    words: Words = "{percent} %"
    next: str = ""
    way: Annotated[tuple[Pose, ...], Field(max_length=MOST_PLACES)] = ()
    seconds: Annotated[Positive, Unit("s")] = SECONDS

    @field_validator("words")
    @classmethod
    def _with_a_place_for_the_number(cls, value: str) -> str:
        if value.count("{percent}") != 1:
            raise ValueError("write {percent} once, where the number shall stand")
        return value

    @model_validator(mode="after")
    def _can_be_done(self) -> Self:
        if not self.done and self.force is None:
            raise ValueError("needs done (measure: least fraction) or force in N")
        return self


class Scene(Part):
    """A named environment with a tool. It is immutable.

    The plane is x right, y up, theta counter-clockwise; a shape is given in its body's frame. The friction of a contact
    is the geometric mean of that of both materials; so is its restitution.

    Attributes:
        name: name of the scene.
        description: what it shows.
        gravity: acceleration along x and y [m/s²].
        method: simulation method that the scene asks for, or None.
        sub_step (float | None): step that the scene asks for [s], or None.
        error (float): largest relative error that the scene accepts, for the fastest motion.
        materials: {name: material}.
        bodies: fixed and movable bodies.
        joints: connections between bodies.
        tool: the tool.
        measure: {name: measure}.
        motion: suggested motion of the hand: parameters `motion.*` of haptic_loopback.
        task: task for a person in the scene, or None.

    Examples:
        >>> from haptic_sim.scene.language import load
        >>> scene = load("peg_in_hole")
        >>> sorted(scene.solids), scene.feature  # [m]
        (['hole', 'tool'], 0.0014142135623730963)
    """

    name: str
    description: str = ""
    gravity: Point = (0.0, 0.0)
    method: str | None = None
    sub_step: Annotated[Positive, Unit("s")] | None = None
    error: Positive = 0.02
    materials: dict[str, Material] = {}
    bodies: tuple[Body, ...] = ()
    joints: tuple[AnyJoint, ...] = ()
    tool: Tool
    measure: dict[str, Measure] = {}
    motion: dict[str, Any] = {}
    task: Task | None = None

    @field_validator("method")
    @classmethod
    def _known_method(cls, value: str | None) -> str | None:
        if value not in (None, *offered()):
            raise ValueError(f"there is no such method; take one of {', '.join(offered())}")
        return value

    @field_validator("motion")
    @classmethod
    def _flat_waypoints(cls, value: dict[str, Any]) -> dict[str, Any]:
        return flat_motion(value)

    @model_validator(mode="after")
    def _holds_together(self) -> Self:
        solids: tuple[AnySolid, ...] = (self.tool, *self.bodies)
        measured = {key: part.body for key, part in self.measure.items()}
        wrong = [
            *checks.wrong_names(solids, self.materials, measured),
            *checks.wrong_goals(self.task.done if self.task else (), measured),
            *checks.wrong_joints(solids, self.joints),
            *checks.overlaps(solids, self.kept_apart),
            *checks.beyond_half_planes(solids),
        ]
        if wrong:
            raise Unfit(wrong)
        return self

    @property
    def solids(self) -> dict[str, AnySolid]:
        """The tool, then the bodies, by name."""
        return {TOOL: self.tool, **{body.name: body for body in self.bodies}}

    @property
    def kept_apart(self) -> set[frozenset[str]]:
        """Pairs of bodies that cannot touch because a joint that is not a spring connects them."""
        return {frozenset(joint.bodies) for joint in self.joints if joint.holds and not joint.collide}

    @property
    def shared_layers(self) -> list[int]:
        """Layers that more than one body is on, in their order."""
        count = Counter(layer for solid in self.solids.values() for layer in solid.layers)
        return sorted(layer for layer, bodies in count.items() if bodies > 1)

    @property
    def driven(self) -> bool:
        """Whether a motor or a belt can do work."""
        belts = any(body.surface_velocity != (0.0, 0.0) for body in self.bodies)
        return belts or any(joint.drive[0] != 0.0 and not joint.locks for joint in self.joints)

    def material(self, solid: AnySolid) -> Material:
        """Material of a body or of the tool; without one, neither friction nor restitution."""
        return self.materials[solid.material] if solid.material else Material()

    @property
    def feature(self) -> float:
        """Finest feature of all shapes [m]: shortest edge or radius."""
        return min(finest_feature(outline) for solid in (self.tool, *self.bodies) for outline in solid.outlines)


def load(name: str | Path) -> Scene:
    """Loads the scene of this name in config/scenes, or of the YAML file at this path. Raises SceneError.

    Args:
        name: a name, or the path of a file.

    Examples:
        >>> from haptic_sim.scene.language import load
        >>> scene = load("wall")
        >>> scene.description, scene.tool.mass  # [kg]
        ('A rigid flat wall and a round tool', 0.1)
    """
    try:
        path = find("scenes", str(name))
        content = yaml_reader.load(path)
    except FileNotFoundError as missing:
        raise SceneError(str(missing)) from None
    except ConfigError as error:
        raise SceneError(str(error), error.found) from None
    return parse(content, str(path))


def parse(content: Any, source: str) -> Scene:
    """Makes a scene from a mapping with the keys of the YAML file.

    Raises SceneError: its text is the first error, and its `found` has all errors.

    Args:
        content: the mapping.
        source: name of the mapping in the sentence of an error.

    Examples:
        >>> from haptic_sim.scene.language import parse
        >>> tool = {"mass": 0.1, "shapes": [{"circle": {"radius": 0.01}}]}
        >>> parse({"name": "free", "tool": tool}, "free.yaml").tool.pose  # [m, m, rad]
        (0.0, 0.0, 0.0)
        >>> parse({"name": "free", "tool": tool | {"mass": -0.1}}, "free.yaml")
        Traceback (most recent call last):
            ...
        haptic_sim.scene.language.SceneError: free.yaml: tool.mass is -0.1: it should be greater than 0 kg
    """
    try:
        return Scene.model_validate(content)
    except ValidationError as error:
        found = [*found_wrong(error, Scene), *_unfit_rest(content, error)]
        raise SceneError(f"{source}: {found[0]}", found) from None


def _unfit_rest(content: Any, error: ValidationError) -> list[str]:
    """What does not fit together of what is right each by itself."""
    if not isinstance(content, dict) or is_unfit(error):
        return []
    try:
        Scene.model_validate(with_stand_ins(content, [found["loc"] for found in error.errors()]))
    except ValidationError as rest:
        return found_wrong(rest, Scene) if is_unfit(rest) else []
    return []
