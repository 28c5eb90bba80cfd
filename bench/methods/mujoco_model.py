# SPDX-License-Identifier: Apache-2.0
"""A scene as MuJoCo's specification: a tree along pins and sliders, loops closed by `connect`, other bodies planar."""

import math

import mujoco
import numpy as np

from bench.methods.world import Impossible
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.geometry import framed, turned
from haptic_sim.scene.joints import WORLD
from haptic_sim.scene.shapes import TOOL, Box, Circle, HalfPlane, Polygon

DEEP = 0.01  # m, half the depth of boxes and prisms
STIFF = (0.99, 0.9999, 1e-5, 0.5, 2.0)
"""MuJoCo's impedance of constraints: almost rigid from a depth of 10 µm on."""
_ORIGIN = (0.0, 0.0, 0.0)
_SLIDE, _HINGE = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE


class Builder:
    """`spec`, and what is needed to read what is made of it.

    `moving` bodies; `turns`: body → hinges from the world to it, each with its sign; `rates`: joint → start's rate.
    """

    def __init__(self, scene, solids, sub_step):
        needs = reduce_scene(scene).needs
        self.scene, self.solids, self.moving = scene, solids, needs.moving
        self.spec, self.soft = mujoco.MjSpec(), (2.0 * sub_step, 1.0)
        self.turns, self.rates, self._made = {WORLD: []}, {}, {WORLD: self.spec.worldbody}
        self._set_options(sub_step)
        self._grow()
        self._add_pairs(needs.touching)
        self._add_servos()

    def _set_options(self, sub_step):
        option = self.spec.option
        option.timestep, option.gravity = sub_step, (*self.scene.gravity, 0.0)
        option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0
        option.solver, option.tolerance, option.iterations = mujoco.mjtSolver.mjSOL_NEWTON, 1e-12, 50

    def _grow(self):
        """A tree from the world along pins and sliders; bodies out of its reach are planar; the rest closes loops."""
        for name, solid in self.solids.items():
            if name not in self.moving:
                if any(solid.surface_velocity):
                    raise Impossible("no belt is written for MuJoCo here")
                _add_shapes(self.spec, self.spec.worldbody, solid, solid.pose)
                self._made[name], self.turns[name] = self.spec.worldbody, []
        left = list(self.scene.joints)
        self._branch_out(left)
        for name in self.moving:
            if name not in self._made:
                self._add_planar(self.solids[name])
                self._branch_out(left)
        for joint in left:
            self._close(joint)

    def _branch_out(self, left):
        """Takes from `left` the joints that lead to bodies not made yet, until there are none."""
        grown = True
        while grown:
            grown = False
            for joint in tuple(left):
                if joint.type not in ("pin", "slider"):
                    raise Impossible(f"no {joint.type} is written for MuJoCo here")
                for parent, child, sign in ((*joint.bodies, 1.0), (*joint.bodies[::-1], -1.0)):
                    if parent in self._made and child not in self._made:
                        self._add_branch(joint, parent, child, sign)
                        left.remove(joint)
                        grown = True

    def _add_planar(self, solid):
        body = self._add_body(self.spec.worldbody, _ORIGIN, solid)
        c, s = math.cos(solid.pose[2]), math.sin(solid.pose[2])
        ways = (c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)
        for axis, kind, direction, rate in zip(
            ("x", "y", "theta"), (_SLIDE, _SLIDE, _HINGE), ways, solid.velocity, strict=True
        ):
            body.add_joint(name=f"{solid.name}.{axis}", type=kind, axis=direction)
            self.rates[f"{solid.name}.{axis}"] = rate
        self._made[solid.name], self.turns[solid.name] = body, [(f"{solid.name}.theta", 1.0)]

    def _add_branch(self, joint, parent, child, sign):
        solid, name = self.solids[child], f"{child}.joint"
        on_plane = parent == WORLD or parent not in self.moving
        above = _ORIGIN if on_plane else self.solids[parent].pose
        body = self._add_body(self._made[parent], above, solid)
        at = (*framed(self._place(joint), solid.pose), 0.0)
        self._made[child], self.turns[child] = body, self.turns[parent]
        if joint.type == "pin":
            made = body.add_joint(name=name, type=_HINGE, axis=(0.0, 0.0, sign), pos=at)
            self.turns[child] = [*self.turns[parent], (name, sign)]
            self.rates[name] = sign * (solid.velocity[2] - (0.0 if on_plane else self.solids[parent].velocity[2]))
        else:
            x, y = (sign * part / math.hypot(*joint.axis) for part in joint.axis)
            axis = (*framed((x, y), (0.0, 0.0, solid.pose[2])), 0.0)
            made = body.add_joint(name=name, type=_SLIDE, axis=axis, pos=at)
            self.rates[name] = x * solid.velocity[0] + y * solid.velocity[1]
        self._equip(made, joint)

    def _add_body(self, parent, frame, solid):
        mass, inertia, (cx, cy) = solid.mass_properties
        body = parent.add_body(
            name=solid.name, pos=(*framed(solid.pose[:2], frame), 0.0), quat=_about_z(solid.pose[2] - frame[2])
        )
        body.mass, body.ipos, body.inertia = mass, (cx, cy, 0.0), (0.6 * inertia, 0.6 * inertia, inertia)
        body.explicitinertial = True
        _add_shapes(self.spec, body, solid, _ORIGIN)
        return body

    def _equip(self, made, joint):
        if joint.motor:
            raise Impossible("no motor is written for MuJoCo here")
        made.frictionloss, made.solref_friction, made.solimp_friction = joint.friction, self.soft, STIFF
        made.stiffness, made.damping = _linear(joint.stiffness), _linear(joint.damping)
        made.springref = joint.rest
        if joint.limits:
            made.limited, made.range = mujoco.mjtLimited.mjLIMITED_TRUE, joint.limits
            made.solref_limit, made.solimp_limit = self.soft, STIFF

    def _close(self, joint):
        if joint.type != "pin" or joint.friction or joint.limits:
            raise Impossible("only a plain pin closes a loop")
        first = self.solids.get(joint.bodies[0])
        equality = self.spec.add_equality(type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_BODY)
        equality.name1, equality.name2 = joint.bodies
        equality.data[:3] = *framed(self._place(joint), first.pose if first else _ORIGIN), 0.0
        equality.solref, equality.solimp = self.soft, STIFF

    def _place(self, joint):
        return joint.places(*(self.solids.get(name) for name in joint.bodies))[0]

    def _add_pairs(self, touching):
        for a, b in touching:
            friction = math.sqrt(math.prod(self.scene.material(self.solids[name]).friction for name in (a, b)))
            for i in range(len(self.solids[a].shapes)):
                for j in range(len(self.solids[b].shapes)):
                    pair = self.spec.add_pair(geomname1=f"{a}.{i}", geomname2=f"{b}.{j}")
                    pair.condim, pair.friction[:2] = 3 if friction > 0.0 else 1, friction
                    pair.solref, pair.solimp = self.soft, STIFF

    def _add_servos(self):
        """The coupling: two on the grip against the world, one on the sum of the hinges, which is never wrapped."""
        self.spec.body(TOOL).add_site(name="grip")
        self.spec.worldbody.add_site(name="origin")
        tendon = self.spec.add_tendon(name="angle")
        for name, sign in self.turns[TOOL]:
            tendon.wrap_joint(name, sign)
        affine, at_grip, tied = mujoco.mjtBias.mjBIAS_AFFINE, mujoco.mjtTrn.mjTRN_SITE, mujoco.mjtTrn.mjTRN_TENDON
        place = {"trntype": at_grip, "target": "grip", "refsite": "origin", "biastype": affine}
        for k in range(2):
            self.spec.add_actuator(name=f"servo{k}", gear=np.eye(6)[k], **place)
        self.spec.add_actuator(name="servo2", trntype=tied, target="angle", biastype=affine)


