# SPDX-License-Identifier: Apache-2.0
"""What is known of a connected device now: from its page, from what bridge and driver say, and where the handle is."""

from haptic_device.recording.status import LEVELS, Status
from haptic_display.device_tools.device_page import Glance, words_of

AXES = {"x": "m", "y": "m", "theta": "rad"}
OLD = 0.5  # [s] beyond which a sample of the page counts no more
BRIDGE = {  # entry of its diagnostics: (figure, unit)
    "device": ("device", ""),
    "link": ("link", ""),
    "port": ("port", ""),
    "connected": ("connected", ""),
    "name": ("name that it tells", ""),
    "firmware": ("firmware", ""),
    "round_trip_us": ("round trip", "us"),
    "delay_us": ("delay of the motor", "us"),
    "clock_error_us": ("clock error", "us"),
    "skew_ppm": ("clock skew", "ppm"),
    "clock_steps": ("clock steps", ""),
    "lost": ("samples lost", ""),
    "refused": ("frames refused", ""),
    "refused_writes": ("writes refused", ""),
    "sessions": ("sessions", ""),
    "reopened": ("line reopened", ""),
    "watchdog_trips": ("watchdog trips", ""),
    "temperature_c": ("temperature", "deg C"),
    "realtime": ("scheduling of the bridge", ""),
    "driven": ("driven", ""),
}
DRIVER = {
    "state": ("state of the driver", ""),
    "fault": ("fault of the driver", ""),
    "late_device": ("late samples", ""),
    "rate_hz": ("servo rate", "Hz"),
}
SERVING = "haptic_bridge", "haptic_loopback"


def figures(statuses: dict[str, Status], page: Glance | None, position: dict[str, float]) -> dict[str, tuple[str, str]]:
    """{figure: (value, unit)} in the order of a table; what nobody tells is left out.

    statuses: fresh ones by node; position: of each axis, or of each joint of a linkage, as `encoder` tells it [m, rad].
    """
    found: dict[str, tuple[str, str]] = {}
    drives = AXES if AXES.keys() >= position.keys() else position  # counts are of these
    for node in (*SERVING, "haptic_driver"):
        if node in statuses:
            found[node] = f"{LEVELS[statuses[node].level]}: {statuses[node].message}", ""
    if page is not None and page.age < OLD:
        found |= {f"counts {axis}": (str(count), "") for axis, count in zip(drives, page.counts, strict=False)}
        found["status of the device"] = words_of(page.status), ""
        found["age of the sample"] = f"{page.age * 1e3:.1f}", "ms"
    elif page is not None:
        found["age of the sample"] = f"{page.age:.1f}: the device is silent", "s"
    found |= {f"position {axis}": (f"{value:+.6f}", AXES.get(axis, "rad")) for axis, value in position.items()}
    for nodes, names in ((SERVING, BRIDGE), (("haptic_driver",), DRIVER)):
        values = {key: value for node in nodes if node in statuses for key, value in statuses[node].values.items()}
        found |= {figure: (values[key], unit) for key, (figure, unit) in names.items() if values.get(key, "") != ""}
    return found


def answering(statuses: dict[str, Status], page: Glance | None) -> bool:
    """Whether a device answers there now."""
    connected = statuses["haptic_bridge"].values.get("connected") if "haptic_bridge" in statuses else "True"
    return page is not None and page.age < OLD and str(connected).lower() == "true"
