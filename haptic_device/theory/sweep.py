# SPDX-License-Identifier: Apache-2.0
"""Many independent runs on all cores, or on the machines behind a Dask scheduler: same jobs, same results."""

import contextlib
import hashlib
import logging
import multiprocessing
import os
import re
import sys
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numba
import numpy as np

from haptic_device.config.files import find, names
from haptic_device.process import die_with_parent

PATIENCE = 5.0  # [s] for a scheduler to answer
MISSING = "--scheduler needs Dask distributed: pip install 'haptic_display[sweep]'"
ADDRESS = re.compile(r"(tcp|tls|ws|wss)://\S+:\d{1,5}")


class SchedulerError(ValueError):
    """The scheduler, or what stands behind it, cannot do the work; one sentence."""


def spread(
    function: Callable[..., Any],
    jobs: dict[Any, tuple[Any, ...]],
    workers: int,
    scheduler: str = "",
    threads: bool = False,
) -> Generator[tuple[Any, Any], None, None]:
    """Yields (key, function(*arguments)) of jobs {key: arguments} as they are done, in whatever order.

    By processes, or by `threads` for kernels without the interpreter's lock; or by all workers of the Dask scheduler at
    this address (tcp://host:port), which must run the same sources. A worker of it that dies has its jobs done by
    others. Raises SchedulerError; what a job raises is raised.
    """
    package = function.__module__.partition(".")[0]
    with _executor(workers, scheduler, threads, package) as pool:
        waiting = {}
        try:
            for key, arguments in jobs.items():
                waiting[pool.submit(function, *arguments)] = key
            for done in as_completed(waiting):
                yield waiting[done], done.result()
        except Exception as error:
            if scheduler and type(error).__name__ in ("KilledWorker", "CancelledError", "CommClosedError"):
                reason = str(error).partition("\n")[0].rstrip(".") or "it went away"
                raise SchedulerError(f"the work was lost at {scheduler} ({reason}); what was done is kept") from None
            raise
        finally:
            for future in waiting:
                future.cancel()


@contextlib.contextmanager
def _executor(workers: int, scheduler: str, threads: bool, package: str) -> Iterator[Executor]:
    if scheduler:
        with _client(scheduler, package) as client, client.get_executor(pure=False) as pool:
            yield pool
    elif threads:
        with ThreadPoolExecutor(workers) as pool:
            yield pool
    else:  # they end with this process, however it ends: killed, it would leave them waiting for good
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(workers, context, initializer=die_with_parent, initargs=(os.getpid(),)) as pool:
            yield pool


@contextlib.contextmanager
def _client(scheduler: str, package: str) -> Iterator[Any]:
    try:
        from distributed import Client
    except ModuleNotFoundError:
        raise SchedulerError(MISSING) from None
    if not ADDRESS.fullmatch(scheduler):
        raise SchedulerError(f"scheduler is {scheduler!r}; it must be an address such as tcp://host:8786")
    try:
        client = Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError):
        raise SchedulerError(f"no scheduler answers at {scheduler} within {PATIENCE:g} s; nothing is lost") from None
    loggers = [logging.getLogger(name) for name in ("distributed.client", "tornado.application")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)  # of a scheduler that went away they write tracebacks
    try:
        with client:
            _check(client, scheduler, package)
            yield client
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def sources(package: str = "haptic_device") -> str:
    """Digest of all that a run of this package is made of: it and the product's, config, numba, numpy and Python."""
    root, digest = Path(__file__).resolve().parents[2], hashlib.sha256()
    for part in (numba.__version__, np.__version__, sys.version):
        digest.update(part.encode())
    packages = sorted({"haptic_device", "haptic_sim", package})
    files = [file for folder in packages for file in sorted((root / folder).rglob("*.py"))]
    for file in (*files, *(find(folder, name) for folder in ("", "devices", "scenes") for name in names(folder))):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def _check(client: Any, scheduler: str, package: str) -> None:
    """Other sources would compute something else under the same name."""
    try:
        digests = client.run(sources, package)
    except Exception as error:
        raise SchedulerError(f"a worker of {scheduler} does not run haptic_display: {error}") from None
    if not digests:
        raise SchedulerError(f"the scheduler at {scheduler} has no workers: start some with `dask worker {scheduler}`")
    own = sources(package)
    other = [worker for worker, digest in digests.items() if digest != own]
    if other:
        raise SchedulerError(f"worker {other[0]} runs other sources or versions than this command; install the same")
