# SPDX-License-Identifier: Apache-2.0
"""Damping cancellation on live nodes: what a circling hand feels, and what walls keep of their bound.

Judged on the loopback's truth. The measured form runs with a driver whose device description is 30 % off. Under
`enforce` the wall is at 95 % of 2b/T where the driver takes it, else, writes being late, at 95 % of what it names.
"""

import contextlib
import re
import tempfile
from pathlib import Path

import yaml

from haptic_device.config_files import find
from haptic_device.description import load_device
from haptic_sim.supervision.pair import running
from haptic_sim.supervision.tuning import Tuning
from haptic_sim.supervision.zwidth import TOUCHED, LiveDisplay, pair

RATE, ENFORCED_RATE, RATIO = 4000.0, 1000.0, 0.92
EXTRA = ("cancellation.source", "cancellation.band")


@contextlib.contextmanager
def live(described, true, rate=RATE, policy="off"):
    """A running pair of a driver with this description and a loopback with that one."""
    driver, loopback = pair(str(described), rate)
    loopback["device"] = str(true)
    with running(None, None, driver, loopback) as (number, room, check):
        tuning = Tuning(number, room)
        with contextlib.closing(tuning):
            tuning.wait_engaged(check)
            with tuning.as_found((*TOUCHED, *EXTRA)):
                display = LiveDisplay(tuning, 0.0, 1.0 / load_device(true).axes[0].counts_per_unit)
                display.free(policy)
                yield display, tuning


def description(folder, share):
    """The desktop device with another damping in its description."""
    content = yaml.safe_load(Path(find("devices", "desktop")).read_text(encoding="utf-8"))
    for axis in content["axes"]:
        axis["damping"] *= share
    path = Path(folder) / f"desktop_{share:g}.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


def felt(display, tuning, source):
    """Damping felt with RATIO of it cancelled [N s/m]."""
    tuning.set(cancellation__source=source)
    return display.turn(RATIO)


def enforced(display, tuning, share, ratio, band):
    """The same with a wall that the driver takes under `enforce`: at this share of 2b/T, or of what it says."""
    try:
        keeps_its_bound(display, tuning, share, ratio, band, ENFORCED_RATE)
    except ValueError as refusal:
        if not (named := re.search(r"at most (\d+) N/m", str(refusal))):
            raise
        print(refusal)
        most = float(named[1]) / (2.0 * load_device("desktop").axes[0].damping * ENFORCED_RATE)
        keeps_its_bound(display, tuning, share * most, ratio, band, ENFORCED_RATE)


def keeps_its_bound(display, tuning, share, ratio, band, rate=RATE):
    """Whether a wall at this share of 2b/T stays calm and gives no energy with this much cancelled before it."""
    stiffness = share * 2.0 * load_device("desktop").axes[0].damping * rate
    tuning.set(cancellation__ratio=ratio, cancellation__source="model", cancellation__band=band)
    shakes = display.show(stiffness)
    tuning.set(cancellation__ratio=0.0)
    print(
        f"wall of {stiffness:.0f} N/m ({share:.0%} of 2b/T), {ratio:.0%} cancelled, band {band * 1e3:g} mm: "
        f"{'shakes' if shakes else 'calm'}, energy given {display.energy_given * 1e3:+.2f} mJ"
    )


def main() -> None:
    """What a circling hand feels with damping cancelled, and what walls keep of their bound."""
    true = load_device("desktop").axes[0].damping
    with tempfile.TemporaryDirectory() as folder:
        with live("desktop", "desktop") as (display, tuning):
            for ratio in (0.0, RATIO):
                print(f"model, {ratio:.0%}: {display.turn(ratio) / true:.1%} of b = {true:g} N s/m is felt")
            for ratio, band in ((0.0, 5e-3), (0.9, 5e-3), (0.9, 1e-5)):
                keeps_its_bound(display, tuning, 0.95, ratio, band)
        with live("desktop", "desktop", ENFORCED_RATE, "enforce") as (display, tuning):
            print("under enforce:")
            for ratio in (0.0, 0.9):
                enforced(display, tuning, 0.95, ratio, 5e-3)
        for share in (0.7, 1.3):
            with live(description(folder, share), "desktop") as (display, tuning):
                left = felt(display, tuning, "measured") / true
                print(f"measured, {RATIO:.0%}, description {share - 1.0:+.0%} off: {left:.1%} of b is felt")
