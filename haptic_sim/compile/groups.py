# SPDX-License-Identifier: Apache-2.0
"""Which groups of compiled kernels (haptic_device/compiling.py) the simulation of a scene needs."""

from haptic_sim.compile import compile_scene
from haptic_sim.scene import Scene

PORT = "closed form"  # with it come the ports, behind which any method stands


def groups_of(scene: Scene, method: str, exchange_method: str) -> tuple[str, ...]:
    """For a simulation of the scene by this method, or `auto`, behind the port of this exchange method."""
    method = compile_scene(scene).method if method == "auto" else method
    own = {
        "closed_form": (),
        "impulse": (),
        "penalty_explicit": ("methods", "methods of penalty"),
        "penalty_implicit": ("methods", "methods of penalty"),
    }.get(method, ("methods",))
    return PORT, *own, *(("local contacts",) if exchange_method == "local" else ())
