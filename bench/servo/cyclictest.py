# SPDX-License-Identifier: Apache-2.0
"""cyclictest beside the servo: the least lateness that this machine gives anybody."""

import contextlib
import json
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from haptic_device.realtime.servo_thread import PRIORITY
from haptic_display.run.lateness import Lateness

MISSING = "cyclictest is not installed (Debian, Ubuntu: apt install rt-tests)"
FAILED = f"cyclictest failed, perhaps for want of permission; `cyclictest -q -t1 -l1000 -m -p {PRIORITY}` says why"
_LONGEST = 100_000  # [us] of cyclictest's histogram, which it locks in memory


def cyclictest(rate: float, seconds: float, realtime: str = "prefer") -> Lateness | None:
    """Lateness of cyclictest at the servo's priority; None if it is not installed or fails."""
    if shutil.which("cyclictest") is None:
        return None
    period = round(1e6 / rate)
    policy = ("-p", str(PRIORITY), "-m") if realtime != "off" else ("--policy=other",)
    with tempfile.TemporaryDirectory() as folder:
        told = Path(folder) / "cyclictest.json"
        command = ["cyclictest", "-q", "-t1", *policy, f"-i{period}", f"-l{round(seconds * rate)}"]
        command += [f"-h{_LONGEST}", f"--json={told}"]
        with contextlib.suppress(subprocess.SubprocessError, OSError, ValueError, KeyError):
            subprocess.run(command, capture_output=True, timeout=30.0 + 3.0 * seconds, check=True)
            return _of_histogram(json.loads(told.read_text())["thread"]["0"], period)
    return None


def why_missing() -> str:
    """Why there is nothing of cyclictest."""
    return MISSING if shutil.which("cyclictest") is None else FAILED


def _of_histogram(thread, period):
    counts = {int(late): int(count) for late, count in thread["histogram"].items()}
    within = np.repeat(np.array(sorted(counts), float), [counts[late] for late in sorted(counts)])
    beyond = np.full(max(0, int(thread["cycles"]) - len(within)), float(_LONGEST))  # at least; the latest is known
    beyond[-1:] = float(thread["max"])
    late = np.concatenate([within, beyond])
    return Lateness(late, int(np.sum(late // period)), "cyclictest")  # it too goes on with the next that is to come
