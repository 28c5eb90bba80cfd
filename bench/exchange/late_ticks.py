# SPDX-License-Identifier: Apache-2.0
"""Energy given by a wall and by a tool at a wall, of 0.95 of the bound of stiffness, where ticks are missed.

In lock-step at 4 kHz, 3 s a press, the worst of `presses` of a row; after a share of the ticks one to `longest` are
missed. Truth of the loopback [mJ], with `passivity.control` and without; budget of `exchange.budget` 5 mJ. The last
column: share of the ticks of all presses with control in which damping was injected or walls had let go.
"""

from typing import Annotated

import numpy as np
import typer

from bench.exchange.stalling import pressed

OF_BOUND = 0.95
STALLS = ((0.0, 1), (0.05, 4), (0.2, 8), (0.05, 16), (0.5, 16), (0.02, 24), (0.02, 40), (0.05, 40))


def main(presses: Annotated[int, typer.Argument(min=1, help="Presses of a row.")] = 3) -> None:
    """Energy given by a wall and by a tool at a wall where ticks are missed."""
    print("after a share of the ticks, up to so many are missed: energy given, mJ")
    print(f"{'what':6} {'share':>6} {'longest':>8} {'control':>9} {'without':>9} {'acts':>7}")
    for what in ("wall", "local", "pspm", "wave"):
        for share, longest in STALLS:
            with_it, without = (
                [pressed(what, OF_BOUND, share, longest, turn, control=control) for turn in range(presses)]
                for control in (True, False)
            )
            acted = np.mean([np.mean(np.diff(rows.injections) > 0.0) for _, rows in with_it])
            worst = (1e3 * max(given for given, _ in some) for some in (with_it, without))
            print(f"{what:6} {share:6.0%} {longest:8d} {next(worst):9.2f} {next(worst):9.2f} {acted:7.1%}", flush=True)
