# SPDX-License-Identifier: Apache-2.0
"""Sweeps: the same cells on threads, processes and a Dask cluster, whatever happens to its workers."""

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from haptic_device.analysis import sweep
from haptic_device.analysis.zwidth import Setup
from haptic_device.analysis.zwidth_map import Request, draw_map
from haptic_sim.cli.bench_exchange import Figures
from haptic_sim.cli.bench_jobs import Crew, Kept
from haptic_sim.cli.bench_jobs import sweep as run_jobs

pytestmark = pytest.mark.live

SMALL = Request(Setup(0.1, 0.5, 1e-3, seconds=0.2), "none", np.linspace(10.0, 1200.0, 40), np.linspace(-0.5, 1.0, 60))
ROOT = Path(__file__).parents[1]
NOBODY = "tcp://127.0.0.1:9"  # the discard port: nothing listens there


@pytest.fixture
def scheduler(start):
    """(address, process) of a scheduler on this machine."""
    process = _dask(start, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    return _said(process, "Scheduler at:").split()[-1], process


@pytest.fixture
def cluster(start, scheduler):
    """(address, processes) of a scheduler and two workers on this machine."""
    address, _ = scheduler
    workers = [_dask(start, "worker", address, "--no-dashboard", "--nthreads", "1", "--no-nanny") for _ in range(2)]
    for worker in workers:
        _said(worker, "Registered to:")
    return address, workers


def _dask(start, *words, **options):
    return start([sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]], stdout=subprocess.DEVNULL,
                 stderr=subprocess.PIPE, **options)  # fmt: skip


def _said(process, words):
    """The line with these words; what the process says afterwards is read and dropped."""
    for line in process.stderr:
        if words in line:
            threading.Thread(target=process.stderr.read, daemon=True).start()
            return line
    raise AssertionError(f"{process.args} ended without a word of {words!r}")


def test_a_cluster_maps_the_same_to_the_bit_though_a_worker_is_killed_in_the_middle(cluster, tmp_path):
    address, workers = cluster

    def kill(done):
        if done >= 10 and workers[0].poll() is None:
            os.kill(workers[0].pid, signal.SIGKILL)

    far, near = draw_map(SMALL, 1, tmp_path / "resume.npz", kill, address), draw_map(SMALL, 2)
    assert workers[0].wait() == -signal.SIGKILL
    assert far.done.all()
    for one, other in zip(far.outcome, near.outcome, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_scheduler_that_is_killed_in_the_middle_is_a_sentence_and_what_was_done_is_kept(
    scheduler, cluster, tmp_path, caplog
):
    (address, process), file, seen = scheduler, tmp_path / "resume.npz", []

    def kill(done):
        seen.append(done)
        if done == 3:
            process.kill()

    with pytest.raises(ValueError, match=f"the work was lost at {address} .*; what was done is kept"):
        draw_map(SMALL._replace(setup=SMALL.setup._replace(seconds=20.0)), 1, file, kill, address)
    assert 3 <= seen[-1] < 60
    with np.load(file) as kept:
        assert kept["done"].sum() == seen[-1]
    assert not caplog.records


@pytest.mark.parametrize(("edited", "old", "new"), [
    ("haptic_sim/lockstep.py", "def ", "def  "), ("config/scenes/wall.yaml", "\n", "\n\n"), (None, "", ""),
])  # fmt: skip
def test_only_a_worker_with_the_same_sources_and_scenes_takes_part(start, scheduler, tmp_path, edited, old, new):
    address, _ = scheduler
    for folder in ("haptic_device", "haptic_sim", "config"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "package.xml", tmp_path)
    if edited:
        (tmp_path / edited).write_text((tmp_path / edited).read_text().replace(old, new, 1))
    worker = _dask(start, "worker", address, "--no-dashboard", "--nthreads", "1", "--no-nanny", cwd=tmp_path,
                   env={**os.environ, "PYTHONPATH": str(tmp_path)})  # fmt: skip
    _said(worker, "Registered to:")
    found = sweep.spread(len, {"job": ("four",)}, 1, address)
    if edited is None:
        assert list(found) == [("job", 4)]
        return
    with pytest.raises(ValueError, match="runs other sources or versions than this command"):
        next(found)


@pytest.mark.parametrize("address", ["nonsense", "127.0.0.1", "http://127.0.0.1:8786", "tcp://127.0.0.1"])
def test_what_is_no_address_of_a_scheduler_is_refused_before_anything_is_tried(address):
    with pytest.raises(ValueError, match="must be an address such as tcp://host:8786"):
        next(sweep.spread(len, {"job": ("",)}, 1, address))


def test_processes_of_a_sweep_end_with_the_one_that_is_killed(start):
    code = ("import os; from haptic_device.analysis.sweep import spread;"
            "[print(pid, flush=True) or input() for _, pid in spread(os.getpid, {0: ()}, 1, processes=True)]")
    process = start([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    worker = int(process.stdout.readline())
    process.kill()
    end = time.monotonic() + 10.0
    while os.path.exists(f"/proc/{worker}") and time.monotonic() < end:
        time.sleep(0.05)
    assert not os.path.exists(f"/proc/{worker}")


def test_a_scheduler_that_is_not_there_is_a_sentence_and_loses_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(sweep, "PATIENCE", 0.5)
    file, seen = tmp_path / "resume.npz", []

    def interrupt(done):
        seen.append(done)
        if done >= 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        draw_map(SMALL, 1, file, interrupt)
    with pytest.raises(ValueError, match="no scheduler answers at tcp://127.0.0.1:9 within 0.5 s; nothing is lost"):
        draw_map(SMALL, 1, file, scheduler=NOBODY)
    seen.clear()
    draw_map(SMALL, 1, file, seen.append)
    assert seen[0] >= 3 and seen[-1] == 60


def test_without_dask_the_option_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ValueError, match="pip install"):
        draw_map(SMALL, 1, scheduler=NOBODY)


def figures(k):
    return Figures(*(k + i / 3.0 for i in range(6)), np.inf)


def test_a_kept_sweep_goes_on_where_it_was_torn_off_and_numbers_come_back_to_the_bit(tmp_path):
    file, jobs = tmp_path / "kept", {f"job {k}": (k,) for k in range(4)}
    run_jobs(figures, dict(list(jobs.items())[:2]), Crew(1), Kept(file, "a sweep"))
    with open(file, "a") as torn:
        torn.write('["job 2", [1.0, 2')
    kept, asked = Kept(file, "a sweep"), []
    run_jobs(lambda k: asked.append(k) or figures(k), jobs, Crew(1), kept)
    assert asked == [2, 3]
    again = Kept(file, "a sweep")
    assert [Figures(*again.known[key]) for key in jobs] == [figures(k) for k in range(4)]
    with pytest.raises(ValueError, match="is of another sweep"):
        Kept(file, "another one")


def test_processes_come_to_what_one_alone_does():
    jobs = {f"job {k}": (k,) for k in range(4)}
    one, two = Kept(None, ""), Kept(None, "")
    run_jobs(figures, jobs, Crew(1), one)
    run_jobs(figures, jobs, Crew(2), two)
    assert one.known == two.known
