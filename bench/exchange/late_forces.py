# SPDX-License-Identifier: Apache-2.0
"""The price of forces that act late: the stiffest coupling that the driver takes at a delay, and what the hand feels.

In lock-step at 4 kHz with 1 kHz of exchange, 1 ms round trip, the shipped device with an actuation delay. The gains are
0.95 of the stiffness that gain_check leaves beside B = 0.5 N s/m. Energy given: by the loopback's truth.
"""

from typing import Annotated

import numpy as np
import typer

from bench.exchange import felt
from bench.exchange.exchange import CIRCLE, PRESS
from haptic_device import controller_config, gain_check
from haptic_device.description import load_device

RATE = 4000.0
DELAYS = (0.0, 125e-6, 1e-3)  # [s]
TURNING = {"coupling.rotational_stiffness": 0.05, "coupling.rotational_damping": 0.0}


def stiffest(delay: float) -> float:
    """Largest stiffness [N/m] that the driver takes of a coupling at this delay of the device [s]."""
    device = load_device("desktop").model_copy(update={"actuation_delay": delay})
    driver, low, high = felt.operating_point()["haptic_driver"] | TURNING, 0.0, 1e5
    for _ in range(40):
        middle = 0.5 * (low + high)
        gains = {"servo.rate": RATE, "coupling.stiffness": middle, "coupling.damping": felt.DAMPING}
        settings = controller_config.settings_from(device, driver | gains)
        low, high = (low, middle) if gain_check.refusal(settings[0], delay) else (middle, high)
    return low


def main(methods: Annotated[list[str] | None, typer.Argument(help="Exchange methods.")] = None) -> None:
    """Stiffness felt, drag and age of the tool sample at the stiffest coupling that each delay leaves."""
    print("delay us  method  coupling N/m  felt N/m  drag N s/m  mass kg  age ms  given mJ")
    for delay in DELAYS:
        stiffness = 0.95 * stiffest(delay)
        for method in methods or ("wave", "pspm", "local"):
            gains = {"servo.rate": RATE, "coupling.stiffness": stiffness, "coupling.damping": felt.DAMPING} | TURNING
            pressed, led = (
                felt.run(scene, method, *felt.NETWORKS["1 kHz"], gains, motion, felt.FINE, delay=delay)
                for scene, motion in (("wall", PRESS), ("free_space", CIRCLE))
            )
            held = pressed.rows[int(0.55 * len(pressed.rows)) : int(0.68 * len(pressed.rows))]
            force = held.force_coupling[:, 0]
            rigid = f"{force.mean() / (0.01 - held.position[:, 0].mean()):8.0f}"
            if force.std() > felt.STEADY * abs(force.mean()):  # the handle shakes in the wall
                rigid = f"{'shakes':>8}"
            drag, mass = felt.drag(led.rows)
            age, given = float(np.median(led.rows.tool_age)) * 1e3, max(pressed.given, led.given) * 1e3
            print(
                f"{delay * 1e6:8.0f}  {method:6}  {stiffness:12.0f}  {rigid}  {drag:10.3f}  {mass:7.3f}  "
                f"{age:6.2f}  {given:8.3f}",
                flush=True,
            )
