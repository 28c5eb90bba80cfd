# SPDX-License-Identifier: Apache-2.0
"""The device page, of Python and of firmware/haptic_device.h: who comes and goes, and what passes word by word."""

import errno
import math
import os
import subprocess
import sys

import firmware_builds
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from waiting import exit_code, until

from haptic_device.realtime import atomic, clock, hardware_interface, servo_writes, shared_memory
from haptic_device.realtime.hardware_interface import SharedMemoryInterface
from haptic_device.realtime.shared_memory import DEVICE, SERVO, WATCHDOG, SharedMemory, SharedMemoryError, file_name

HOLDER = """
import sys
from haptic_device.realtime import shared_memory
try:
    held = shared_memory.SharedMemory(shared_memory.file_name(*sys.argv[1:3]), sys.argv[3])
except OSError as refused:
    sys.exit(print(refused))
print(held.path, int(held.stale), flush=True)
for line in sys.stdin:
    print(int(held.peer_present()), flush=True)
held.close()
"""  # it speaks as test/page_tool.c does
MARK, DOMAIN = 60, 7  # a word that neither side uses


class Other:
    """A process that holds the page or says why not."""

    def __init__(self, start, command, space, domain=DOMAIN, more=(), **options):
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        self.process = start([*command, str(domain), space, *more], **pipes, **options)
        self.said = self.process.stdout.readline().rstrip("\n")

    def order(self, *words):
        print(*words, file=self.process.stdin, flush=True)

    def ask(self, *words):
        self.order(*words)
        return self.process.stdout.readline().split()

    def close(self):
        self.process.stdin.close()
        assert exit_code(self.process) == 0, self.process.stderr.read()

    def kill(self):
        self.process.kill()
        self.process.wait(60.0)


def page(space, domain=DOMAIN):
    return shared_memory.FOLDER / file_name(domain, space)


@pytest.fixture
def mine(space):
    """mine(role) holds the page in this process."""
    return lambda role: SharedMemory(page(space).name, role)


@pytest.fixture
def take(space, start):
    """take() has another process take the page as its device, by the header in C."""
    return lambda **how: Other(start, [firmware_builds.page_tool()], how.pop("space", space), **how)


@pytest.fixture(params=["device in C", "servo in Python"])
def other(request, space, start, take):
    """other() has another process take the page in `other.role`, for which `other.peer` is the other one."""
    role = request.param.split()[0]

    def come():
        return take() if "C" in request.param else Other(start, [sys.executable, "-c", HOLDER], space, more=[role])

    come.role, come.peer = role, SERVO if role == DEVICE else DEVICE
    return come


# who comes and goes


@pytest.mark.parametrize("first_in, first_out", [(0, 0), (1, 1)])
def test_either_side_may_come_first_and_the_last_one_out_removes_the_page(other, mine, space, first_in, first_out):
    """And nobody else can read or write it."""
    come = [other, lambda: mine(other.peer)]
    first, second = come[first_in](), come[1 - first_in]()
    away, here = (first, second)[first_in], (second, first)[first_in]
    assert away.said == f"{page(space)} 0" and not here.stale and page(space).stat().st_mode & 0o777 == 0o600
    assert away.ask("present") == ["1"] and here.peer_present()
    leaving = (away, here)[first_out]
    leaving.close()
    assert page(space).exists()
    assert not here.peer_present() if leaving is away else away.ask("present") == ["0"]
    (here, away)[first_out].close()
    assert not page(space).exists()


def test_a_second_owner_is_refused_in_a_sentence_wherever_it_is_and_the_first_goes_on(other, mine, space):
    sentence = f"page {page(space)} is held by another {other.role}; stop it, or use another namespace"
    first = other()
    with pytest.raises(SharedMemoryError) as refused:
        mine(other.role)
    assert str(refused.value) == sentence
    assert first.ask("present") == ["0"]
    first.close()
    ours = mine(other.role)
    assert other().said == sentence
    ours.close()


def test_a_killed_side_is_seen_by_the_other_which_keeps_the_page_for_the_next(other, mine, space):
    ours = mine(other.peer)
    ours.words[MARK] = 9
    for leave in (Other.kill, Other.close):
        away = other()
        assert away.said == f"{page(space)} 0" and ours.peer_present()
        leave(away)
        assert not ours.peer_present() and ours.words[MARK] == 9
    ours.close()


