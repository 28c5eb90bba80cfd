# SPDX-License-Identifier: Apache-2.0
"""How much energy an optimizer draws from the tool in the servo by sets of contacts that say what they like.

    python test/adversary/contacts.py [evaluations a row, default 20000]

Three axes at the demo's gains, T = 1 and 0.25 ms, b = 1.05 (K T/2 + B) in each, budget 5 mJ. `credited`: the most by
which the tank's books were ever above the truth; `moved`, `stayed`: ticks in which the copy moved, and in which the
tank did not cover its move or no answer was found. Then one axis, by the rows of exchange.py for `local`.
"""

import sys
from pathlib import Path

from haptic_device import controller_config

sys.path.append(str(Path(__file__).resolve().parents[1]))  # of this package

from adversary import contact_search
from haptic_device.description import load_device
from haptic_device.parameter_types import defaults
from haptic_device.parameters import NODES

GAINS = {
    "coupling.stiffness": 2000.0,
    "coupling.damping": 2.0,
    "coupling.rotational_stiffness": 2.0,
    "coupling.rotational_damping": 0.002,
}
CASES = [(rate, loss, limit) for rate in (1000.0, 4000.0) for loss in (0.0, 0.3) for limit in (20.0, 2.0)]


def settings(rate=1000.0, limit=20.0, counts=1e9):
    """SETTINGS of three axes with 1.05 times the damping that the gains need, free to move without end."""
    device = load_device("desktop")
    axes = []
    for axis, kind in zip(device.axes, ("", "", "rotational_"), strict=True):
        least = 0.5 * GAINS[f"coupling.{kind}stiffness"] / rate + GAINS[f"coupling.{kind}damping"]
        free = {"damping": 1.05 * least, "counts_per_unit": counts, "velocity_limit": 1e6, "workspace": (-1e6, 1e6)}
        axes.append(axis.model_copy(update=free))
    values = defaults(NODES["haptic_driver"])
    values |= {
        "exchange.method": "local",
        "servo.rate": rate,
        "passivity.control": False,
        "force.limit": limit,
        "force.limit_rotational": limit / 20.0,
    } | GAINS
    return controller_config.settings_from(device.model_copy(update={"axes": tuple(axes)}), values)


def main():
    evaluations = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
    print(f"{evaluations} evaluations a row; budget {1e3 * float(settings()['exchange']['budget'][0]):g} mJ")
    print("servo Hz  loss  limit N    given mJ  credited mJ       moved      stayed")
    for seed, (rate, loss, limit) in enumerate(CASES):
        found = contact_search.search(settings(rate, limit), 120, evaluations, loss, seed)
        print(
            f"{rate:8.0f} {loss:5.1f} {limit:8.0f} {found.energy * 1e3:11.4f} {found.overcredit * 1e3:12.6f} "
            f"{found.moved:11d} {found.stayed:11d}",
            flush=True,
        )


if __name__ == "__main__":
    main()
