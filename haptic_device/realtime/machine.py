# SPDX-License-Identifier: Apache-2.0
"""What this machine lets a servo have: read from the kernel, nothing changed."""

import ctypes
import os
import platform
import resource
import shutil
import threading
from pathlib import Path
from typing import NamedTuple

from haptic_device import jit
from haptic_device.realtime import scheduling

_PR_GET_TIMERSLACK = 30
_LIMITS = "/etc/security/limits.d"


class Check(NamedTuple):
    """What was looked at, what was found, whether that is all one can wish, and else one line on how to get more."""

    name: str
    found: str
    good: bool
    advice: str


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))


def checks(priority: int) -> list[Check]:
    """Everything that sets how late a thread of this priority wakes."""
    return [
        _preemption(),
        _fifo(priority),
        _memory(),
        _slack(),
        _governor(),
        _cores(),
        _clock(),
        _virtual(),
        _throttle(),
        _kernels(),
        _tool("cyclictest", "`apt install rt-tests`; python -m bench servo runs it too"),
    ]


def _preemption():
    version = platform.version()
    full = _read("/sys/kernel/realtime") == "1"
    kind = next((word for word in version.split() if word.startswith("PREEMPT")), "preemption unknown")
    advice = "boot a PREEMPT_RT kernel (Debian: linux-image-rt-amd64; Ubuntu Pro: realtime-kernel)"
    return Check("kernel preemption", f"{'PREEMPT_RT' if full else kind}, Linux {platform.release()}", full, advice)


def _fifo(priority):
    said = []
    # in a thread of its own: what it gets, this one keeps not
    thread = threading.Thread(target=lambda: said.append(scheduling.try_fifo(priority)))
    thread.start()
    thread.join()
    limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
    found = "refused" if said[0] else f"SCHED_FIFO {priority} permitted"
    return Check(
        "real-time priority",
        f"{found}, rtprio limit {limit}",
        not said[0],
        f"`@yourgroup - rtprio 98` in {_LIMITS}/haptic.conf, then log in again",
    )


def _memory():
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    # root may lock all; a page fault in a tick makes it late
    free = limit == resource.RLIM_INFINITY or os.geteuid() == 0
    found = "no limit" if free else f"{limit // 1024} KiB may be locked"
    return Check("locked memory", found, free, f"`@yourgroup - memlock unlimited` in {_LIMITS}/haptic.conf")


def _slack():
    slack = ctypes.CDLL(None).prctl(_PR_GET_TIMERSLACK, 0, 0, 0, 0)
    return Check("timer slack", f"{slack} ns; every loop here sets 1 ns for itself", True, "")


def _governor():
    files = sorted(Path("/sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor"))
    found = {_read(file) for file in files}
    good = found <= {"performance"}
    return Check(
        "frequency governor",
        ", ".join(sorted(map(str, found))) or "none: this machine lets nobody set its clock",
        good,
        "`cpupower frequency-set -g performance`",
    )


def _cores():
    isolated = _read("/sys/devices/system/cpu/isolated")
    found = f"{cores()} of {os.cpu_count()} for this process" + (f", {isolated} isolated" if isolated else "")
    advice = "servo, plant and simulation want a core each: four cores, and `isolcpus=` for the servo's"
    return Check("cores", found, cores() >= 4, advice)


def _clock():
    found = _read("/sys/devices/system/clocksource/clocksource0/current_clocksource") or "unknown"
    advice = "boot with `tsc=reliable` if the processor's counter is steady: reading this clock is slow"
    return Check("clock source", found, found in ("tsc", "kvm-clock", "arch_sys_counter"), advice)


def _virtual():
    virtual = "hypervisor" in (_read("/proc/cpuinfo") or "")
    advice = "run on bare metal: no setting here gives back the time that the host takes"
    return Check("virtual machine", "yes" if virtual else "no", not virtual, advice)


def _throttle():
    # a loop that never sleeps would be stopped for the rest of each second
    share = _read("/proc/sys/kernel/sched_rt_runtime_us") or "unknown"
    found = f"{share} us a second for real-time threads" if share != "-1" else "real-time threads are never stopped"
    return Check("real-time throttle", found, True, "")


def _kernels():
    kept = len(list(jit.folder().rglob("*.nbi")))
    advice = jit.note() or "haptic compile compiles all; else the first start of each does, for some seconds"
    return Check("compiled kernels", f"{kept} kept in {jit.folder()}", kept > 0 and not jit.note(), advice)


def _tool(name, advice):
    return Check(name, "installed" if shutil.which(name) else "not installed", shutil.which(name) is not None, advice)


def _read(path):
    try:
        return Path(path).read_text(errors="replace").strip()
    except OSError:
        return None
