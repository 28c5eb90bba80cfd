# SPDX-License-Identifier: Apache-2.0
"""Nodes of which a thread fails by an exception that nobody foresaw."""

import sys

from live_nodes import MODULES, SLOW, command
from waiting import run

from haptic_device.process import ending_with_us

SPACE = "/failing"
# A function raises from its n-th call on; `compile` is what makes a kernel ready before it is called.
_FAILING = """
import importlib, itertools, sys
node, place, number = sys.argv.pop(1), sys.argv.pop(1), int(sys.argv.pop(1))
module, *kind, name = place.split(":")
owner = importlib.import_module(module)
owner = getattr(owner, kind[0]) if kind else owner
does, calls = getattr(owner, name), itertools.count(1)
def fails(*given):
    if next(calls) >= number:
        raise RuntimeError("nobody foresaw this")
    return does(*given)
fails.compile = getattr(does, "compile", None)
setattr(owner, name, fails)
sys.exit(importlib.import_module(node).main())
"""
THREADS = {
    ("haptic_driver", "exchange"): ("haptic_device.realtime.exchange_loop:run_exchange", 2),
    ("haptic_driver", "servo"): ("haptic_device.realtime.hardware_interface:SharedMemoryInterface:present", 2),
    ("haptic_driver", "services"): ("haptic_device.nodes.service_thread:ServiceThread:_run", 1),
    ("haptic_driver", "telemetry"): ("haptic_device.nodes.telemetry:Telemetry:_publish_trace", 3),
    ("haptic_loopback", "plant"): ("haptic_device.device.simulated_device:serve", 1),
    ("haptic_loopback", "telemetry"): ("haptic_device.nodes.truth_publisher:TruthPublisher:_bytes", 3),
}


def failing(name, thread, **given):
    """Command line of a node of which this thread fails."""
    place, number = THREADS[name, thread]
    words = command(name, SPACE, **(SLOW if name == "haptic_driver" else {}), **given)
    return [sys.executable, "-c", _FAILING, MODULES[name], place, str(number), *words[3:]]


def sentence(thread):
    return f"the {thread} thread ended: RuntimeError: nobody foresaw this"


def ends_with_its_sentence(name, thread):
    """Runs such a node, and judges that it ends with the sentence and code 1, logged too."""
    ended = run(ending_with_us(failing(name, thread)))
    assert ended.returncode == 1 and "Traceback" not in ended.stderr, ended.stderr
    assert f"{name}: {sentence(thread)}" in ended.stderr.splitlines(), ended.stderr
    assert f"[/failing/{name}]" in ended.stderr or f"[failing.{name}]" in ended.stderr
