# SPDX-License-Identifier: Apache-2.0
"""The K-B plane of walls that a device can show (Colgate & Brown 1994): which cells to run, and what came of them."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from haptic_device.config.description import Device
from haptic_device.theory.assessment import Display
from haptic_device.theory.felt import Felt, figures
from haptic_device.theory.quantity import positive
from haptic_device.theory.zwidth import Setup, check_setup, operators_of, theory
from haptic_device.theory.zwidth_map import Request, boundaries, draw_map, empty, write_csv

Show = Callable[[int], object]


def device_figures(device: Device, pose: Felt | None, period: float) -> dict[str, float]:
    """Figures of a Setup from a device's x axis, or at this pose of a linkage, with its delays in periods [s]."""
    positive("period", period, "s")
    late = device.sensing_delay + device.actuation_delay + device.stamp_error
    return {**figures(device, pose), "delay_samples": late / period}


def write_workspace(device: Device, pose: Felt, setup: Setup, out: Path) -> dict[str, Any]:
    """Where the model of a linkage stands, its worst pose; of two joints workspace.png, the stiffness at all others."""
    found: dict[str, Any] = {"pose": pose.values}
    if len(pose.joints) == 2:
        from haptic_device.theory.workspace_figure import save_workspace

        loop = {"period": setup.period, "delay_samples": setup.delay_samples, "velocity_lag": setup.velocity_lag}
        display = Display(0.0, 0.0, pose.damping, **loop)
        found["workspace"] = str(out / "workspace.png")
        save_workspace(device, pose, pose, display, out / "workspace.png")
    return found


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
    assessment, kinds = plane.outcome.assessment, ("quiet", "gives", "shakes")
    lines = {name.replace(" ", "_"): line.tolist() for name, line in boundaries(request, plane, lateness).items()}
    return {
        **request.setup._asdict(),
        "operator": request.operator,
        "cells": int(assessment.size),
        "shares": {name: float(np.mean(assessment == i)) for i, name in enumerate(kinds)},
        "energy_given_max": _finite(np.max(plane.outcome.energy_given)),
        "damping": request.damping.tolist(),
        "stiffness_max": {name: [_finite(value) for value in line] for name, line in lines.items()},
        "csv": str(out / "map.csv"),
        "figure": str(out / "map.png"),
    }


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
