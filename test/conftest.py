# SPDX-License-Identifier: Apache-2.0
"""What every test may rely on: an own ROS domain on this machine only, and processes that end with the test."""

import functools
import gc
import os
import signal
import subprocess
import uuid

import hypothesis
import pytest
import waiting

from haptic_device.jit import ensure_compiled
from haptic_device.process import ending_with_us
from haptic_device.realtime import machine, shared_memory
from haptic_device.realtime.servo_thread import PRIORITY
from haptic_display.run.domain import isolated_domain

# Read when numpy is first imported: its matrices here are small, and on a busy machine threads wait for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# readline, which pytest loads, gives it to what is started afterwards: the workers of xdist.
os.environ.pop("COLUMNS", None)
# No deadline: the first call of a kernel may compile it. The same draws each time, so that no test is a lottery; others
# with `pytest --hypothesis-profile=search`.
hypothesis.settings.register_profile("search", deadline=None, derandomize=False)
hypothesis.settings.register_profile("project", deadline=None, derandomize=True)
hypothesis.settings.load_profile("project")

# A shell without job control starts what runs in the background with SIGINT ignored, and children would inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)


LAST_LINES = []
MANY = 500  # tests before which everything is compiled
KEEPS_TIME = "real-time priority", "cores"  # checks of `haptic doctor`


def pytest_configure(config):
    """What long waits say goes to the terminal, from a worker of xdist too: nothing is captured yet."""
    waiting.terminal = os.dup(2)


def pytest_collection_finish(session):
    """What is imported by now stays: to look through it for cycles again and again took a tenth of the time."""
    gc.freeze()


def pytest_runtestloop(session):
    """All tests run on kernels in the cache, as by `make check`: a test that compiled would spend its limit on it."""
    if len(session.items) > MANY and not session.config.option.collectonly:
        from haptic_display.run.kernels import ENTRIES

        ensure_compiled(*ENTRIES)


@functools.cache
def lacking():
    """{check: what `haptic doctor` says of it} of those that do not come out well on this machine."""
    return {one.name: f"{one.name}: {one.found}; {one.advice}" for one in machine.checks(PRIORITY) if not one.good}


def pytest_runtest_setup(item):
    """What judges time, by the mark `realtime`, is skipped where this machine cannot keep it: where one of the checks
    that the mark names, or one of KEEPS_TIME, is not well."""
    for mark in item.iter_markers("realtime"):
        if found := [lacking()[name] for name in mark.args or KEEPS_TIME if name in lacking()]:
            pytest.skip(found[0])


def pytest_terminal_summary(terminalreporter):
    """What tests say of the machine."""
    for line in dict.fromkeys(LAST_LINES):
        terminalreporter.write_line(line)


@pytest.fixture
def last_lines():
    """Lines that end what the run prints, each once."""
    return LAST_LINES


@pytest.fixture(scope="session", autouse=True)
def ros_domain(tmp_path_factory):
    """A ROS domain that no other test run on this machine uses, for this process and the ones it starts."""
    folder = tmp_path_factory.mktemp("ros")
    with pytest.MonkeyPatch.context() as environment:
        environment.delenv("ROS_DOMAIN_ID", raising=False)  # the person's own, which workers would share
        environment.setenv("ROS_LOG_DIR", str(folder))
        environment.setenv("XDG_STATE_HOME", str(folder))  # the links of pages are none of the person's own
        with isolated_domain(folder) as domain:
            yield domain


@pytest.fixture
def start():
    """start(command, **Popen options) runs a process; after the test it is interrupted and, if need be, killed.

    It ends with this process too, however that ends: one left over would speak in the next run's domain.
    """
    started = []

    def run(command, **options):
        process = subprocess.Popen(ending_with_us(command), **{"text": True, **options})
        started.append(process)
        return process

    yield run
    for process in reversed(started):
        _end(process)


def _end(process, patience=20.0):
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        if process.poll() is not None:
            break
        process.send_signal(signal.SIGCONT)  # a test that failed may have left it stopped
        process.send_signal(number)
        try:
            process.wait(patience)
        except subprocess.TimeoutExpired:
            continue
    for stream in (process.stdin, process.stdout, process.stderr):
        if stream is not None:
            stream.close()


@pytest.fixture
def space():
    """A namespace of the test's own, whose page is gone after it."""
    space = f"/test_{uuid.uuid4().hex}"
    yield space
    left = [*shared_memory.FOLDER.glob(f"*{space[1:]}*")]
    for page in left:
        page.unlink()
    assert not left, "the page was left"
