# SPDX-License-Identifier: Apache-2.0
"""Which threads of a process are lifted to a real-time priority, and that what they start is not."""

import json
import os
import subprocess
import sys

import pytest

from haptic_device.process import own_environment

_LIFTS = """
import json, os, sys, threading
from haptic_device.realtime import scheduling
wish, priority, said, stop = sys.argv[1], int(sys.argv[2]), {}, threading.Event()

def state(thread):
    return os.sched_getscheduler(thread) & ~os.SCHED_RESET_ON_FORK, os.sched_getparam(thread).sched_priority

def begin(work=lambda: None):
    begun = threading.Event()
    thread = threading.Thread(target=lambda: (work(), begun.set(), stop.wait()))
    thread.start()
    begun.wait()
    return thread.native_id

urgent, ordinary = begin(lambda: scheduling.try_fifo(priority + 1)), begin()
lifted = scheduling.lift_interpreter(wish, priority)
later = begin()
child = os.fork()
if child == 0:
    os._exit(state(0)[0])
threads = {"urgent": urgent, "main": os.getpid(), "ordinary": ordinary, "later": later}
said["lifted"] = {name: state(thread) for name, thread in threads.items()}
said["child"] = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
if os.geteuid() == 0:
    os.seteuid(65534)  # as somebody who has only a limit for it
scheduling.put_back(lifted)
said["after"] = {name: state(thread) for name, thread in threads.items()}
stop.set()
print(json.dumps(said))
"""
PRIORITY = 3
ORDINARY = [os.SCHED_OTHER, 0]


@pytest.mark.parametrize("wish", ["prefer", "require", "off"])
def test_ordinary_threads_are_lifted_where_wished_and_permitted_but_not_what_they_start_and_then_put_back(wish):
    words = [sys.executable, "-c", _LIFTS, wish, str(PRIORITY)]
    done = subprocess.run(words, env=own_environment(), capture_output=True, text=True, timeout=60, check=True)
    said = json.loads(done.stdout)
    lifted, after = said["lifted"], said["after"]
    permitted = lifted["urgent"] == [os.SCHED_FIFO, PRIORITY + 1]
    expected = [os.SCHED_RR, PRIORITY] if permitted and wish != "off" else ORDINARY
    assert lifted["main"] == lifted["ordinary"] == expected
    assert lifted["later"] == ORDINARY and said["child"] == os.SCHED_OTHER
    assert after == {"urgent": lifted["urgent"], "main": ORDINARY, "ordinary": ORDINARY, "later": ORDINARY}
