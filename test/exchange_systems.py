# SPDX-License-Identifier: Apache-2.0
"""Systems with an exchange in them that several tests start from."""

import numpy as np
from lockstep_systems import device, values
from ticks import tick

from adversary import exchange_search as adversary
from haptic_device.config.description import load_device
from haptic_device.control import controller_config, enable_state, faults, records
from haptic_sim.exchange.port import port_of
from haptic_sim.exchange.simulation import Simulation
from haptic_sim.lockstep.lockstep import PERFECT, Lockstep
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

GAINS = {
    "coupling__stiffness": 2000.0,
    "coupling__damping": 2.0,
    "coupling__rotational_stiffness": 2.0,
    "coupling__rotational_damping": 0.002,
}


def demo_system(method, scene="wall", network=PERFECT, motion=None, **driver):
    """The demo's operating point on a scene, with its motion changed; a world that waits for nothing up to 0.2 s."""
    described = load(scene) if isinstance(scene, str) else scene
    moved = {f"motion__{key}": value for key, value in {**described.motion, **(motion or {})}.items()}
    return Lockstep(
        load_device("desktop"),
        values("haptic_driver", exchange__method=method, **GAINS | driver),
        values("haptic_loopback", **moved),
        Simulation(reduce_scene(described), max_catch_up=0.2, port=port_of(method)),
        network,
    )


def one_axis(method, stiffness=1000.0, damping=0.25, period=1e-3, over=1.05, counts=1e9, fastest=1e6, **driver):
    """SETTINGS of one axis without limits of motion, whose physical damping is `over` times K T/2 + B.

    counts: of the encoder [1/m]; fastest: speed limit of the device [m/s].
    """
    least = stiffness * period / 2.0 + damping
    shipped = device(over * least, counts, axes=1)
    free = {"velocity_limit": fastest, "workspace": (-1e6, 1e6)}
    shipped = shipped.model_copy(update={"axes": (shipped.axes[0].model_copy(update=free),)})
    given = {"coupling__stiffness": stiffness, "coupling__damping": damping, "servo__rate": 1.0 / period}
    given |= {"exchange__method": method, "passivity__control": False}
    return controller_config.settings_from(shipped, values("haptic_driver", **given | driver))


def credited(method, seed, scale=(1.0, 1.0), limit=20.0, reach=1.0, wall=0.0, missed=0.0, ticks=160):
    """Most [J] that budget and books of three axes lie above the truth, for a hand that half of the time follows the
    force, and wild tool samples. scale: the device's; wall: stiffness of one at x = 0 beside the coupling;
    missed: share of the ticks that do not happen.
    """
    random, settings = np.random.default_rng(seed), three_axes(method, scale, limit, wall)
    memory, row = adversary.engaged()
    record, period, damping = row[0], settings["period"][0], settings["hardware"]["damping"][0]
    unit = reach * np.array([5.0, 5.0, 0.3]) / settings["coupling"]["stiffness"][0]
    step = reach * 2.5 * period / damping * np.array([1.0, 1.0, 0.05])
    place, way, given, most, wide = np.zeros(3), np.zeros(3), 0.0, -np.inf, int(2.0 ** random.uniform(0.0, 5.0))
    for k in range(ticks):
        place = place + way
        if k == 0 or random.random() >= missed:
            record["latched"] = record["deadline"] = (k + 1) * period * 1e9
            record["command"], record["device_status"] = enable_state.ENABLE, faults.FRESH
            record["counts"] = np.round(place * 1e9)
            _wild_sample(record, random, k, unit)
            tick(settings, memory, row)
            most = max(most, given + adversary.booked(settings[0], memory[0], row.view(records.TICK)[0]))
        if k % wide == 0:
            way = random.normal(size=3) * step
        if random.random() < 0.5:
            way = np.abs(way) * np.sign(record["force_on_handle"])
        given += float(record["force_on_handle"] @ way - (damping * way * way / period).sum())
    return most


def three_axes(method, scale=(1.0, 1.0), limit=20.0, wall=0.0, **driver):
    """SETTINGS of three axes without limits of motion; arguments as of `credited`."""
    shipped = device(3.0, 1e9, axes=3, scale=scale)
    free = {"velocity_limit": 1e6, "workspace": (-1e6, 1e6), "counts_per_unit": 1e9}
    shipped = shipped.model_copy(update={"axes": tuple(axis.model_copy(update=free) for axis in shipped.axes)})
    gains = {name: gain / scale["rotational" in name] ** 2 for name, gain in GAINS.items()}
    walls = {"wall__normals": (1.0, 0.0), "wall__offsets": (0.0,), "wall__stiffness": (wall,), "wall__damping": (0.0,)}
    driver |= {"force__limit": limit, "force__limit_rotational": limit / 20.0, "passivity__control": False}
    given = values("haptic_driver", exchange__method=method, **gains, **walls, **driver)
    return controller_config.settings_from(shipped, given)


def _wild_sample(record, random, number, unit):
    record["tool_session"], record["tool_age"] = 1.0, record["tool_age"] + 0.25e-3
    if random.random() < 0.3:
        return
    near = random.random() < 0.5
    record["tool_answered"] = record["tool_sequence"] = number + 1.0
    record["tool_position"] = near * record["position"] + random.normal(size=3) * unit * (0.2 if near else 1.0)
    record["tool_velocity"], record["tool_contact"] = random.normal(size=3) * [1.0, 1.0, 30.0], random.random() < 0.5
    record["tool_effort"] += random.normal(size=3) * 1e-2
    record["tool_energy"] += abs(random.normal()) * 1e-3
    record["tool_age"] = abs(random.normal()) * 0.03
