# SPDX-License-Identifier: Apache-2.0
"""The device page: two sides that come and go in any order, and nothing left behind."""

import errno
import fcntl
import os
import signal
import subprocess
import sys
import uuid

import numpy as np
import pytest

from haptic_device.realtime import shared_memory
from haptic_device.realtime.hardware_interface import SharedMemoryInterface
from haptic_device.realtime.shared_memory import DEVICE, SERVO, SharedMemory, SharedMemoryError

HOLDER = """
import sys
from haptic_device.realtime.shared_memory import SharedMemory
held = SharedMemory(sys.argv[1], sys.argv[2])
held.words[int(sys.argv[3])] = 77
print(held.stale, flush=True)
sys.stdin.read()
held.close()
"""
MARK = 60  # a word that neither side uses


@pytest.fixture
def name():
    name = f"haptic_display.test.{uuid.uuid4().hex}"
    yield name
    (shared_memory.FOLDER / name).unlink(missing_ok=True)


@pytest.mark.parametrize("role", [DEVICE, SERVO])
def test_a_full_memory_is_refused_in_a_sentence_and_leaves_no_file(name, role, monkeypatch):
    """Written to all the same, the process would end with SIGBUS."""

    def none_left(*of):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as full:
        full.setattr(os, "posix_fallocate", none_left)
        with pytest.raises(SharedMemoryError) as refused:
            SharedMemory(name, role)
    path = shared_memory.FOLDER / name
    assert (
        str(refused.value) == f"page {path} needs 512 bytes of /dev/shm, which cannot be had: No space left on device"
    )
    assert not path.exists()
    SharedMemory(name, role).close()


