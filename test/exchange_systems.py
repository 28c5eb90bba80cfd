# SPDX-License-Identifier: Apache-2.0
"""Systems with an exchange in them that several tests start from."""

import math
from collections import deque

import numpy as np
from lockstep_systems import device, values

from haptic_device import operating
from haptic_device.device import load_device
from haptic_device.law import engage, servo
from haptic_sim.lockstep import PERFECT, Lockstep
from haptic_sim.scene import load
from haptic_sim.simulation import HandleSample, Simulation
from haptic_sim.tool_port import port_of

GAINS = {
    "coupling__stiffness": 2000.0, "coupling__damping": 2.0, "coupling__rotational_stiffness": 2.0,
    "coupling__rotational_damping": 0.002,
}  # fmt: skip


def demo_system(method, scene="wall", network=PERFECT, motion=None, **driver):
    """The demo's operating point on a scene, with its motion changed; a world that waits for nothing up to 0.2 s."""
    described = load(scene)
    moved = {f"motion__{key}": value for key, value in {**described.motion, **(motion or {})}.items()}
    return Lockstep(
        load_device("desktop"),
        values("haptic_driver", exchange__method=method, **GAINS | driver),
        values("haptic_loopback", **moved),
        Simulation(described, max_catch_up=0.2, port=port_of(method)),
        network,
    )


def one_axis(method, stiffness=1000.0, damping=0.25, period=1e-3, over=1.05, **driver):
    """SETTINGS of one axis without limits of motion, whose physical damping is `over` times K T/2 + B."""
    least = stiffness * period / 2.0 + damping
    shipped = device(over * least, 1e9, axes=1)
    free = {"velocity_limit": 1e6, "workspace": (-1e6, 1e6)}
    shipped = shipped.model_copy(update={"axes": (shipped.axes[0].model_copy(update=free),)})
    given = {"coupling__stiffness": stiffness, "coupling__damping": damping, "servo__rate": 1.0 / period}
    return operating.settings_from(
        shipped, values("haptic_driver", exchange__method=method, passivity__control=False, **given | driver)
    )


def reference(method, late, seconds=6.0):
    """The reference of a late tool: K = 1000 N/m, T = 1 ms, b = 2; tool of 0.05 kg with a damper of 2 N s/m to its set
    position and a wall at 0; handle led 20 mm at 0.5 Hz; `late` samples either way. Mean error [m], energy taken [J].
    """
    scene = load("wall")
    scene = scene.model_copy(update={"tool": scene.tool.model_copy(update={"mass": 0.05, "pose": (0.01, 0.0, 0.0)})})
    settings = one_axis(method, damping=0.0, over=4.0)
    memory, row = np.zeros(1, servo.MEMORY), np.zeros(1, servo.TICK)
    memory["engage"], memory["exchange_fade"], memory["state"] = 1.0, 1.0, engage.ENGAGED
    settings["exchange_hold"] = 10.0
    simulation, record = Simulation(scene, 1e-3, 0.2, port_of(method)), row[0]
    going, coming, errors, taken, before, force = deque(), deque(), [], 0.0, 0.0, 0.0
    for k in range(int(seconds * 1000)):
        position = 0.02 * math.sin(math.pi * k * 1e-3)
        taken -= force * (position - before)
        before = position
        record["latched"] = record["deadline"] = (k + 1) * 1e6
        record["command"], record["device_status"], record["counts"][0] = 1.0, servo.FRESH, position * 1e9
        if len(coming) > late:
            sequence, tool = coming.popleft()
            record["tool_session"], record["tool_sequence"], record["tool_answered"] = 1.0, sequence, sequence
            record["tool_position"][0], record["tool_velocity"][0] = tool.position[0] - 0.01, tool.velocity[0]
            record["tool_effort"][0], record["tool_energy"] = tool.force_on_tool[0], tool.energy
            record["tool_contact"], record["tool_age"] = tool.contact, 2e-3 * late
        servo.tick(settings[0], memory[0], record)
        force = record["force_on_handle"][0]
        port = (record["position"][0] + 0.01, 0.0, 0.0), (record["velocity"][0], 0.0, 0.0)
        shipped = (record["exchange_effort"][0], 0.0, 0.0), record["exchange_energy"]
        going.append((k + 1, HandleSample((k + 1) * 1_000_000, *port, 1000.0, 2.0, 1.0, 0.01, *shipped)))
        if len(going) > late:
            sequence, handle = going.popleft()
            coming.append((sequence, simulation.exchange(handle)))
        errors.append(abs(simulation.method.position[0] - 0.01 - max(0.0, position)))
    return float(np.mean(errors[2000:])), taken
