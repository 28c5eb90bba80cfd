# SPDX-License-Identifier: Apache-2.0
"""One motion of `python -m bench exchange --live`: the nodes as processes, a relay between driver and simulation."""

import sys
import tempfile
from pathlib import Path

import numpy as np

from haptic_device.analysis.report.summary import energy_figures, engaged_rows, period
from haptic_device.recording import load
from haptic_sim.cli.demo import play
from haptic_sim.supervision.processes import interruptible
from haptic_sim.supervision.system import Order, Relay


def run(case, params: Path, scene: str, motion: dict, patient: dict, seconds: float):
    """Rows of the trace from engaging on; and what else came of the motion. Raises NodeDiedError, ValueError, OSError.

    The tool's error is that of each tool sample against the handle half of its age before.
    """
    from haptic_device.config_files import find

    with tempfile.TemporaryDirectory(prefix="haptic_") as folder, interruptible():
        given = {
            "haptic_driver": {**patient, "exchange.rate": case.rate},
            "haptic_loopback": motion,
            "haptic_simulation": {"max_catch_up": 0.5},
        }
        relay = Relay(case.delay, case.jitter, case.loss)
        out = Path(folder) / "run"
        order = Order(str(find("scenes", scene)), seconds, out, case.method, None, params, relay, given)
        print(f"{case.method}, {scene}, {case.delay * 1e3:g} ms", file=sys.stderr)
        play(order)
        recording = load(out / "bag")
        rows = engaged_rows(recording.trace)
        energies = energy_figures(recording, rows)
    told = {
        "error": _tool_error(rows),
        "given": max(0.0, energies["given_to_operator_max"]),
        "supplied": energies["tool_port_end"],
    }
    return rows.view(np.recarray), told


def _tool_error(rows):
    known = np.flatnonzero((rows["tool_age"] >= 0.0) & (np.arange(len(rows)) > 0.2 * len(rows)))
    then = known - np.round(0.5 * rows["tool_age"][known] / period(rows)).astype(int)
    apart = rows["tool_position"][known] - rows["position"][np.maximum(0, then)]
    return float(np.hypot(apart[:, 0], apart[:, 1]).mean())
