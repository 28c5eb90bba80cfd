# SPDX-License-Identifier: Apache-2.0
"""One motion of `python -m bench local --live`: the nodes as processes, messages by DDS, rows from the recording."""

import sys
import tempfile
from pathlib import Path

import numpy as np
import yaml

from haptic_device.analysis.report.summary import energy_figures, engaged_rows, faults
from haptic_device.config_files import find
from haptic_device.recording import load
from haptic_sim.cli.demo import play
from haptic_sim.supervision.processes import interruptible
from haptic_sim.supervision.system import Order


def run(scene, method: str, device, driver: dict, loopback: dict, seconds: float, params: str):
    """Rows of the ticks from engaging on, for this time; energy given to the operator [J]; sets of contacts taken.

    Raises NodeDiedError, OSError, and ValueError with the name of a fault that latched.
    """
    print(f"live: {method}, {scene.name}, {driver.get('servo.rate', 4000.0):.0f} Hz", file=sys.stderr)
    with tempfile.TemporaryDirectory(prefix="haptic_") as folder, interruptible():
        world, hand = (_written(Path(folder) / name, one) for name, one in (("scene", scene), ("device", device)))
        given = {
            "haptic_driver": {**driver, "device": hand},
            "haptic_loopback": {**loopback, "device": hand},
            "haptic_simulation": {"max_catch_up": 0.5},
        }
        stated = find("", params).absolute()
        play(Order(world, seconds + 0.3, Path(folder) / "run", method, None, stated, None, given))
        recording = load(Path(folder) / "run" / "bag")
        if latched := faults(recording):
            raise ValueError(f"{method}, {scene.name}: {', '.join(latched)}")
        rows = engaged_rows(recording.trace).view(np.recarray)
        rows = rows[: np.searchsorted(rows.deadline, rows.deadline[0] + seconds * 1e9)]
        given = max(0.0, energy_figures(recording, rows)["given_to_operator_max"])
        return rows, given, int(recording.last_values("haptic_driver").get("local_sets", 0))


def _written(path, described) -> str:
    path = path.with_suffix(".yaml")
    path.write_text(yaml.safe_dump(described.model_dump(mode="json", by_alias=True, exclude_defaults=True)))
    return str(path)
