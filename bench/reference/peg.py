# SPDX-License-Identifier: Apache-2.0
"""Fig. 5 of Colgate, Stanley & Brown (1995): how stiff a peg in a hole feels at the handle, over its insertion.

A peg, inserted by L, touches at the mouth and at its tip. The handle, h above the mouth, pulls sideways with the force
F; the peg's line is u(s) = a + φ s at the height s above the mouth. With contacts of stiffness k and a rotation gain
K_θ the energy ½ k a² + ½ k (a − φ L)² + ½ K_θ φ² gives u(h)/F, which for K_θ = 0 is

    K_app = k/((1 + λ)² + λ²),      λ = h/L;        at the handle, behind the coupling: K_app K/(K_app + K)

Rigid contacts leave a free play of ±c (½ + h/L) in a hole c wider than the peg, and then the coupling alone.
"""

from typing import NamedTuple

import numpy as np

from haptic_sim.lockstep.rollout import rollout
from haptic_sim.method.penalty_explicit import PenaltyExplicit
from haptic_sim.method.penalty_implicit import PenaltyImplicit
from haptic_sim.method_registry import make
from haptic_sim.protocol import Coupling
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import Scene

HEIGHT, WIDTH, DEPTH = 0.1, 0.02, 0.25
"""Handle above the mouth, width of the peg, depth of the hole [m]."""
STIFFNESS = 1e4
"""N/m of a contact."""
COUPLING = 2000.0
"""N/m."""
STEP, SETTLING = 1e-4, 0.6
"""s."""
PENALTY = {"penalty_explicit": PenaltyExplicit, "penalty_implicit": PenaltyImplicit}


class Felt(NamedTuple):
    """Beyond the free play: stiffness of the peg at the grip and at the handle behind the coupling [N/m]; play [m]."""

    peg: float
    handle: float
    play: float


def apparent_stiffness(insertion: float, rotation_gain: float = 0.0, stiffness: float = STIFFNESS) -> float:
    """K_app [N/m] of contacts of this stiffness [N/m] with a rotation gain [N m/rad]."""
    energy = np.array(
        [[2.0 * stiffness, -stiffness * insertion], [-stiffness * insertion, stiffness * insertion**2 + rotation_gain]]
    )
    lever = np.array([1.0, HEIGHT])
    return 1.0 / float(lever @ np.linalg.solve(energy, lever))


def behind_coupling(stiffness: float, coupling: float = COUPLING) -> float:
    """Two springs in series [N/m]."""
    return stiffness * coupling / (stiffness + coupling)


def free_play(insertion: float, clearance: float) -> float:
    """± [m] at the handle, without rotation gain."""
    return clearance * (0.5 + HEIGHT / insertion)


def pull_over(place: float, insertion: float, clearance: float, rotation_gain: float = 0.0) -> float:
    """Force [N] of rigid contacts on a handle at `place` [m] ≥ 0: nothing, then the tilt, then the coupling.

    Up to c/2 the peg follows; then it tilts about the mouth, K_θ/h² behind the coupling, until its tip touches.
    """
    touch, tilting = 0.5 * clearance, rotation_gain / HEIGHT**2
    most = tilting * (free_play(insertion, clearance) - touch)
    tilted = behind_coupling(tilting) * (place - touch) if tilting else 0.0
    return max(0.0, min(tilted, most), COUPLING * (place - free_play(insertion, clearance)))


def peg(insertion: float, clearance: float) -> Scene:
    """A peg on a tool in a hole `clearance` [m] wider, no friction, the grip `HEIGHT` above the mouth."""
    half, wall = 0.5 * (WIDTH + clearance), 0.05
    sides = [
        {"name": name, "fixed": True, "shapes": [{"box": {"size": [wall, DEPTH], "center": [x, -0.5 * DEPTH]}}]}
        for name, x in (("left", -half - 0.5 * wall), ("right", half + 0.5 * wall))
    ]
    length = HEIGHT + insertion
    shape = {"box": {"size": [WIDTH, length], "center": [0.0, -0.5 * length]}}
    tool = {"mass": 0.1, "inertia": 3e-4, "pose": [0.0, HEIGHT, 0.0], "shapes": [shape]}
    return Scene.model_validate({"name": "insertion", "bodies": sides, "tool": tool})


def felt(method: str, insertion: float, rotation_gain: float = 0.0, clearance: float = 1e-6) -> Felt:
    """What a method shows at this insertion [m]: a straight line through two pulls of the handle beyond the free play,
    each settled."""
    world, play = _world(method, insertion, clearance, rotation_gain), free_play(insertion, clearance)
    (x0, u0, f0), (x1, u1, f1) = (_settled(world, play + more) for more in (1e-4, 2e-4))
    handle = (f1 - f0) / (x1 - x0)
    grip = (f1 - f0) / (u1 - u0) if abs(u1 - u0) > 1e-12 else np.inf
    return Felt(grip, handle, x1 - f1 / handle)


def force_at(method: str, places, insertion: float, clearance: float, rotation_gain: float) -> list[float]:
    """Force of the coupling [N] with the handle settled at each place [m]."""
    world = _world(method, insertion, clearance, rotation_gain)
    return [_settled(world, place)[2] for place in places]


def _world(method, insertion, clearance, rotation_gain):
    scene = reduce_scene(peg(insertion, clearance))
    world = PENALTY[method](scene, STEP, STIFFNESS) if method in PENALTY else make(method, scene, STEP)
    world.couple(Coupling(COUPLING, 20.0, rotation_gain, 0.02))
    return world


def _settled(world, pull):
    """Handle's place, grip's place, force of the coupling, all along x."""
    rollout(world, np.array([[pull, HEIGHT, 0.0, 0.0, 0.0, 0.0]] * 2), round(SETTLING / STEP))
    return pull, world.position[0], world.force_on_tool[0]
