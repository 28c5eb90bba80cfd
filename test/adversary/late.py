# SPDX-License-Identifier: Apache-2.0
"""How much energy an optimizer draws from each exchange method where forces act late and settings change.

    python test/adversary/late.py [evaluations [method ...]]

One axis, 1.05 times the physical damping that the driver asks for at the delay described, budget 20 µJ. `drawn`: the
most that was given beyond budget and tank, or that tank and springs were above the truth: 0 where all is paid.
"""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))  # of this package

from adversary.late_cases import BUDGET, CASES, drawn

METHODS = "pspm", "local", "direct"


def main():
    evaluations = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
    print(f"{evaluations} evaluations a row; budget {BUDGET * 1e6:g} µJ")
    print("method  case                    drawn µJ")
    for method in sys.argv[2:] or METHODS:
        for seed, case in enumerate(CASES):
            energy = drawn(method, case, evaluations, seed)
            print(f"{method:7} {case.name:18} {max(0.0, energy) * 1e6:13.3f}", flush=True)


if __name__ == "__main__":
    main()