def test_a_page_of_another_layout_is_left_alone_in_a_sentence(other, mine, space):
    ours = mine(other.peer)
    ours.words[1] = 99
    assert other().said == f"page {page(space)} has layout version 99, this program speaks 2"
    assert not ours.peer_present() and ours.words[1] == 99
    ours.close()


def test_a_file_of_any_content_is_taken_over(other, space):
    page(space).write_bytes(bytes(range(1, 101)))
    taken = other()
    assert taken.said == f"{page(space)} 1"
    words = np.frombuffer(page(space).read_bytes(), np.int64)
    assert words[:2].tolist() == [shared_memory.MAGIC, shared_memory.LAYOUT_VERSION] and not words[2:].any()
    taken.close()


def test_a_full_memory_is_refused_in_a_sentence_and_leaves_no_file(space, mine, start, monkeypatch):
    """Written to all the same, the process would end with SIGBUS."""

    def none_left(*of):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    said = [Other(start, [firmware_builds.page_tool("-DFULL")], space).said]
    with monkeypatch.context() as full:
        full.setattr(os, "posix_fallocate", none_left)
        for role in (DEVICE, SERVO):
            with pytest.raises(SharedMemoryError) as refused:
                mine(role)
            said.append(str(refused.value))
    assert set(said) == {
        f"page {page(space)} needs 512 bytes of /dev/shm, which cannot be had: No space left on device"
    }
    assert not page(space).exists()


# names


