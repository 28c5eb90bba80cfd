# SPDX-License-Identifier: Apache-2.0
"""The K-B plane of walls that a device can show (Colgate & Brown 1994): which cells to run, and what came of them."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from haptic_device.config.description import load_device
from haptic_device.theory.quantity import positive
from haptic_device.theory.zwidth import Setup, check_setup, operators_of, theory
from haptic_device.theory.zwidth_map import Request, boundaries, draw_map, empty, write_csv

Show = Callable[[int], object]


def device_figures(name: str, period: float) -> dict[str, float]:
    """Figures of a Setup from a device's x axis, with its delays in periods [s]."""
    positive("period", period, "s")
    device = load_device(name)
    axis = device.axes[0]
    return {
        "mass": axis.mass,
        "physical_damping": axis.damping,
        "coulomb": axis.coulomb,
        "resolution": 1.0 / axis.counts_per_unit,
        "delay_samples": (device.sensing_delay + device.actuation_delay + device.stamp_error) / period,
    }


def request_of(
    setup: Setup, operator: str, stiffness_max: float | None, damping_max: float | None, points: int
) -> Request:
    """The map of points x points cells up to these gains [N/m, N s/m], by theory where they are None. ValueError."""
    check_setup(setup)
    operators_of(operator)
    damping_max = 4.0 * setup.physical_damping if damping_max is None else damping_max
    positive("damping_max", damping_max, "N s/m")
    damping = np.linspace(-setup.physical_damping, damping_max, points)
    if stiffness_max is None:
        stiffness_max = 1.2 * max(line.max() for line in theory(setup, damping[:: max(1, points // 20)]).values())
    positive("stiffness_max", stiffness_max, "N/m")
    return Request(setup, operator, np.linspace(0.0, stiffness_max, points + 1)[1:], damping)


def write_map(request: Request, lateness: float, out: Path, workers: int, scheduler: str, show: Show) -> dict[str, Any]:
    """Draws the map into map.csv and map.png of this folder; its figures. show(rows done) hears how far it is.

    Interrupted or failed, it keeps the rows that were done.
    """
    from haptic_device.theory.zwidth_figure import save_map  # matplotlib, which a refused request does without

    theory(request.setup, request.damping[:1], lateness)
    out.mkdir(parents=True, exist_ok=True)
    plane = empty(request)
    try:
        draw_map(request, workers, show, scheduler, plane)
    finally:
        if plane.done.any():
            write_csv(out / "map.csv", request, plane)
    save_map(request, plane, lateness, out / "map.png")
    lines = {name.replace(" ", "_"): line.tolist() for name, line in boundaries(request, plane, lateness).items()}
    return {
        **request.setup._asdict(),
        "operator": request.operator,
        "cells": int(plane.outcome.assessment.size),
        "shares": {
            name: float(np.mean(plane.outcome.assessment == i)) for i, name in enumerate(("quiet", "gives", "shakes"))
        },
        "energy_given_max": _finite(np.max(plane.outcome.energy_given)),
        "damping": request.damping.tolist(),
        "stiffness_max": {name: [_finite(value) for value in line] for name, line in lines.items()},
        "csv": str(out / "map.csv"),
        "figure": str(out / "map.png"),
    }


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
