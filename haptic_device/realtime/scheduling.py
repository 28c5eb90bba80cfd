# SPDX-License-Identifier: Apache-2.0
"""The operating system's real-time facilities for threads of Python."""

import ctypes
import gc
import os
import resource
import threading

INTERPRETER_PRIORITY = 5  # above all load, below the recorder, which loses messages below telemetry
PR_SET_TIMERSLACK = 29
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4


def go_realtime(wish, priority):
    """Gives the calling thread what `wish` (require | prefer | off) asks for; returns one sentence of what it has.

    SCHED_FIFO at priority, timer slack of 1 ns, and memory locked. Raises PermissionError with what is missing and
    how to grant it if wish is `require`.
    """
    # the kernel may else put off a wake-up of an ordinary thread by 50 us, to bundle it with others (man prctl)
    _libc().prctl(PR_SET_TIMERSLACK, ctypes.c_ulong(1), 0, 0, 0)
    if wish == "off":
        return "realtime off"
    missing = [sentence for sentence in (try_fifo(priority), lock_memory()) if sentence]
    if missing and wish == "require":
        raise PermissionError(f"realtime is require: {'; '.join(missing)}")
    return "; ".join(missing) or f"SCHED_FIFO {priority}, memory locked"


def spare_collections():
    """Keeps what is there now out of all later collections of garbage: they then hold the interpreter for no long time.

    What was kept by an earlier call, and is garbage, goes with this one.
    """
    gc.unfreeze()
    gc.collect()
    gc.freeze()


def try_fifo(priority):
    """Gives the calling thread SCHED_FIFO at this priority; returns what is missing, or ""."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except PermissionError:
        return f"no SCHED_FIFO {priority}: set `rtprio 98` for your group in /etc/security/limits.d and log in again"
    return ""


def lift_threads(wish, priority):
    """Gives every thread of this process but the caller SCHED_RR at priority, where permitted and wished.

    Meant for the middleware's own threads, before ours are started: a real-time thread would otherwise wait for locks
    that they hold while ordinary load keeps them from running (priority inversion). In turns and not SCHED_FIFO,
    because some of them spin for one another: of two on one core the first would never let the other run.
    """
    if wish == "off":
        return
    # the caller keeps what it has
    for thread in os.listdir("/proc/self/task"):
        if int(thread) != threading.get_native_id():
            _give(int(thread), os.SCHED_RR, priority)


def lift_interpreter(wish, priority=INTERPRETER_PRIORITY):
    """Gives every ordinary thread of Python in this process SCHED_RR at priority, where permitted and wished.

    Meant for a process of which a real-time thread, above this priority, needs the interpreter: it would otherwise wait
    for the interpreter's lock, which an ordinary thread holds while ordinary load keeps it from running (priority
    inversion). What these threads start later is ordinary: a thread or process that computes for seconds must not keep
    a core from everybody. Returns what put_back takes.
    """
    # one that is being started has no number yet
    threads = [thread.native_id for thread in threading.enumerate() if thread.native_id] if wish != "off" else []
    ordinary = [thread for thread in threads if _is_ordinary(thread)]
    return [thread for thread in ordinary if _give(thread, os.SCHED_RR | os.SCHED_RESET_ON_FORK, priority)]


def put_back(lifted):
    """Makes the threads that lift_interpreter has lifted ordinary again."""
    # the number of one that has ended may be another process's by now
    for thread in {thread.native_id for thread in threading.enumerate()} & set(lifted):
        _give(thread, os.SCHED_OTHER | os.SCHED_RESET_ON_FORK, 0)  # to take the flag back is not permitted to all


def _is_ordinary(thread):
    try:
        return os.sched_getscheduler(thread) & ~os.SCHED_RESET_ON_FORK == os.SCHED_OTHER
    except ProcessLookupError:
        return False


def _give(thread, policy, priority):
    """Whether the thread has it now: it may have ended, or it is not permitted."""
    try:
        os.sched_setscheduler(thread, policy, os.sched_param(priority))
    except (PermissionError, ProcessLookupError):
        return False
    return True


def stay_on_one_core(has):
    """Keeps all threads of this process, and those they start, to its first core, if the caller has SCHED_FIFO.

    Takes the sentence of go_realtime, and returns what is true now. The threads take turns there (SCHED_RR), the caller
    too: a thread of the middleware that spun for another one held this core for good with SCHED_FIFO.

    Meant for what wakes often and moves nothing. A more urgent thread that wakes where such a one runs puts it off, and
    stays; but if it may run nowhere else, the kernel wakes the urgent one on another core, from then on (Linux,
    kernel/sched/rt.c: select_task_rq_rt). There nobody spoils the caches of the servo.
    """
    if os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK != os.SCHED_FIFO:
        return has
    # the first core: the servo is woken on another
    first, priority = {min(os.sched_getaffinity(0))}, os.sched_getparam(0)
    os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, priority)
    for thread in os.listdir("/proc/self/task"):
        try:
            os.sched_setaffinity(int(thread), first)
        except ProcessLookupError:
            continue
    return has.replace("SCHED_FIFO", "SCHED_RR")


def lock_memory():
    """Locks pages as they are touched from now on; returns what is missing, or ""."""
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    # ONFAULT: else all that is mapped would be read into memory at once (man mlockall)
    if _libc().mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT):
        return f"memory not locked: memlock limit is {limit // 1024} KiB; set `memlock unlimited` in limits.d"
    return ""


def _libc():
    return ctypes.CDLL(None, use_errno=True)
