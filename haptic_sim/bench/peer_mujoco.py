# SPDX-License-Identifier: Apache-2.0
"""A scene in MuJoCo, in the coordinates it likes: pins and sliders as a tree, loops closed by `connect`, planar bodies.

Best settings: Newton's solver, elliptic cones, only pairs that can touch, constraints as stiff as a step allows (time
constant 2 h), the coupling as servos, so that RK4 sees it at each stage and `implicitfast` treats its damping
implicitly. Spheres stand for discs: one contact instead of a cylinder's several. MuJoCo has no restitution.
"""

import math

import mujoco
import numpy as np
from mujoco import rollout

from haptic_sim.bench.world import Impossible, between
from haptic_sim.compile import compile_scene
from haptic_sim.compile.model import framed
from haptic_sim.joint import WORLD
from haptic_sim.method import Coupling, Planar
from haptic_sim.scene import Scene
from haptic_sim.shape import turned
from haptic_sim.solid import TOOL

VERSION = f"MuJoCo {mujoco.__version__}"
DEEP = 0.01  # m, half the depth of boxes and prisms
STIFF = (0.99, 0.9999, 1e-5, 0.5, 2.0)
_ORIGIN = (0.0, 0.0, 0.0)
mujoco.set_mju_user_warning(lambda _: None)  # a run that blows up is told by its numbers, not in a file MUJOCO_LOG.TXT
_SLIDE, _HINGE = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE


class World:
    """Implements `haptic_sim.bench.world.World` with one of MuJoCo's integrators."""

    integrator = mujoco.mjtIntegrator.mjINT_EULER
    end_share = 0.0
    """Weight of the force at a step's end in what is booked; the rest is that of its start."""

    def __init__(self, scene: Scene, sub_step: float):
        if compile_scene(scene).needs.restitution:
            raise Impossible("no restitution")
        self._scene, self.supplied, self.book = scene, 0.0, False
        self._solids = {solid.name: solid for solid in (*scene.bodies, scene.tool)}
        builder = _Builder(scene, self._solids, sub_step)
        builder.spec.option.integrator = self.integrator
        self._model = builder.spec.compile()
        self._data = mujoco.MjData(self._model)
        self._ids = {name: self._model.body(name).id for name in builder.moving}
        self._turns = {name: [(int(self._model.joint(hinge).qposadr[0]), sign) for hinge, sign in builder.turns[name]]
                       for name in self._ids}
        for joint, rate in builder.rates.items():
            self._data.qvel[self._model.joint(joint).dofadr[0]] = rate
        self._state = np.empty(mujoco.mj_stateSize(self._model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        self._zero = 0.0, 0.0, scene.tool.pose[2]
        self.couple(Coupling())
        mujoco.mj_forward(self._model, self._data)

    def couple(self, gains: Coupling) -> None:
        """Takes these gains."""
        self._gains, model = gains, self._model
        for k, (stiffness, damping) in enumerate((gains[:2], gains[:2], gains[2:])):
            model.actuator_gainprm[k, 0] = stiffness
            model.actuator_biasprm[k, :3] = 0.0, -stiffness, -damping
        self._lead = np.array([damping / stiffness if stiffness else 0.0 for stiffness, damping in
                               (gains[:2], gains[:2], gains[2:])])

    def follow(self, path: np.ndarray, count: int) -> None:
        """`count` steps from each row of the hand's path to the next, in one call unless energy is booked."""
        model, data = self._model, self._data
        steps = between(path, count)
        # Held over the step: its middle is what a straight way comes to.
        middle = 0.5 * (steps[1:] + steps[:-1])
        wish = middle[:, :3] + self._lead * middle[:, 3:] - self._zero
        if self.book:
            for row in wish:
                self._booked(row)
        else:
            mujoco.mj_getState(model, data, self._state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
            states, _ = rollout.rollout(model, data, self._state, wish, initial_warmstart=data.qacc_warmstart)
            mujoco.mj_setState(model, data, states[0, -1], mujoco.mjtState.mjSTATE_FULLPHYSICS)
        mujoco.mj_kinematics(model, data)

    def pose(self, body: str) -> Planar:
        """Pose of a body's frame."""
        solid = self._solids[body]
        if body not in self._ids:
            return solid.pose
        x, y, _ = self._data.xpos[self._ids[body]]
        turn = sum(sign * self._data.qpos[address] for address, sign in self._turns[body])
        return float(x), float(y), float(solid.pose[2] + turn)

    def energy(self) -> tuple[float, float]:
        """Kinetic and potential energy [J]."""
        self.book = True
        mujoco.mj_forward(self._model, self._data)
        mujoco.mj_energyPos(self._model, self._data)
        mujoco.mj_energyVel(self._model, self._data)
        potential, kinetic = self._data.energy
        return float(kinetic), float(potential)

    def _booked(self, wish):
        """One step, and the work of the coupling in it."""
        model, data = self._model, self._data
        data.ctrl[:] = wish
        mujoco.mj_forward(model, data)
        before, force = self.pose(TOOL), data.actuator_force.copy()
        mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
        force += self.end_share * (data.actuator_force - force)
        self.supplied += sum(f * (b - a) for f, a, b in zip(force, before, self.pose(TOOL), strict=True))


class RungeKutta(World):
    """Runge and Kutta's formula of order 4."""

    integrator, end_share = mujoco.mjtIntegrator.mjINT_RK4, 0.5


class Implicit(World):
    """Velocities implicit in damping, MuJoCo's recommendation."""

    integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST


class _Builder:
    """The scene as MuJoCo's specification: `spec`, and what is needed to read it.

    `moving` bodies; `turns`: body → hinges from the world to it, each with its sign; `rates`: joint → start's rate.
    """

    def __init__(self, scene, solids, sub_step):
        needs = compile_scene(scene).needs
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
        for axis, kind, direction, rate in zip(("x", "y", "theta"), (_SLIDE, _SLIDE, _HINGE), ways, solid.velocity,
                                               strict=True):
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
        body = parent.add_body(name=solid.name, pos=(*framed(solid.pose[:2], frame), 0.0),
                               quat=_about_z(solid.pose[2] - frame[2]))
        body.mass, body.ipos, body.inertia = mass, (cx, cy, 0.0), (0.6 * inertia, 0.6 * inertia, inertia)
        body.explicitinertial = True
        _add_shapes(self.spec, body, solid, _ORIGIN)
        return body

    def _equip(self, made, joint):
        if joint.motor:
            raise Impossible("no motor is written for MuJoCo here")
        made.frictionloss, made.solref_friction, made.solimp_friction = joint.friction, self.soft, STIFF
        made.stiffness, made.damping = _linear(joint.stiffness), _linear(joint.damping)
        made.springref = joint.rest or 0.0
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
        affine, tied = mujoco.mjtBias.mjBIAS_AFFINE, mujoco.mjtTrn.mjTRN_TENDON
        for k, gear in enumerate(((1.0, 0.0), (0.0, 1.0))):
            self.spec.add_actuator(name=f"servo{k}", trntype=mujoco.mjtTrn.mjTRN_SITE, target="grip",
                                   refsite="origin",
                                   biastype=affine, gear=(*gear, 0.0, 0.0, 0.0, 0.0))
        self.spec.add_actuator(name="servo2", trntype=tied, target="angle", biastype=affine)


def _add_shapes(spec, body, solid, frame):
    for k, shape in enumerate(solid.shapes):
        geom = body.add_geom(name=f"{solid.name}.{k}", contype=0, conaffinity=0, pos=(*frame[:2], 0.0))
        outline, turn = shape.outline, frame[2]
        if shape.circle:
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_SPHERE, (outline.radius, 0.0, 0.0)
            geom.pos[:2] = turned(outline.vertices[0], frame)
        elif shape.half_plane:
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_PLANE, (0.0, 0.0, 1.0)
            geom.pos[:2] = turned(shape.half_plane.point, frame)
            (nx, ny), half = turned(shape.half_plane.normal, (0.0, 0.0, turn)), math.sqrt(0.5)
            length = math.hypot(nx, ny)
            geom.quat = half, -half * ny / length, half * nx / length, 0.0  # z to the normal
        elif shape.box:
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_BOX, (*(0.5 * side for side in shape.box.size), DEEP)
            geom.pos[:2], turn = turned(shape.box.center, frame), turn + shape.box.angle
        else:
            corners = np.array([(x, y, z) for z in (-DEEP, DEEP) for x, y in outline.vertices])
            spec.add_mesh(name=f"{solid.name}.{k}", uservert=corners.ravel())
            geom.type, geom.meshname = mujoco.mjtGeom.mjGEOM_MESH, f"{solid.name}.{k}"
        if not shape.half_plane:
            geom.quat = _about_z(turn)


def _about_z(angle):
    return math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)


def _linear(factor):
    """MuJoCo's joint springs and dampers are polynomials."""
    return factor, 0.0, 0.0
