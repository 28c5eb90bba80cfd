# SPDX-License-Identifier: Apache-2.0
"""Every group of kernels compiled twice, as one and by plain numba.njit: processor time [s] of either, and their bits.

Each way has an empty cache and a process of its own. Then both calculate the same: the servo in lock-step with every
exchange method, the trace again, all methods on scenes with and without joints, a wall map, an identification. The
digests of what came out must be the same. Exit code 1 if one is not. With --short: without servo and simulation.
"""

import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time

import numpy as np

SHORT = ("wall maps", "identification")


def child(short):
    """Prints {"seconds": {group: s}, "digests": {what: digest}} as JSON."""
    import importlib

    from haptic_device import compiling

    sources = [importlib.import_module(name).GROUPS for name in compiling.SOURCES]
    groups = {name: function for one in sources for name, function in one.items()}
    seconds = {}
    for name in SHORT if short else compiling.names():
        began = time.process_time()
        groups[name]()
        seconds[name] = time.process_time() - began
    found = wall_map()
    if not short:
        found |= {**closed_form(), **servo(), **methods()}
    print(json.dumps({"seconds": seconds, "digests": found}))


def digest(*arrays):
    """Digest of the bytes of arrays."""
    whole = hashlib.sha256()
    for array in arrays:
        whole.update(np.ascontiguousarray(array).tobytes())
    return whole.hexdigest()[:16]


def wall_map():
    """Cells of the K-B plane, and an axis run again."""
    from haptic_device.analysis import zwidth
    from haptic_device.runtime.held_run import run_segments

    setup = zwidth.Setup(mass=0.1, physical_damping=0.5, period=1e-3, coulomb=0.02, resolution=2e-5)
    stiffness, damping = np.meshgrid(np.linspace(100.0, 2000.0, 8), np.linspace(-0.2, 2.0, 8))
    cells = zwidth.run_cells(setup, zwidth.operators_of("light"), stiffness, damping)
    time_, out = np.arange(200) * 1e-3, np.zeros(200)
    forces = np.sin(40.0 * time_)
    run_segments(np.array([0, 100, 200]), time_, time_ + 1e-4, forces, 0.1, 0.5, 0.02, 0.0, 2e-4, np.array([0.0, 0.01]),
                 np.array([0.1, 0.0]), out)  # fmt: skip
    return {"wall map": digest(*cells), "segments": digest(out)}


def closed_form():
    """A tool among flat walls behind the passive port."""
    return {f"wall, {method}": exchanged("wall", "closed_form", method) for method in ("direct", "pspm", "wave")}


def methods():
    """Every method on a scene of each kind."""
    named = "partitioned", "event_driven", "penalty_explicit", "penalty_implicit", "impulse"
    return {f"{scene}, {method}": exchanged(scene, method, "pspm") for scene in ("peg_in_hole", "ratchet")
            for method in named}  # fmt: skip


def exchanged(scene, method, port):
    """Digest of the answers to a quarter of a second of the scene's own motion."""
    from haptic_sim.node.declared import PARAMETERS
    from haptic_sim.scene import load
    from haptic_sim.simulation import HandleSample, Simulation
    from haptic_sim.trial import GAINS, hand

    values = {one.name: one.default for one in PARAMETERS} | {"exchange.method": port, "method": method}
    described = load(scene)
    world, lead = Simulation.by_parameters(described, values), hand(described)
    answers = [world.exchange(HandleSample(k * 1_000_000, lead(k * 1e-3), (0.0, 0.0, 0.0), *GAINS)) for k in range(250)]
    return digest(np.array([(*one.position, *one.velocity, *one.force_on_tool, one.energy) for one in answers]))


def servo():
    """Rows of the servo in lock-step with a peg on its way into the hole, and the same ticks computed again."""
    from haptic_device.device import load_device
    from haptic_device.node.declared import NODES
    from haptic_device.parameters import EXCHANGE_METHODS
    from haptic_device.runtime import recompute
    from haptic_sim.lockstep import Lockstep
    from haptic_sim.node.declared import PARAMETERS
    from haptic_sim.scene import load
    from haptic_sim.simulation import Simulation

    found, scene = {}, load("peg_in_hole")
    values = {node: {one.name: one.default for one in declared} for node, declared in NODES.items()}
    hand = values["haptic_loopback"] | {f"motion.{key}": value for key, value in scene.motion.items()}
    for method in EXCHANGE_METHODS:
        driver = values["haptic_driver"] | {"exchange.method": method}
        world = {one.name: one.default for one in PARAMETERS} | {"exchange.method": method}
        system = Lockstep(load_device("desktop"), driver, hand, Simulation.by_parameters(scene, world))
        system.run(0.2)
        memory, settings = system.memory.copy(), system.settings.copy()
        rows = system.run(0.3)
        again = rows.copy()
        recompute.recompute(settings, memory, again, recompute.NO_SETS)
        found |= {f"servo, {method}": digest(rows), f"again, {method}": digest(again)}
    return found


def run(plain, short):
    """What a child found, with an empty cache."""
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "XDG_CACHE_HOME": cache, "HAPTIC_PLAIN_KERNELS": "1" if plain else ""}
        command = [sys.executable, __file__, "--child", *(["--short"] if short else [])]
        done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def main(short):
    """The table; whether all bits are the same."""
    fused, plain = (run(plain, short) for plain in (False, True))
    print(f"{'group':28} {'as one':>8} {'plain':>8}   processor time [s]")
    for name, seconds in fused["seconds"].items():
        print(f"{name:28} {seconds:8.1f} {plain['seconds'][name]:8.1f}")
    print(f"{'all':28} {sum(fused['seconds'].values()):8.1f} {sum(plain['seconds'].values()):8.1f}")
    other = [name for name, one in fused["digests"].items() if one != plain["digests"][name]]
    print(f"{len(fused['digests'])} calculations, {len(other)} with other bits", *other, sep="  ")
    return not other


if __name__ == "__main__":
    if "--child" in sys.argv:
        child("--short" in sys.argv)
    else:
        sys.exit(0 if main("--short" in sys.argv) else 1)
