# SPDX-License-Identifier: Apache-2.0
"""How much energy an optimizer draws from the tool in the servo by sets of contacts that say what they like.

    python test/adversary/contacts.py [evaluations a row, default 20000]

Three axes at the demo's gains, T = 1 and 0.25 ms, b = 1.05 (K T/2 + B) in each, budget 5 mJ. `credited`: the most by
which the tank's books were ever above the truth; `moved`, `stayed`: ticks in which the copy moved, and in which the
tank did not cover its move or no answer was found. Then one axis, by the rows of exchange.py for `local`.
"""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))  # of this package

from exchange_systems import three_axes

from adversary import contact_search
from haptic_device.control import gain_check

CASES = [(rate, loss, limit) for rate in (1000.0, 4000.0) for loss in (0.0, 0.3) for limit in (20.0, 2.0)]


def settings(rate=1000.0, limit=20.0):
    """SETTINGS of three axes with 1.05 times the damping that the gains need, free to move without end."""
    given = three_axes("local", limit=limit, servo__rate=rate)
    stiffness, damping = (given["coupling"][of][0] for of in ("stiffness", "damping"))
    given["hardware"]["damping"][0] = given["port"]["damping"][0] = 1.05 * (0.5 * stiffness / rate + damping)
    return gain_check.counted(given, 0.0)


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