@pytest.fixture(scope="module")
def named():
    """named(domain, namespace) is the file's name in C."""
    with subprocess.Popen(
        [firmware_builds.page_tool(), "names"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as tool:

        def name(domain, namespace):
            print(f"{domain}\t{namespace}", file=tool.stdin, flush=True)
            return tool.stdout.readline().rstrip("\n")

        yield name
        tool.stdin.close()
        assert tool.wait(60.0) == 0


@given(
    st.text("/ab_Z9", max_size=30) | st.lists(st.text("abXY_01", min_size=1, max_size=12), max_size=6).map("/".join),
    st.integers(0, 232),
)
def test_the_file_has_the_name_that_python_gives_it(named, namespace, domain):
    assert named(domain, namespace) == file_name(domain, namespace)


def test_the_domain_is_that_of_ros_and_one_that_ros_would_not_take_is_refused_in_a_sentence(space, take, monkeypatch):
    for domain, number in {"232": 232, "0": 0, "": 0, "233": None, "-1": None, "07": None, "1x": None}.items():
        monkeypatch.setenv("ROS_DOMAIN_ID", domain)
        asked = take(domain="")
        if number is None:
            assert asked.said == f"the ROS domain is '{domain}'; a whole number from 0 to 232 is needed"
        else:
            assert asked.said == f"{page(space, number)} 0"
            asked.close()


# what passes


@pytest.fixture
def servo(mine):
    """The servo's side of the page."""
    servo = mine(SERVO)
    yield servo
    servo.close()


@pytest.fixture
def device(take):
    device = take()
    yield device
    device.close()


def write(servo, written, deadline, period, *motor, session=1, engaged=1):
    block = np.zeros(shared_memory.SERVO_WORDS, np.int64)
    shared_memory.write_servo(servo.words, block, session, written, deadline, period, engaged, np.array(motor))


def device_block(words):
    block = np.zeros(shared_memory.DEVICE_WORDS, np.int64)
    assert atomic.collect(words, shared_memory.DEVICE_LOCK, shared_memory.DEVICE_FIRST, block) >= 0
    return block


def now_ns():
    return int(clock.now_ns(clock.scratch()))


def test_what_the_servo_writes_reaches_the_device_word_by_word_and_once(servo, device):
    now = now_ns()
    assert device.ask("read", WATCHDOG)[0] == "0"
    write(servo, now, now + 250_000, 250_000, 0.5, -1.5, 1e-300, session=2**47 + 1)
    answer = device.ask("read", WATCHDOG)
    assert list(map(int, answer[:6])) == [1, 2**47 + 1, now, now + 250_000, 250_000, 1]
    assert list(map(float, answer[6:])) == [0.5, -1.5, 1e-300]
    assert device.ask("read", WATCHDOG) == ["0", *answer[1:]]
    servo.words[shared_memory.SERVO_LOCK] |= 1  # it dies in a write
    assert device.ask("read", WATCHDOG)[0] == "0"


def test_what_the_device_writes_reaches_the_servo_word_by_word_and_a_delay_is_never_less_than_none(space, device):
    link, before = SharedMemoryInterface(page(space).name, 7), now_ns()
    assert link.delay() == 0.0
    [session] = device.ask("write", 1000, 132, -(2**40), 7, 0, 0.25, -0.5, 1e-300, 345_000)
    block = device_block(link.memory)
    assert block[:3].tolist() == [int(session), 1000, 132] and before <= block[3] <= now_ns()
    assert block[4:7].tolist() == [-(2**40), 7, 0] and block[7:10].view(np.float64).tolist() == [0.25, -0.5, 1e-300]
    assert link.delay() == pytest.approx(345e-6, rel=1e-12) and int(session) > 0
    for told in (-1, -(2**63)):
        device.ask("write", 1, 0, 0, 0, 0, 0.0, 0.0, 0.0, told)
        assert link.delay() == 0.0
    link.close()


def test_a_sample_of_a_clock_that_is_far_ahead_is_not_read(space, device):
    link, sample = SharedMemoryInterface(page(space).name, 7), np.zeros(hardware_interface.SAMPLE)
    for ahead, count, kept in ((0, 1, 1), (hardware_interface.AHEAD, 2, 2), (60_000_000_000, 3, 2)):
        now = now_ns()
        device.ask("write", now + ahead, 0, count, 0, 0, 0.0, 0.0, 0.0, 0)
        assert link.read(link.memory, now, now, sample) == (count == kept)
        assert sample[hardware_interface.COUNTS] == kept
    link.close()


def test_the_motor_watchdog_waits_its_time_and_no_longer(device):
    assert [device.ask("watchdog", age, 15) for age in (-1, 14, 15, 16)] == [["0"], ["0"], ["0"], ["1"]]


def test_a_write_from_before_the_device_came_moves_nothing(take, servo):
    now = now_ns()
    write(servo, now, now + 1_000_000, 1_000_000, 5.0, 0.0, 0.0)
    device = take()
    assert device.ask("read", WATCHDOG)[0] == "0"
    device.close()


SHORTEST, LONGEST = servo_writes.PERIODS
FAR, END, MS = 60_000_000_000, 2**62, 1_000_000
TAKEN = [  # written and deadline from now [ns], period, motor
    (0, 0, SHORTEST, 0.0),
    (0, 2 * LONGEST, LONGEST, 1e308),
    (0, WATCHDOG, MS, -1e308),
]
REFUSED = [
    *((0, 0, period, 0.0) for period in (SHORTEST - 1, LONGEST + 1, 0, -(2**63), 2**63 - 1)),
    *((0, away, MS, 0.0) for away in (FAR, -FAR, END, -END)),
    *((away, 0, MS, 0.0) for away in (FAR, -FAR, END, -END)),
    *((0, 0, MS, motor) for motor in (math.inf, -math.inf, math.nan)),
]


def test_a_write_of_nonsense_is_refused_and_the_command_stays_as_it_was(servo, device):
    kept = device.ask("read", WATCHDOG)[1:]
    for number, (written, deadline, period, motor) in enumerate(TAKEN + REFUSED):
        for axis in range(3):
            now, motors = now_ns(), np.zeros(3)
            motors[axis] = motor
            write(servo, now + written, now + deadline, period, *motors)
            answer, taken = device.ask("read", WATCHDOG), number < len(TAKEN)
            assert answer[0] == ("1" if taken else "-1") and (taken or answer[1:] == kept), (written, deadline, period)
            kept = answer[1:]


def test_no_record_is_ever_torn_whichever_side_reads_and_one_of_a_killed_writer_is_followed_by_whole_ones(take, servo):
    device, seen, block = take(), set(), np.zeros(shared_memory.DEVICE_WORDS, np.int64)
    assert device.ask("torn", 2_000) == ["0"]
    device.order("hammer", 10**15)

    def many():
        turn = atomic.collect(servo.words, shared_memory.DEVICE_LOCK, shared_memory.DEVICE_FIRST, block)
        assert turn < 0 or len({int(word) for word in block[[1, 2, 4, 5, 6, 10]]}) == 1
        seen.add(int(block[1]))
        return len(seen) > 300

    until(many, "records that differ", look=lambda: None)
    device.kill()
    servo.words[shared_memory.DEVICE_LOCK] |= 1
    device = take()
    assert device.said.endswith(" 0") and not servo.stale  # the servo holds it
    device.ask("write", 5, 0, 1, 2, 3, 0.0, 0.0, 0.0, 0)
    assert device_block(servo.words)[[1, 4, 5, 6]].tolist() == [5, 1, 2, 3]
    device.close()
