# SPDX-License-Identifier: Apache-2.0
"""Kernels compiled before anybody needs them: by processes of their own, on all cores, once for this machine.

`python -m haptic_device.compiling [NAME ...]` compiles those groups of kernels, or all; `have(...)` is for who needs
some: it does nothing where they are in the cache, and has that command run where they are not. Compiling takes some
hundred MB and all of a core for many seconds; here nobody pays for it whose thread is urgent or who runs on for hours.

One such process compiles at a time (a lock file), what the others want too; they wait for it and show how it goes. It
may be interrupted: what is compiled by then stays in the cache, for numba writes a file under another name first.
"""

import contextlib
import fcntl
import functools
import importlib
import os
import selectors
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

from haptic_device import cache
from haptic_device.runtime.process import ending_with_us, own_environment, running_module

GROUPS = (  # in one tuple: what shares a file of the cache, compiled one after the other; the longest come first
    ("methods", "methods of penalty"),
    ("servo",),
    ("replay",),
    ("lock-step",),
    ("searches",),
    ("loopback",),
    ("exchange", "exchange of contacts"),
    ("closed form",),
    ("wall maps",),
    ("identification",),
    ("local contacts",),
)
SOURCES = ("haptic_device.node.kernels", "haptic_sim.kernels")  # modules with GROUPS: {name: function that compiles}
LONGEST = 4096  # bytes; what a pipe takes in one piece (man 7 pipe: PIPE_BUF)
LOOK = 0.1  # [s] between looks at another's progress, and at whether one shall end
EACH_SECOND = 1.0  # [s] between lines where there is no terminal
TEXT = "compiling the servo, once for this machine"


class Progress(NamedTuple):
    """Groups done of how many, and for how long [s]."""

    done: int
    count: int
    seconds: int


def servo_groups(exchange_method):
    """What a driver with this exchange method needs."""
    return "servo", "exchange of contacts" if exchange_method == "local" else "exchange"


def have(*names, told=()):
    """Returns when these groups are in the cache, compiled if need be by a process of its own, which says so.

    What cannot be compiled there is compiled here when it is called, which then says why. KeyboardInterrupt as soon as
    there is anything in `told`, where somebody notes that this process shall end.
    """
    if cache.NOTE and not os.environ.get(_SAID):
        print(cache.NOTE, file=sys.stderr, flush=True)
        os.environ[_SAID] = "1"  # the nodes that this process starts need not repeat it
    left = missing(names)
    if not left or os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        return
    command = ending_with_us([*running_module("haptic_device.compiling"), *left])
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, start_new_session=True, env=own_environment()
    ) as process:
        try:
            while process.poll() is None and not told:
                time.sleep(LOOK)
        finally:  # interrupted
            process.kill()
    if told:
        raise KeyboardInterrupt


def missing(names):
    """Those of these groups that are not in the cache."""
    return [name for name in names if not _done(name).exists()]


_SAID = "HAPTIC_CACHE_NOTE_SAID"


def _done(name):
    """The file that says that a group is in the cache, as compiled from these very files."""
    return Path(cache.FOLDER) / f"{name.replace(' ', '_')}-{_stamp()}.done"


@functools.cache
def _stamp():
    return cache.stamp()


def compile_groups(wanted, show):
    """Compiles these groups on all cores; returns sentences on those that could not be. show(Progress): how it goes."""
    with _wish(wanted), _lock(wanted, show) as tell:
        if not missing(wanted):  # somebody else has compiled them
            return []

        def say(progress):
            show(progress)
            tell(progress)

        return _spread(say)


@contextlib.contextmanager
def _wish(names):
    """Meanwhile whoever compiles for this cache compiles these groups too. Locked: a wish ends with its process."""
    wish = Path(cache.FOLDER) / f"{os.getpid()}.wish"
    with open(wish.with_suffix(".new"), "w", encoding="utf-8") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        file.write("\n".join(names))
        file.flush()
        try:
            os.rename(file.name, wish)  # nobody sees it unlocked
            yield
        finally:
            wish.unlink(missing_ok=True)


def _wanted():
    """Names of the groups that are not there yet and that some process waits for."""
    found = set()
    for wish in Path(cache.FOLDER).glob("*.wish"):
        with contextlib.suppress(FileNotFoundError), open(wish, encoding="utf-8") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                found.update(file.read().splitlines())
            else:
                wish.unlink()  # whose it was has died
    return {name for name in found if not _done(name).exists()}


@contextlib.contextmanager
def _lock(wanted, show):
    """Nobody else compiles for this cache meanwhile; yields a function that tells those who wait how it goes.

    It yields None, without the lock, once somebody else has compiled all that is wanted.
    """
    with open(Path(cache.FOLDER) / "compiling", "a+", encoding="utf-8") as file:
        while True:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if not missing(wanted):
                    yield None
                    return
                file.seek(0)
                with contextlib.suppress(ValueError, TypeError):  # just being written
                    show(Progress(*map(int, file.read().split())))
                time.sleep(LOOK)

        def tell(progress):
            file.seek(0)
            file.truncate()
            file.write(" ".join(map(str, progress)))
            file.flush()

        yield tell