def _add_shapes(spec, body, solid, frame):
    for k, shape in enumerate(solid.shapes):
        geom = body.add_geom(name=f"{solid.name}.{k}", contype=0, conaffinity=0, pos=(*frame[:2], 0.0))
        turn = frame[2]
        match shape:
            case Circle():
                geom.type, geom.size = mujoco.mjtGeom.mjGEOM_SPHERE, (shape.radius, 0.0, 0.0)
                geom.pos[:2] = turned(shape.center, frame)
            case HalfPlane():
                geom.type, geom.size = mujoco.mjtGeom.mjGEOM_PLANE, (0.0, 0.0, 1.0)
                geom.pos[:2] = turned(shape.point, frame)
                (nx, ny), half = turned(shape.normal, (0.0, 0.0, turn)), math.sqrt(0.5)
                length = math.hypot(nx, ny)
                geom.quat = half, -half * ny / length, half * nx / length, 0.0  # z to the normal
            case Box():
                geom.type, geom.size = mujoco.mjtGeom.mjGEOM_BOX, (*(0.5 * side for side in shape.size), DEEP)
                geom.pos[:2], turn = turned(shape.center, frame), turn + shape.angle
            case Polygon():
                corners = np.array([(x, y, z) for z in (-DEEP, DEEP) for x, y in shape.vertices])
                spec.add_mesh(name=f"{solid.name}.{k}", uservert=corners.ravel())
                geom.type, geom.meshname = mujoco.mjtGeom.mjGEOM_MESH, f"{solid.name}.{k}"
        if shape.bounded:
            geom.quat = _about_z(turn)


def _about_z(angle):
    return math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)


def _linear(factor):
    """MuJoCo's joint springs and dampers are polynomials."""
    return factor, 0.0, 0.0
