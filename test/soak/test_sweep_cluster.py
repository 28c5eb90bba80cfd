# SPDX-License-Identifier: Apache-2.0
"""Sweeps on a Dask cluster: the same cells to the bit, whatever happens to workers, scheduler and sources."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from waiting import LIMIT, exit_code, until

from haptic_device.process import ending_with_us
from haptic_device.theory import sweep
from haptic_device.theory.zwidth import Setup
from haptic_device.theory.zwidth_map import Request, draw_map, empty

pytestmark = pytest.mark.timeout(900)

SMALL = Request(Setup(0.1, 0.5, 1e-3, seconds=0.2), "none", np.linspace(10.0, 1200.0, 40), np.linspace(-0.5, 1.0, 60))
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A scheduler that the tests of this file share."""
    pytest.importorskip("distributed")
    with _scheduler(tmp_path_factory.mktemp("scheduler") / "log") as (address, _):
        yield address


@contextlib.contextmanager
def _scheduler(log):
    """(address, process) of a scheduler on this machine, which has ended afterwards."""
    process = _dask(subprocess.Popen, log, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    try:
        yield _said(process, log, "Scheduler at:").split()[-1], process
    finally:
        process.kill()
        exit_code(process)


@pytest.fixture
def worker(start, tmp_path):
    """worker(address, **options) starts a worker that has registered; it is killed after the test, for it holds nothing
    and takes its time to say goodbye."""
    count, running = 0, []

    def run(address, **options):
        nonlocal count
        count += 1
        log = tmp_path / f"worker_{count}.log"
        process = _dask(start, log, "worker", address, "--no-dashboard", "--nthreads", "1", "--no-nanny", **options)
        running.append(process)
        _said(process, log, "Registered to:")
        return process

    yield run
    for process in running:
        process.kill()


def _dask(start, log, *words, **options):
    command = [sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]]
    command = ending_with_us(command) if start is subprocess.Popen else command
    with open(log, "w") as stderr:
        return start(command, stdout=subprocess.DEVNULL, stderr=stderr, **options)


def _said(process, log, words):
    """The line of its log with these words."""

    def there():
        assert process.poll() is None or words in log.read_text(), f"{process.args} ended: {log.read_text()}"
        return next((line for line in log.read_text().splitlines() if words in line), None)

    return until(there, f"{words!r} of {process.args}")


def _wait_for_workers(address, count):
    """Until the scheduler knows so many: of one that has ended it hears a moment later."""
    from distributed import Client

    with Client(address, timeout=LIMIT, set_as_default=False) as client:
        until(lambda: len(client.scheduler_info(n_workers=-1)["workers"]) == count, f"{count} workers at {address}")


def test_a_cluster_maps_the_same_to_the_bit_though_a_worker_is_killed_in_the_middle(kept, worker, tmp_path):
    workers = [worker(kept), worker(kept)]
    _wait_for_workers(kept, 2)

    def kill(done):
        if done >= 10 and workers[0].poll() is None:
            os.kill(workers[0].pid, signal.SIGKILL)

    far, near = draw_map(SMALL, 1, kill, kept), draw_map(SMALL, 2)
    assert exit_code(workers[0]) == -signal.SIGKILL
    assert far.done.all()
    for one, other in zip(far.outcome, near.outcome, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_scheduler_that_is_killed_in_the_middle_is_a_sentence_and_what_was_done_is_kept(worker, tmp_path, caplog):
    pytest.importorskip("distributed")
    request, seen = SMALL._replace(setup=SMALL.setup._replace(seconds=3.0)), []
    plane = empty(request)

    def kill(done):
        seen.append(done)
        if done == 3:
            process.kill()

    with _scheduler(tmp_path / "log") as (address, process):
        worker(address)
        with pytest.raises(ValueError, match=f"the work was lost at {address} .*; what was done is kept"):
            draw_map(request, 1, kill, address, plane)
    assert 3 <= seen[-1] < 60
    assert plane.done.sum() == seen[-1]
    assert not caplog.records


@pytest.mark.parametrize(
    ("edited", "old", "new"),
    [("haptic_sim/lockstep/lockstep.py", "def ", "def  "), ("config/scenes/wall.yaml", "\n", "\n\n"), (None, "", "")],
)
def test_only_a_worker_with_the_same_sources_and_scenes_takes_part(kept, worker, tmp_path, edited, old, new):
    for folder in ("haptic_device", "haptic_sim", "config"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "package.xml", tmp_path)
    if edited:
        (tmp_path / edited).write_text((tmp_path / edited).read_text().replace(old, new, 1))
    worker(kept, cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(tmp_path)})
    _wait_for_workers(kept, 1)  # and none of the test before
    found = sweep.spread(len, {"job": ("four",)}, 1, kept)
    if edited is None:
        assert list(found) == [("job", 4)]
        return
    with pytest.raises(ValueError, match="runs other sources or versions than this command"):
        next(found)


def test_processes_of_a_sweep_end_with_the_one_that_is_killed(start):
    code = (
        "import os; from haptic_device.theory.sweep import spread;"
        "[print(pid, flush=True) or input() for _, pid in spread(os.getpid, {0: ()}, 1)]"
    )
    process = start([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    worker = int(process.stdout.readline())
    process.kill()
    exit_code(process)
    until(lambda: not os.path.exists(f"/proc/{worker}"), "the end of the worker")
