# SPDX-License-Identifier: Apache-2.0
"""How closely a late tool follows the handle, how a cut in contact is felt, and what foretelling is worth.

First the reference of test/exchange_systems.py: a handle led 20 mm at 0.5 Hz through a wall, N samples either way. Then
the demo's operating point: the network cut for 0.6 s while the handle presses a wall; and a round trip of 20 ms in
free space, with and without `exchange.agility`.
"""

import tempfile
from pathlib import Path

import numpy as np
import yaml

from bench.exchange.exchange import Case, measure
from haptic_device.config_files import find
from haptic_sim.replay.lockstep import PERFECT, Network

PRESS = {"start": [0.03, 0.0, 0.0], "target": [0.005, 0.0, 0.0], "duration": 8.0}
LATE = 1, 5, 20, 100  # samples each way
SPEED = 0.02  # [m/s] mean of the path, which ends at the wall


def cut(method):
    """Fastest change of force [N/ms] around a cut in contact, time [s] to 90 % of the force, energy given [J]."""
    from exchange_systems import demo_system

    system = demo_system(method, motion=PRESS)
    before = system.run(3.4).force_coupling[-1, 0]
    system.network = Network(loss=1.0)
    gone = system.run(0.6).force_coupling[:, 0]
    system.network = PERFECT
    back = system.run(1.4).force_coupling[:, 0]
    force = np.concatenate([gone, back])
    risen = np.flatnonzero(np.abs(back) > 0.9 * abs(before))
    late = risen[0] * 0.25e-3 if len(risen) else np.inf
    return np.abs(force[4:] - force[:-4]).max(), late, float(system.plant_memory["energy_given"][0])


def main() -> None:
    """How closely a late tool follows the handle, a cut in contact, and what foretelling is worth."""
    from exchange_systems import reference

    for method in ("pspm", "wave"):
        print(
            "{}, cut in contact: force changes by {:.3f} N/ms at most, is back after {:.3f} s; given {:.6f} J".format(
                method, *cut(method)
            ),
            flush=True,
        )
    for method in ("pspm", "wave"):
        for late in LATE:
            error, taken = reference(method, late)
            print(
                f"{method} {late:3d} samples each way: mean error {error * 1e3:.3f} mm "
                f"(of the delay alone: {late * SPEED:.3f}), taken from the hand {taken:.3f} J",
                flush=True,
            )
    given = yaml.safe_load(find("", "demo").read_text())
    [driver] = [node["ros__parameters"] for name, node in given.items() if name.endswith("haptic_driver")]
    with tempfile.TemporaryDirectory() as folder:
        for agility in (0.0, 20.0):
            driver.setdefault("exchange", {})["agility"] = agility
            file = Path(folder) / "point.yaml"
            file.write_text(yaml.safe_dump(given))
            found = measure(Case("pspm", 0.02, 0.0, 0.0, 1000.0), str(file))
            print(
                f"agility {agility:g} m/s^2: drag {found.damping:.3f} N s/m, mass {found.mass:.3f} kg, "
                f"tool error {found.tool_error * 1e3:.2f} mm",
                flush=True,
            )
