# SPDX-License-Identifier: Apache-2.0
"""What every figure of a run is labelled with: gains, period, physical damping, exchange method."""

import numpy as np

from haptic_device.control import exchange_samples
from haptic_device.recording.bag_contents import Recording, Records
from haptic_device.recording.status import number

GAINS = ("stiffness", "damping", "rotational_stiffness", "rotational_damping")
_UNITS = (("K", "N/m"), ("B", "N s/m"), ("Kθ", "N m/rad"), ("Bθ", "N m s/rad"))


def period(rows: Records) -> float:
    """Servo period T [s], the median step of the deadlines."""
    steps = np.diff(rows["deadline"])
    known = steps[np.isfinite(steps)]
    return float(np.median(known)) * 1e-9 if len(known) else np.nan


def gains(recording: Recording) -> dict[str, float]:
    """Coupling gains last sent with the handle: stiffness [N/m], damping [N s/m] and their rotational fellows.

    Empty where they were not recorded.
    """
    if recording.lacks("handle", *GAINS) or not len(recording.joints["handle"].stamp):
        return {}
    return {name: float(recording.joints["handle"].entry(name)[-1]) for name in GAINS}


def conditions(recording: Recording) -> dict[str, str]:
    """Symbols and values of the conditions; empty where gains or exchange method were not recorded."""
    found = gains(recording)
    if not found or recording.lacks("handle", "exchange_method"):
        return {}
    method = recording.joints["handle"].entry("exchange_method")[-1]
    if not np.isfinite(method):
        return {}
    labels = {symbol: f"{value:g} {unit}" for (symbol, unit), value in zip(_UNITS, found.values(), strict=True)}
    said = recording.last_values("haptic_driver")
    if "trace" in recording.clouds:
        labels["T"] = f"{period(recording.trace) * 1e6:.0f} µs"
    elif (rate := number(said.get("rate_hz", ""))) > 0.0:
        labels["T"] = f"{1e6 / rate:.0f} µs"
    if damping := said.get("physical_damping"):
        labels["b"] = _with_units(damping.split(", "))
    return labels | {"exchange": exchange_samples.name_of(int(method))}


def _with_units(damping: list[str]) -> str:
    """Physical damping of the axes x, y, θ, as far as the device has them."""
    angle = f", {damping[2]} N m s/rad" if len(damping) > 2 else ""
    return ", ".join(damping[:2]) + " N s/m" + angle
