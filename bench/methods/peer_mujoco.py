# SPDX-License-Identifier: Apache-2.0
"""A scene in MuJoCo, in the coordinates it likes: pins and sliders as a tree, loops closed by `connect`, planar bodies.

Best settings: Newton's solver, elliptic cones, only pairs that can touch, constraints as stiff as a step allows (time
constant 2 h), the coupling as servos, so that RK4 sees it at each stage and `implicitfast` treats its damping
implicitly. Spheres stand for discs: one contact instead of a cylinder's several. MuJoCo has no restitution.
"""

import mujoco
import numpy as np
from mujoco import rollout

from bench.methods.mujoco_model import Builder
from bench.methods.world import Impossible, between
from haptic_sim.protocol import Coupling, Planar, StepResult
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import Scene
from haptic_sim.scene.shapes import TOOL

mujoco.set_mju_user_warning(lambda _: None)  # a run that blows up is told by its numbers, not in a file MUJOCO_LOG.TXT


class World:
    """Implements `bench.methods.world.World` with one of MuJoCo's integrators."""

    integrator = mujoco.mjtIntegrator.mjINT_EULER
    end_share = 0.0
    """Weight of the force at a step's end in what is booked; the rest is that of its start."""

    def __init__(self, scene: Scene, sub_step: float):
        if reduce_scene(scene).needs.restitution:
            raise Impossible("no restitution")
        self._scene, self.book = scene, False
        self._solids = {solid.name: solid for solid in (*scene.bodies, scene.tool)}
        builder = Builder(scene, self._solids, sub_step)
        builder.spec.option.integrator = self.integrator
        self._model = builder.spec.compile()
        self._data = mujoco.MjData(self._model)
        self._ids = {name: self._model.body(name).id for name in builder.moving}
        self._turns = {
            name: [(int(self._model.joint(hinge).qposadr[0]), sign) for hinge, sign in builder.turns[name]]
            for name in self._ids
        }
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
        self._lead = np.array(
            [damping / stiffness if stiffness else 0.0 for stiffness, damping in (gains[:2], gains[:2], gains[2:])]
        )

    def step(self, target: np.ndarray, n: int) -> StepResult:
        """`n` steps from each row of the hand's path to the next, in one call unless energy is booked."""
        model, data = self._model, self._data
        steps = between(target, n)
        # Held over the step: its middle is what a straight way comes to.
        middle = 0.5 * (steps[1:] + steps[:-1])
        wish = middle[:, :3] + self._lead * middle[:, 3:] - self._zero
        supplied = 0.0
        if self.book:
            supplied = sum(self._booked(row) for row in wish)
        else:
            mujoco.mj_getState(model, data, self._state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
            states, _ = rollout.rollout(model, data, self._state, wish, initial_warmstart=data.qacc_warmstart)
            mujoco.mj_setState(model, data, states[0, -1], mujoco.mjtState.mjSTATE_FULLPHYSICS)
        mujoco.mj_kinematics(model, data)
        return StepResult(supplied)

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
        """One step; the work of the coupling in it [J]."""
        model, data = self._model, self._data
        data.ctrl[:] = wish
        mujoco.mj_forward(model, data)
        before, force = self.pose(TOOL), data.actuator_force.copy()
        mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
        force += self.end_share * (data.actuator_force - force)
        return sum(f * (b - a) for f, a, b in zip(force, before, self.pose(TOOL), strict=True))


class RungeKutta(World):
    """Runge and Kutta's formula of order 4."""

    integrator, end_share = mujoco.mjtIntegrator.mjINT_RK4, 0.5


class Implicit(World):
    """Velocities implicit in damping, MuJoCo's recommendation."""

    integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