def _spread(say):
    """All that is wanted, by whomever: each chain of GROUPS by one of the workers, the first chains first."""
    began, state = time.monotonic(), _State([], [], [], [])
    with contextlib.ExitStack() as ends, selectors.DefaultSelector() as ready:
        while (chain := state.next_chain()) or state.busy:
            if chain and state.idle:
                state.begin(chain)
                continue
            if chain and len(ready.get_map()) < len(os.sched_getaffinity(0)):
                worker = ends.enter_context(_worker())
                ready.register(worker.stdout, selectors.EVENT_READ, worker)
                state.idle.append(worker)
                continue
            say(Progress(len(state.done), state.count(), round(time.monotonic() - began)))
            for key, _ in ready.select(LOOK):
                said = os.read(key.fileobj.fileno(), LONGEST).decode()  # whole lines: a pipe takes a short one at once
                if not all([state.hear(key.data, line) for line in said.splitlines() or [""]]):
                    ready.unregister(key.fileobj)
        say(Progress(len(state.done), state.count(), round(time.monotonic() - began)))
    return state.wrong


class _State(NamedTuple):
    """Groups done; sentences on those that went wrong; workers that have nothing to do; (worker, chain) at work."""

    done: list
    wrong: list
    idle: list
    busy: list

    def next_chain(self):
        """The next chain of groups that are wanted and that nobody is at; [] if there is none."""
        taken = [name for _, chain in self.busy for name in chain]
        failed = [sentence.split(":")[0] for sentence in self.wrong]
        wanted = _wanted() - {*taken, *failed, *self.done}
        free = (chain for chain in GROUPS if not set(chain) & set(taken))
        return next((left for chain in free if (left := [name for name in chain if name in wanted])), [])

    def begin(self, chain):
        """Has an idle worker compile a chain."""
        worker = self.idle.pop()
        self.busy.append((worker, chain))
        worker.stdin.write(("|".join(chain) + "\n").encode())
        worker.stdin.flush()

    def hear(self, worker, line):
        """Takes a worker's word; False when it was its last."""
        what, _, text = line.partition(" ")
        chain = next((chain for one, chain in self.busy if one is worker), [])
        if what == "done":
            self.done.append(text)
        elif what == "wrong":
            self.wrong.append(text)
        elif what == "idle":
            self.busy.remove((worker, chain))
            self.idle.append(worker)
        else:
            self.busy[:] = [(one, its) for one, its in self.busy if one is not worker]
            self.idle[:] = [one for one in self.idle if one is not worker]
            left = [name for name in chain if name not in self.done]
            self.wrong.extend(f"{name}: the process that compiled it has died" for name in left)
        return what != ""

    def count(self):
        """How many groups there will have been."""
        return len(_wanted() | {*self.done})


@contextlib.contextmanager
def _worker():
    command = ending_with_us([*running_module("haptic_device.compiling"), "--worker"])
    worker = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=own_environment())
    try:
        yield worker
    finally:
        worker.kill()  # at once, also in the middle of LLVM; the cache has whole files only
        worker.wait()
        worker.stdin.close()
        worker.stdout.close()


def work():
    """A worker: reads names of groups, compiles them one by one, and says what became of each."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # what a library prints is no answer
    for line in sys.stdin:
        for name in line.strip().split("|"):
            try:
                _function(name)()
                _done(name).touch()
                print("done", name, file=answers)
            except Exception as error:
                text = " ".join(str(error).split())[:300]
                print("wrong", f"{name}: {type(error).__name__}: {text}", file=answers)
        print("idle", file=answers)


def _function(name):
    for source in SOURCES:
        groups = importlib.import_module(source).GROUPS
        if name in groups:
            return groups[name]
    raise ValueError(f"no kernels are called {name}")


def names():
    """Names of all groups."""
    return [name for chain in GROUPS for name in chain]


@contextlib.contextmanager
def _display():
    """A function that shows a Progress: on a terminal as a bar, elsewhere as a line a second."""
    if sys.stderr.isatty():
        from rich import progress
        from rich.console import Console

        columns = TEXT, progress.BarColumn(), progress.MofNCompleteColumn(), progress.TimeElapsedColumn()
        with progress.Progress(*columns, console=Console(stderr=True)) as bar:
            task = bar.add_task("", total=None)
            yield lambda now: bar.update(task, completed=now.done, total=now.count)
        return
    last = -EACH_SECOND

    def show(now):
        nonlocal last
        if time.monotonic() - last >= EACH_SECOND or now.done == now.count:
            last = time.monotonic()
            print(f"{TEXT}: {now.done} of {now.count}, {now.seconds} s", file=sys.stderr, flush=True)

    yield show


def main(wanted):
    """Compiles these groups, or all. Exit code 1 if some could not be, each with its sentence."""
    from haptic_device.whole import PLAIN

    if PLAIN:
        print(f"{PLAIN}: compiled by plain numba.njit, which takes longer", file=sys.stderr, flush=True)
    if strangers := sorted({*wanted} - {*names()}):
        print(f"no kernels are called {', '.join(strangers)}; there are {', '.join(names())}", file=sys.stderr)
        return 1
    with _display() as show:
        wrong = compile_groups(wanted or names(), show)
    for sentence in wrong:
        print(f"not compiled: {sentence}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if sys.argv[1:] == ["--worker"]:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started it ends it
        work()
    else:
        sys.exit(main(sys.argv[1:]))
