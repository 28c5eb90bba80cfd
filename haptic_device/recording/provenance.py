# SPDX-License-Identifier: Apache-2.0
"""How a recording was made: versions, git revision, and what the machine is and allows. No name of host or user."""

import os
import platform
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import psutil

PACKAGES = (
    *("haptic_display", "mcap", "numba", "numpy", "psutil", "pymunk", "python-fcl", "rosbags", "scipy", "zstandard"),
    *("ros-rclpy", "ros-rmw-fastrtps-cpp", "ros-fastrtps"),
)
ROS = "ROS_DISTRO", "RMW_IMPLEMENTATION", "ROS_AUTOMATIC_DISCOVERY_RANGE"
_GIT_PATIENCE = 2.0  # s


def facts() -> dict[str, Any]:
    """Versions of program and libraries, and the machine; a fact that cannot be had is None."""
    memory = psutil.virtual_memory()
    return {
        "program": {"git_revision": git_revision(), "python": sys.version.split()[0]},
        "packages": {name: _version(name) for name in PACKAGES},
        "machine": {
            "system": platform.platform(),
            "processor": _processor(),
            "cores": os.cpu_count(),
            "memory_mib": memory.total // 2**20,
            "clock_source": _read("/sys/devices/system/clocksource/clocksource0/current_clocksource"),
            "realtime_kernel": _read("/sys/kernel/realtime") == "1",
            "realtime_priority_limit": _realtime_limit(),
        },
        "ros": {name: os.environ.get(name) for name in ROS},
    }


def git_revision() -> str | None:
    """Revision of the source tree this program runs from, with -dirty if files differ; None outside a tree."""
    source = Path(__file__).resolve().parents[2]
    if not (source / ".git").exists():
        return None
    command = ["git", "-C", str(source), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        said = subprocess.run(command, capture_output=True, text=True, timeout=_GIT_PATIENCE, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return said.stdout.strip() or None


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _processor() -> str | None:
    lines = (_read("/proc/cpuinfo") or "").splitlines()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), None)


def _realtime_limit() -> int | None:
    if sys.platform != "linux":
        return None
    import resource

    return resource.getrlimit(resource.RLIMIT_RTPRIO)[0]


def _read(path: str) -> str | None:
    try:
        return Path(path).read_text(errors="replace").strip()
    except OSError:
        return None
