# SPDX-License-Identifier: Apache-2.0
"""How much energy an optimizer draws from each exchange method: at the handle of the servo, and at the tool port.

    python test/adversary/exchange.py [evaluations [method ...]]

One axis, K = 1000 N/m, B = 0.25 N s/m, T = 1 ms, b = 1.05 (KT/2 + B), budget 5 mJ; then the same at a force limit of
2 N, with encoder steps, with the passivity controller on, and with missed ticks. A row is one search; `free` samples
say what they like, `N` is a tool N ticks late that a wall holds now and then. `credited`: the most by which the
account was ever above the truth. The tool port is searched with a tenth of the evaluations: its world is python.
"""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))  # of this package

from exchange_systems import one_axis

from adversary import exchange_search, port_search
from adversary.exchange_search import FREE, Adversary
from haptic_device.config.parameters import EXCHANGE_METHODS
from haptic_sim.exchange import BUDGET
from haptic_sim.exchange.port import port_of
from haptic_sim.exchange.simulation import HandleSample

STIFFNESS, DAMPING, PERIOD, STEP = 1000.0, 0.25, 1e-3, 5e-6
CASES = [Adversary(late, loss) for late in (FREE, 0, 1, 5, 20, 100) for loss in (0.0, 0.3)]


def settings(method, **driver):
    """SETTINGS of one axis with 1.05 times the damping that its gains need, free to move without end."""
    return one_axis(method, STIFFNESS, DAMPING, PERIOD, **driver)


def show(method, what, adversary, given, evaluations, seed):
    ticks = max(150, 3 * adversary.late)
    found = exchange_search.search(given, adversary, ticks, evaluations, seed)
    late = "free" if adversary.late == FREE else f"{adversary.late:d}"
    energy = f"{found.energy * 1e3:12.4f}" if not adversary.books else f"{'':>12}"
    print(
        f"{method:7} {what:14} {late:>5} {adversary.loss:5.1f} {energy} {found.overcredit * 1e3:12.6f} "
        f"{found.force:8.3f} {found.change / PERIOD * 1e-3:9.3f}",
        flush=True,
    )


def main():
    evaluations = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
    methods = sys.argv[2:] or EXCHANGE_METHODS
    budget = float(settings("pspm")["exchange"]["budget"][0])
    print(f"{evaluations} evaluations a row; budget {budget * 1e3:g} mJ")
    print("method  what            late  loss     given mJ  credited mJ  force N    N/ms")
    for method in methods:
        for seed, adversary in enumerate(CASES):
            show(method, "", adversary, settings(method), evaluations, seed)
        limited = settings(method, force__limit=2.0)
        show(method, "limit 2 N", Adversary(reach=3.0, books=1, full=1), limited, evaluations, 20)
        show(method, "limit 2 N", Adversary(loss=0.3), limited, evaluations, 21)
        coarse = settings(method, counts=1.0 / STEP)
        show(method, "step 5 µm", Adversary(coulomb=0.5 * STIFFNESS * STEP, reach=0.1), coarse, evaluations, 22)
        guarded = settings(method, passivity__control=True)
        show(method, "controller on", Adversary(loss=0.3), guarded, evaluations, 24)
        show(method, "controller on", Adversary(20, 0.3), guarded, evaluations, 25)
        show(method, "missed ticks", Adversary(rough=1, books=1, full=1), settings(method), evaluations, 23)
    print(f"\ntool port: supplied beyond what was shipped, {evaluations // 10} evaluations; budget {BUDGET * 1e3:g} mJ")
    for method in methods:
        found = port_search.search(lambda method=method: port_of(method), sample, evaluations=evaluations // 10)
        pull, slew = port_search.fastest(lambda method=method: port_of(method), sample, evaluations // 10)
        print(f"{method:7} {found.energy * 1e3:12.4f} mJ, pull {pull:.3f} N, its change {slew:.3f} N/ms", flush=True)


def sample(number, position, velocity, energy):
    """The handle sample of one axis with the gains of this search."""
    port = (position, 0.0, 0.0), (velocity, 0.0, 0.0)
    return HandleSample(number * 1_000_000, *port, STIFFNESS, DAMPING, 1.0, 0.001, energy=energy)


if __name__ == "__main__":
    main()
