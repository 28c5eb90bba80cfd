# SPDX-License-Identifier: Apache-2.0
"""What every test may rely on: an own ROS domain on this machine only, processes that end with the test, and that it is
not judged by a machine that was not there."""

import contextlib
import itertools
import os
import signal
import subprocess
import time

import domain_coordinator
import hypothesis
import pytest
import pytest_timeout
from _pytest.runner import runtestprotocol

from haptic_device.runtime.process import die_with_parent

# Read when numpy is first imported: its matrices here are small, and on a busy machine threads wait for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# No deadline: the first call of a kernel may compile it. The same draws each time, so that no test is a lottery; others
# with `pytest --hypothesis-profile=search`.
hypothesis.settings.register_profile("search", deadline=None)
hypothesis.settings.register_profile("project", deadline=None, derandomize=True)
hypothesis.settings.load_profile("project")


STOLEN = 0.05  # [s] of the processors' time: as much may the host take while a live test runs, and its failure counts
WAKE = 10.0  # [s] before the test that are looked at as well: nodes shared with earlier tests remember a spell as long
RUNS = 3  # of such a test, at most
PATIENCE = 60.0  # [s] before each of them, at most, for the host to leave the processors alone
LAST_LINES, LOOKS = [], []


def stolen():
    """Seconds that the host has given to others while something here wanted to run, of all cores (man 5 proc)."""
    with open("/proc/stat", encoding="ascii") as stat:
        return int(stat.readline().split()[8]) / os.sysconf("SC_CLK_TCK")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item, nextitem):
    """A live test that fails while the host takes the processors away is run again; the last lines say which."""
    if item.get_closest_marker("live") is None:
        return None
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for left in reversed(range(RUNS)):
        before = _before()
        reports = runtestprotocol(item, nextitem=nextitem, log=False)
        taken = stolen() - before
        if not left or taken <= STOLEN or not any(report.failed for report in reports):
            break
        LAST_LINES.append(f"{item.nodeid} was run again: it failed while the host took {taken:.2f} s of the processors")
        _afresh(item)
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def _before():
    """What was stolen up to a moment before now."""
    now = time.monotonic()
    LOOKS.append((now, stolen()))
    return next((taken for when, taken in reversed(LOOKS) if when <= now - WAKE), LOOKS[0][1])


def _afresh(item):
    """Makes a test ready to be run again, with its whole time: with new nodes, which the tests of its module that come
    before it have brought to where it begins."""
    item.ihook.pytest_timeout_cancel_timer(item=item)
    with contextlib.suppress(Exception, pytest.fail.Exception):  # of nodes that are of no use any more
        item.session._setupstate.teardown_exact(None)
    _wait_for_the_host()
    every = item.session.items[: item.session.items.index(item) + 1]
    module = [one for one in every if one.path == item.path]
    for before, following in itertools.pairwise(module):
        runtestprotocol(before, nextitem=following, log=False)
    _wait_for_the_host()
    LOOKS.clear()
    item.ihook.pytest_timeout_set_timer(item=item, settings=pytest_timeout._get_item_settings(item))


def _wait_for_the_host():
    """Until a second of this process's work is left alone, or patience ends: what is taken comes in spells."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        before, told = stolen(), time.monotonic() + 1.0
        while time.monotonic() < told:
            continue
        if stolen() - before <= STOLEN:
            return


def pytest_terminal_summary(terminalreporter):
    """Which tests were run again, and what tests say of the machine."""
    for line in dict.fromkeys(LAST_LINES):
        terminalreporter.write_line(line)


@pytest.fixture
def last_lines():
    """Lines that end what the run prints, each once."""
    return LAST_LINES


@pytest.fixture(scope="session", autouse=True)
def ros_domain(tmp_path_factory):
    """A ROS domain that no other test run on this machine uses, for this process and the ones it starts."""
    with domain_coordinator.domain_id() as domain, pytest.MonkeyPatch.context() as environment:
        environment.setenv("ROS_DOMAIN_ID", str(domain))
        environment.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        environment.setenv("ROS_LOG_DIR", str(tmp_path_factory.mktemp("ros_log")))
        yield domain


@pytest.fixture
def start():
    """start(command, **Popen options) runs a process; after the test it is interrupted and, if need be, killed.

    It ends with this process too, however that ends: one left over would speak in the next run's domain.
    """
    started, own = [], os.getpid()

    def run(command, **options):
        options = {"text": True, "preexec_fn": lambda: die_with_parent(own), **options}
        process = subprocess.Popen([str(word) for word in command], **options)
        started.append(process)
        return process

    yield run
    for process in reversed(started):
        _end(process)


def _end(process, patience=5.0):
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        if process.poll() is not None:
            break
        process.send_signal(number)
        try:
            process.wait(patience)
        except subprocess.TimeoutExpired:
            continue
    for stream in (process.stdin, process.stdout, process.stderr):
        if stream is not None:
            stream.close()
