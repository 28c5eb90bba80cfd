# SPDX-License-Identifier: Apache-2.0
"""Which threads of a process are lifted to a real-time priority, and that what they start is not."""

import functools
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


@functools.cache
def lifts(wish):
    """What the threads of a process of its own have, lifted and after that; and whether it may have it."""
    words = [sys.executable, "-c", _LIFTS, wish, str(PRIORITY)]
    done = subprocess.run(words, env=own_environment(), capture_output=True, text=True, timeout=60, check=True)
    said = json.loads(done.stdout)
    return said, said["lifted"]["urgent"] == [os.SCHED_FIFO, PRIORITY + 1]


@pytest.mark.parametrize("wish", ["prefer", "require"])
def test_ordinary_threads_of_python_are_lifted_where_permitted_urgent_ones_keep_what_they_have(wish):
    said, permitted = lifts(wish)
    expected = [os.SCHED_RR, PRIORITY] if permitted else ORDINARY
    assert said["lifted"]["main"] == said["lifted"]["ordinary"] == expected
    assert said["after"]["urgent"] == said["lifted"]["urgent"]


def test_what_a_lifted_thread_starts_is_ordinary():
    said, _ = lifts("prefer")
    assert said["lifted"]["later"] == ORDINARY and said["child"] == os.SCHED_OTHER


def test_put_back_they_are_ordinary_again():
    said, _ = lifts("prefer")
    assert [said["after"][name] for name in ("main", "ordinary", "later")] == [ORDINARY] * 3


def test_with_realtime_off_nothing_is_changed():
    said, _ = lifts("off")
    assert [said["lifted"][name] for name in ("main", "ordinary", "later")] == [ORDINARY] * 3
