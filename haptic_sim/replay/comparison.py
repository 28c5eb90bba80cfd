# SPDX-License-Identifier: Apache-2.0
"""Replays of one recorded hand, and the figures by which they are compared."""

from pathlib import Path

import numpy as np

from haptic_device.analysis.report.run import Run
from haptic_device.status import number

COLUMNS = ("stiffness N/m", "error mm", "energy given mJ", "oscillation", "margin", "CPU %")


def given_at(params: str | None) -> dict[str, dict]:
    """{node: {parameter: value}} of an operating point, a name or a file; empty for none. Raises ValueError."""
    from haptic_device.config_files import find
    from haptic_device.parameter_files import read_operating_point
    from haptic_sim.node_parameters import NODES

    return {} if params is None else read_operating_point(find("", params), NODES)


def replayed(
    bag: Path, namespace: str | None, as_device: bool, given: dict, delay: float, out: Path
) -> tuple[str, ...]:
    """Plays the bag's hand at the given operating point into the new bag `out`; what was wrong with the first one.

    Raises ValueError, one sentence, for an operating point that the driver would refuse.
    """
    from haptic_sim.node_parameters import NODES
    from haptic_sim.replay import rerun
    from haptic_sim.replay.lockstep import Network

    recording = rerun.recorded(bag, namespace)
    declared = {node: NODES[node] for node in ("haptic_driver", "haptic_loopback", "haptic_simulation")}
    given = {node: values for node, values in given.items() if node in declared}
    point = rerun.recorded_point(recording, declared, given)
    rerun.replay(rerun.hand_of(recording, as_device), point, Network(delay), out)
    return recording.notes


def figures_of(run: Run) -> dict[str, str]:
    """The figures of one run by COLUMNS; a dash where the run does not tell."""
    parts = (_stiffness, _error, _energy, _wave, _margin, _cpu)
    return {name: _told(part, run) for name, part in zip(COLUMNS, parts, strict=True)}


def _told(part, run: Run) -> str:
    try:
        return part(run)
    except (ValueError, IndexError):
        return "—"


def _known(values: np.ndarray) -> np.ndarray:
    """Those that are numbers. Raises ValueError if there is none."""
    known = values[np.isfinite(values)]
    if not len(known):
        raise ValueError("nothing of it is a number")
    return known


def _stiffness(run: Run) -> str:
    """Fitted in contact, in the axis that tells most."""
    found = [fitted for (kind, axis), fitted in run.impedances.items() if kind == "contact" and axis != "theta"]
    best = min(found, key=lambda fitted: fitted.stiffness.error / abs(fitted.stiffness.value))
    return f"{best.stiffness.value:.1f} ± {best.stiffness.error:.1f}"


def _error(run: Run) -> str:
    """RMS of the distance from handle to tool."""
    return f"{np.sqrt(np.mean(_known(run.distance) ** 2, dtype=float)) * 1e3:.4f}"


def _energy(run: Run) -> str:
    """Largest energy given to the operator: by the truth, or else by the servo's books."""
    try:
        return f"{np.max(_known(run.ground_truth.entry('energy_given'))) * 1e3:.3f}"
    except ValueError:
        return f"{np.max(_known(run.rows['energy_given'].sum(axis=1))) * 1e3:.3f} booked"


def _wave(run: Run) -> str:
    found = run.spectrum.oscillation
    return "none" if found is None else f"{found.frequency:.0f} Hz, {found.force:.2g} N"


def _margin(run: Run) -> str:
    return f"{float(np.min(_known(run.rows['margin'][:, :2]))):.3f} N s/m"


def _cpu(run: Run) -> str:
    """In lock-step the share of a core that plant, servo and simulation would need in real time."""
    share = number(run.recording.last_values("haptic_replay").get("cpu_share", ""))
    if np.isnan(share):
        raise ValueError("a live run")
    return f"{100 * share:.1f}"