@pytest.fixture
def hold(start, name):
    """hold(role) has another process take the page and answers (process, whether it found it stale)."""

    def take(role):
        process = start([sys.executable, "-c", HOLDER, name, role, MARK], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        return process, process.stdout.readline().strip() == "True"

    return take


def there(name):
    return (shared_memory.FOLDER / name).exists()


@pytest.mark.parametrize("order", [(DEVICE, SERVO), (SERVO, DEVICE)])
@pytest.mark.parametrize("first_out", [0, 1])
def test_either_side_may_come_first_and_the_last_one_out_removes_the_page(name, order, first_out):
    sides = [SharedMemory(name, role) for role in order]
    assert [side.stale for side in sides] == [False, False]
    sides[0].words[MARK] = 5
    assert sides[1].words[MARK] == 5
    assert sides[0].peer_present() and sides[1].peer_present()
    sides[first_out].close()
    assert there(name) and not sides[1 - first_out].peer_present()
    sides[1 - first_out].close()
    assert not there(name)


@pytest.mark.parametrize("role", [DEVICE, SERVO])
def test_a_second_owner_is_refused_in_a_sentence_and_the_first_goes_on(name, role):
    first = SharedMemory(name, role)
    with pytest.raises(SharedMemoryError, match=f"{name} is held by another {role}; stop it, or use another namespace"):
        SharedMemory(name, role)
    first.words[MARK] = 1
    first.close()
    assert not there(name)


def test_a_side_that_left_may_return_while_the_other_stays(name):
    device, servo = SharedMemory(name, DEVICE), SharedMemory(name, SERVO)
    device.words[MARK] = 9
    for _ in range(3):
        servo.close()
        servo = SharedMemory(name, SERVO)
        assert not servo.stale and servo.words[MARK] == 9
    servo.close()
    device.close()


def test_closing_gives_the_role_back_even_while_somebody_still_looks_at_the_memory(name):
    device, servo = SharedMemory(name, DEVICE), SharedMemory(name, SERVO)
    view = servo.words
    servo.close()
    assert not device.peer_present()
    again = SharedMemory(name, SERVO)
    assert device.peer_present()
    for side in (again, device):
        side.close()
    assert view[0] == shared_memory.MAGIC and not there(name)


def test_asking_who_is_there_never_keeps_out_who_comes_meanwhile(name, monkeypatch):
    servo, came, ask = SharedMemory(name, SERVO), [], fcntl.fcntl

    def meanwhile(*request):
        answer = ask(*request)
        if not came:
            came.append(None)
            came[0] = SharedMemory(name, DEVICE)
        return answer

    with monkeypatch.context() as asking:
        asking.setattr(fcntl, "fcntl", meanwhile)
        servo.peer_present()
    assert servo.peer_present()
    for side in (*came, servo):
        side.close()


def test_closing_twice_is_closing_once(name):
    one, other = SharedMemory(name, DEVICE), SharedMemory(name, SERVO)
    one.close()
    one.close()
    assert there(name)
    other.close()
    assert not there(name)


@pytest.mark.parametrize("role", [DEVICE, SERVO])
def test_a_killed_owner_leaves_a_page_that_is_recognised_as_stale_and_begun_anew(name, hold, role):
    process, _ = hold(role)
    os.kill(process.pid, signal.SIGKILL)
    process.wait(60.0)
    assert there(name)
    after = SharedMemory(name, role)
    assert after.stale and after.words[MARK] == 0 and not after.peer_present()
    after.close()
    assert not there(name)


def test_a_killed_servo_is_seen_by_the_device_which_keeps_the_page_for_the_next(name, hold):
    device = SharedMemory(name, DEVICE)
    process, stale = hold(SERVO)
    assert device.peer_present() and device.words[MARK] == 77 and not stale
    os.kill(process.pid, signal.SIGKILL)
    process.wait(60.0)
    assert not device.peer_present()
    process, stale = hold(SERVO)
    assert not stale and device.peer_present()
    process.stdin.close()
    assert process.wait(60.0) == 0 and there(name)
    device.close()
    assert not there(name)


def test_an_owner_in_another_process_is_respected(name, hold):
    process, _ = hold(DEVICE)
    with pytest.raises(SharedMemoryError, match="held by another device"):
        SharedMemory(name, DEVICE)
    servo = SharedMemory(name, SERVO)
    process.stdin.close()
    process.wait(60.0)
    assert there(name)
    servo.close()
    assert not there(name)


def test_a_page_of_another_layout_is_left_alone_in_a_sentence(name):
    device = SharedMemory(name, DEVICE)
    device.words[1] = 99
    with pytest.raises(SharedMemoryError, match="has layout version 99, this program speaks 2"):
        SharedMemory(name, SERVO)
    assert not device.peer_present() and device.words[1] == 99
    device.close()


def test_a_file_of_any_content_is_taken_over(name):
    (shared_memory.FOLDER / name).write_bytes(os.urandom(100))
    side = SharedMemory(name, SERVO)
    assert (
        side.stale
        and side.words[0] == shared_memory.MAGIC
        and side.words[2:].tolist() == [0] * (shared_memory.WORDS - 2)
    )
    side.close()


def test_nobody_else_can_read_or_write_the_page(name):
    side = SharedMemory(name, DEVICE)
    assert (shared_memory.FOLDER / name).stat().st_mode & 0o777 == 0o600
    side.close()


def test_namespaces_and_domains_have_pages_of_their_own():
    pairs = [(0, "/haptic"), (0, "/left/haptic"), (0, "/right/haptic"), (1, "/haptic"), (0, "/"), (10, "/haptic")]
    names = {shared_memory.file_name(domain, namespace) for domain, namespace in pairs}
    assert len(names) == len(pairs) and not any("/" in name for name in names)
    assert shared_memory.file_name(0, "/haptic") == shared_memory.file_name("0", "haptic/")


def test_two_devices_live_side_by_side(name):
    other = f"{name}.other"
    sides = [SharedMemory(one, role) for one in (name, other) for role in (DEVICE, SERVO)]
    sides[0].words[MARK] = 3
    assert [side.words[MARK] for side in sides] == [3, 3, 0, 0]
    for side in sides:
        side.close()
    assert not there(name) and not there(other)


def test_a_page_has_room_for_the_blocks_of_both_sides():
    assert shared_memory.DEVICE_FIRST + shared_memory.DEVICE_WORDS <= shared_memory.SERVO_LOCK
    assert shared_memory.SERVO_FIRST + shared_memory.SERVO_WORDS < shared_memory.WORDS


@pytest.mark.parametrize("told, delay", [(0, 0.0), (1, 1e-9), (345_000, 345e-6), (-1, 0.0), (-(2**63), 0.0)])
def test_the_delay_that_a_device_tells_is_the_links_and_never_less_than_none(name, told, delay):
    device, link = SharedMemory(name, DEVICE), SharedMemoryInterface(name, 7)
    assert link.delay() == 0.0
    block, none = np.zeros(shared_memory.DEVICE_WORDS, np.int64), np.zeros(3)
    shared_memory.write_device(device.words, block, 1, 9, 0, 9, none, none, told)
    assert link.delay() == pytest.approx(delay, rel=1e-12)
    link.close()
    device.close()
