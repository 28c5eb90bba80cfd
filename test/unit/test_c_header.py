# SPDX-License-Identifier: Apache-2.0
"""firmware/haptic_device.h: a device in C on the page, against the servo's side of it in Python."""

import math
import re
import signal
import subprocess
import uuid
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from waiting import exit_code, until

from haptic_device.control import faults
from haptic_device.realtime import atomic, clock, hardware_interface, servo_writes, shared_memory
from haptic_device.realtime.hardware_interface import SharedMemoryInterface
from haptic_device.realtime.shared_memory import DEVICE, SERVO, SharedMemory, SharedMemoryError, file_name
from haptic_sim.supervision import conformance

ROOT = Path(__file__).resolve().parents[2]
HEADER, EXAMPLE, TOOL = (
    ROOT / place for place in ("firmware/haptic_device.h", "firmware/examples/own_device.c", "test/page_tool.c")
)
SANITIZED = "-fsanitize=address,undefined", "-fno-sanitize-recover=all"
STRICT = "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-I", str(HEADER.parent)
DOMAIN = 7
REST, WATCHDOG, MOST = 6000, 15_000_000, 15.0  # of the example: counts where it rests, [ns], motor units
NAMED = {
    "MAGIC": shared_memory.MAGIC,
    "LAYOUT_VERSION": shared_memory.LAYOUT_VERSION,
    "WORDS": shared_memory.WORDS,
    "BYTES": 8 * shared_memory.WORDS,
    "DEVICE_BYTE": shared_memory.ROLE_BYTE[DEVICE],
    "SERVO_BYTE": shared_memory.ROLE_BYTE[SERVO],
    "GATE_BYTE": shared_memory.GATE_BYTE,
    "DEVICE_LOCK": shared_memory.DEVICE_LOCK,
    "DEVICE_FIRST": shared_memory.DEVICE_FIRST,
    "DEVICE_WORDS": shared_memory.DEVICE_WORDS,
    "SERVO_LOCK": shared_memory.SERVO_LOCK,
    "SERVO_FIRST": shared_memory.SERVO_FIRST,
    "SERVO_WORDS": shared_memory.SERVO_WORDS,
    "WATCHDOG": shared_memory.WATCHDOG,
    "ESTOP": faults.BUTTON,
    "HOT": faults.HOT,
    "END_SWITCH": faults.END_SWITCH,
    "ENCODER": faults.BROKEN_ENCODER,
    "CLAMPED": faults.CLAMPED,
    "ATTEMPTS": atomic.ATTEMPTS,
    "NEAR": servo_writes.NEAR,
    "SHORTEST_PERIOD": servo_writes.PERIODS[0],
    "LONGEST_PERIOD": servo_writes.PERIODS[1],
}


def compiled(source, folder, *options, compiler="gcc", standard="c99"):
    """The program made of this C."""
    made = folder / f"{source.stem}_{uuid.uuid4().hex}"
    language = {"gcc": "c", "g++": "c++"}[compiler]
    command = [compiler, f"-std={standard}", *STRICT, *options, "-o", str(made), "-x", language, str(source)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0 and not done.stderr, done.stderr
    return made


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("c")


@pytest.fixture(scope="module")
def tool(folder):
    return compiled(TOOL, folder, *SANITIZED)


@pytest.fixture(scope="module")
def example(folder):
    """The example, which says at its end what force it leaves."""
    ending = folder / "ending.c"
    ending.write_text(
        f'#define main example\n#include "{EXAMPLE}"\n#undef main\n'
        "int main(int argc, char **argv)\n{\n    int code = example(argc, argv);\n"
        '    if (code == 0)\n        printf("left %g\\n", handle.force);\n    return code;\n}\n'
    )
    return compiled(ending, folder, *SANITIZED)


@pytest.fixture
def space():
    """A namespace of the test's own, whose page is gone after it."""
    space = f"/test_{uuid.uuid4().hex}"
    yield space
    left = page(space).exists()
    page(space).unlink(missing_ok=True)
    assert not left, "the page was left"


def page(space):
    return shared_memory.FOLDER / file_name(DOMAIN, space)


class Tool:
    """test/page_tool.c on a page."""

    def __init__(self, start, program, space, domain=DOMAIN, **options):
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        self.process = start([program, str(domain), space], **pipes, **options)
        self.said = self.process.stdout.readline().rstrip("\n")

    def order(self, *words):
        print(*words, file=self.process.stdin, flush=True)

    def answer(self):
        return self.process.stdout.readline().split()

    def ask(self, *words):
        self.order(*words)
        return self.answer()

    def close(self):
        self.process.stdin.close()
        assert exit_code(self.process) == 0, self.process.stderr.read()


@pytest.fixture
def take(space, start, tool):
    """take() has another process take the page as its device."""
    return lambda **how: Tool(start, tool, space, **how)


@pytest.fixture
def serve(space, start, example):
    """serve() runs the example on the page; answers (process, what it said first)."""

    def run():
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        process = start([example, str(DOMAIN), space], **pipes)
        return process, process.stdout.readline().rstrip("\n") or process.stderr.read().rstrip("\n")

    return run


@pytest.fixture
def servo(space):
    """The servo's side of the page."""
    servo = SharedMemory(page(space).name, SERVO)
    yield servo
    servo.close()


def write(servo, written, deadline, period, *motor, session=1, engaged=1):
    block = np.zeros(shared_memory.SERVO_WORDS, np.int64)
    shared_memory.write_servo(servo.words, block, session, written, deadline, period, engaged, np.array(motor))


def device_block(words):
    block = np.zeros(shared_memory.DEVICE_WORDS, np.int64)
    assert atomic.collect(words, shared_memory.DEVICE_LOCK, shared_memory.DEVICE_FIRST, block) >= 0
    return block


def now_ns():
    return int(clock.now_ns(clock.scratch()))


def test_every_constant_of_the_header_is_that_of_the_page(folder):
    defined = re.findall(r"^#define HAPTIC_(\w+) ", HEADER.read_text(), re.MULTILINE)
    assert sorted(defined) == sorted([*NAMED, "FOLDER"])
    lines = "".join(f'    printf("%lld\\n", (long long)HAPTIC_{name});\n' for name in NAMED)
    source = folder / "constants.c"
    source.write_text(
        f'#include "haptic_device.h"\nint main(void)\n{{\n    puts(HAPTIC_FOLDER);\n{lines}    return 0;\n}}\n'
    )
    said = subprocess.run([compiled(source, folder)], capture_output=True, text=True).stdout.split()
    assert said[0] == str(shared_memory.FOLDER)
    assert dict(zip(NAMED, map(int, said[1:]), strict=True)) == NAMED


@pytest.mark.parametrize("compiler, standard", [("gcc", "c99"), ("gcc", "c17"), ("g++", "c++11"), ("g++", "c++20")])
def test_the_header_compiles_without_a_warning_in_c_and_in_cpp(folder, compiler, standard):
    source = folder / "alone.c"
    source.write_text(
        '#include "haptic_device.h"\nint main(void) { haptic_page p; return haptic_open(&p, "x", 0) != -1; }\n'
    )
    for level in ("-O0", "-O2"):
        program = compiled(source, folder, level, compiler=compiler, standard=standard)
        assert subprocess.run([program]).returncode == 0


def test_the_example_compiles_without_a_warning_and_stays_short(folder):
    compiled(EXAMPLE, folder, "-O2", "-Wconversion")
    assert len(EXAMPLE.read_text().splitlines()) <= 100


def test_the_example_keeps_every_promise_of_a_link_and_ends_with_zero(serve, space):
    process, said = serve()
    assert said == f"own_device: serves {page(space)}"
    interface = SharedMemoryInterface(page(space).name, 7)
    results = conformance.check_all(interface)
    interface.close()
    broken = [result for result in results if not result.passed and result.name != conformance.IN_TIME]
    assert len(results) == len(conformance.CHECKS) and not broken  # that one judges this machine too
    process.send_signal(signal.SIGTERM)
    assert exit_code(process) == 0 and process.stdout.read() == "left 0\n"
    assert "runtime error" not in (said := process.stderr.read()) and "Sanitizer" not in said


def counts(sample):
    return sample[hardware_interface.COUNTS]


def test_a_killed_servos_handle_goes_back_to_where_it_rests_and_a_driven_one_stays_pushed(serve, space):
    process, _ = serve()
    link = SharedMemoryInterface(page(space).name, 7)
    until(link.present, "the device is present")
    pushed = conformance.drive(link, 50, MOST)[-1].sample
    assert counts(pushed) > REST + 2000  # 10 mm
    sample = np.zeros(hardware_interface.SAMPLE)

    def back():
        link.read(link.memory, 0, 0, sample)
        return int(sample[hardware_interface.STATUS]) == shared_memory.WATCHDOG and abs(counts(sample) - REST) < 200

    until(back, "the motor is zero and the handle at rest")
    link.close()
    process.send_signal(signal.SIGINT)
    assert exit_code(process) == 0 and process.stdout.read() == "left 0\n"


def test_a_servo_that_drives_when_the_example_ends_leaves_its_motor_at_zero(serve, space):
    process, _ = serve()
    link = SharedMemoryInterface(page(space).name, 7)
    until(link.present, "the device is present")
    conformance.drive(link, 5, MOST)
    process.send_signal(signal.SIGTERM)
    assert exit_code(process) == 0 and process.stdout.read() == "left 0\n"
    until(lambda: not link.present(), "the device is gone")
    link.close()


def test_the_example_latches_once_a_deadline_and_not_between(serve, space):
    """Judged in ticks whose write came well before the deadline after it: later the device goes on by itself."""
    serve()
    link, period, ticks = SharedMemoryInterface(page(space).name, 7), 10_000_000, []
    until(link.present, "the device is present")
    sample, deadline, written = np.zeros(hardware_interface.SAMPLE), now_ns() + period, 0

    def tick():
        nonlocal deadline, written
        before, written = written, now_ns()
        deadline += period * max(0, 1 + (written - deadline) // period)
        link.write(link.memory, written, deadline, period, 1, np.zeros(3))
        latched = set()
        while now_ns() < deadline:
            link.read(link.memory, 0, 0, sample)
            latched.add((int(sample[hardware_interface.LATCHED]), conformance.is_cut(sample)))
        if written - before < 12_000_000 and written < deadline - 8_000_000 and not any(cut for _, cut in latched):
            ticks.append(sum(deadline - period <= time < deadline for time, _ in latched))
        return ticks.count(1) >= 10

    until(tick, "ticks on time", look=lambda: None)
    assert max(ticks) == 1
    link.close()


@pytest.mark.parametrize(
    "motor, clamped",
    [(MOST, False), (math.nextafter(MOST, 16), True), (-MOST, False), (math.nextafter(-MOST, -16), True)],
)
def test_the_example_says_when_it_clamps(serve, space, motor, clamped):
    serve()
    link = SharedMemoryInterface(page(space).name, 7)
    until(link.present, "the device is present")

    def driven():
        sample = conformance.drive(link, 3, motor)[-1].sample
        return [] if conformance.is_cut(sample) else [sample]

    [sample] = until(driven, "the motor acts")
    assert bool(int(sample[hardware_interface.STATUS]) & faults.CLAMPED) == clamped
    assert link.delay() > 0.0
    link.close()


def test_two_devices_on_one_page_are_refused_in_a_sentence_and_the_first_goes_on(serve, take, space):
    process, _ = serve()
    sentence = f"page {page(space)} is held by another device; stop it, or use another namespace"
    second, said = serve()
    assert said == f"own_device: {sentence}" and exit_code(second) == 1
    assert take().said == sentence
    with pytest.raises(SharedMemoryError) as refused:
        SharedMemory(page(space).name, DEVICE)
    assert str(refused.value) == sentence
    assert process.poll() is None


def test_a_device_in_c_is_refused_where_one_in_python_serves(take, space):
    ours = SharedMemory(page(space).name, DEVICE)
    assert "is held by another device" in take().said
    ours.close()
    other = take()
    assert other.said == f"{page(space)} 0"
    other.close()


def test_a_page_of_a_killed_device_is_stale_for_whoever_comes_next(serve, take, space):
    process, _ = serve()
    process.kill()
    process.wait(60.0)
    assert page(space).exists()
    process, said = serve()
    assert said == f"own_device: serves {page(space)}, left by a process that had died"
    process.kill()
    process.wait(60.0)
    ours = SharedMemory(page(space).name, DEVICE)
    assert ours.stale
    ours.close()


def test_a_device_that_was_killed_in_the_middle_of_a_write_is_followed_by_one_that_writes_whole_records(take, servo):
    device = take()
    device.order("hammer", 10**15)
    until(lambda: servo.words[shared_memory.DEVICE_LOCK] > 1000, "the device writes")
    device.process.kill()
    device.process.wait(60.0)
    servo.words[shared_memory.DEVICE_LOCK] |= 1
    device = take()
    assert device.said.endswith(" 0") and not servo.stale  # the servo holds it
    device.ask("write", 5, 0, 1, 2, 3, 0.0, 0.0, 0.0, 0)
    assert device_block(servo.words)[[1, 4, 5, 6]].tolist() == [5, 1, 2, 3]
    device.close()


@pytest.mark.parametrize("first_out", ["device", "servo"])
def test_the_last_one_out_removes_the_page_whichever_it_is(take, space, first_out):
    device, servo = take(), SharedMemory(page(space).name, SERVO)
    assert device.ask("present") == ["1"] and servo.peer_present()
    for leaves in (device, servo) if first_out == "device" else (servo, device):
        assert page(space).exists()
        leaves.close()
    assert not page(space).exists()


def test_a_device_sees_the_servo_come_and_go(take, space):
    device = take()
    for _ in range(2):
        assert device.ask("present") == ["0"]
        servo = SharedMemory(page(space).name, SERVO)
        assert device.ask("present") == ["1"]
        servo.close()
    device.order("close")  # twice, which is once
    device.answer()
    assert not page(space).exists()
    device.close()


def test_a_file_of_any_content_is_taken_over(take, space):
    page(space).write_bytes(bytes(range(1, 101)))
    device = take()
    assert device.said == f"{page(space)} 1"
    words = np.frombuffer(page(space).read_bytes(), np.int64)
    assert words[:2].tolist() == [shared_memory.MAGIC, shared_memory.LAYOUT_VERSION] and not words[2:].any()
    device.close()


def test_nobody_else_can_read_or_write_the_page(take, space):
    device = take()
    assert page(space).stat().st_mode & 0o777 == 0o600
    device.close()


def test_a_page_of_another_layout_is_left_alone_in_a_sentence(take, servo, space):
    servo.words[1] = 99
    assert (
        take().said == f"page {page(space)} has layout version 99, this program speaks {shared_memory.LAYOUT_VERSION}"
    )
    assert not servo.peer_present() and servo.words[1] == 99


def test_a_full_memory_is_refused_in_a_sentence_and_leaves_no_file(space, start, folder):
    """Written to all the same, the process would end with SIGBUS."""
    said = Tool(start, compiled(TOOL, folder, "-DFULL"), space).said
    assert said == f"page {page(space)} needs 512 bytes of /dev/shm, which cannot be had: No space left on device"
    assert not page(space).exists()


def test_what_the_servo_writes_reaches_the_device_word_by_word_and_once(take, servo):
    device, now = take(), now_ns()
    assert device.ask("read", WATCHDOG)[0] == "0"
    write(servo, now, now + 250_000, 250_000, 0.5, -1.5, 1e-300, session=2**47 + 1)
    answer = device.ask("read", WATCHDOG)
    assert list(map(int, answer[:6])) == [1, 2**47 + 1, now, now + 250_000, 250_000, 1]
    assert list(map(float, answer[6:])) == [0.5, -1.5, 1e-300]
    assert device.ask("read", WATCHDOG) == ["0", *answer[1:]]
    device.close()


def test_what_the_device_writes_reaches_the_servo_word_by_word(take, servo):
    device, before = take(), now_ns()
    [session] = device.ask("write", 1000, 132, -(2**40), 7, 0, 0.25, -0.5, 1e-300, 345_000)
    block = device_block(servo.words)
    assert block[:3].tolist() == [int(session), 1000, 132] and before <= block[3] <= now_ns()
    assert block[4:7].tolist() == [-(2**40), 7, 0] and block[7:10].view(np.float64).tolist() == [0.25, -0.5, 1e-300]
    assert block[10] == 345_000 and int(session) > 0
    device.close()


def test_a_write_from_before_the_device_came_moves_nothing(take, servo):
    now = now_ns()
    write(servo, now, now + 1_000_000, 1_000_000, 5.0, 0.0, 0.0)
    device = take()
    assert device.ask("read", WATCHDOG)[0] == "0"
    device.close()


SHORTEST, LONGEST = servo_writes.PERIODS
FAR = 60_000_000_000
SENSE = [
    (0, 0, SHORTEST, 0.0, 1),
    (0, 0, SHORTEST - 1, 0.0, -1),
    (0, 0, LONGEST, 0.0, 1),
    (0, 0, LONGEST + 1, 0.0, -1),
    (0, 0, 0, 0.0, -1),
    (0, 0, -(2**63), 0.0, -1),
    (0, 0, 2**63 - 1, 0.0, -1),
    (0, WATCHDOG, 1_000_000, 0.0, 1),
    (0, 2 * LONGEST, LONGEST, 0.0, 1),
    (0, FAR, 1_000_000, 0.0, -1),
    (0, -FAR, 1_000_000, 0.0, -1),
    (FAR, 0, 1_000_000, 0.0, -1),
    (-FAR, 0, 1_000_000, 0.0, -1),
    (0, 0, 1_000_000, 1e308, 1),
    (0, 0, 1_000_000, -1e308, 1),
    (0, 0, 1_000_000, math.inf, -1),
    (0, 0, 1_000_000, -math.inf, -1),
    (0, 0, 1_000_000, math.nan, -1),
]


def test_a_write_of_nonsense_is_refused_and_the_command_stays_as_it_was(take, servo):
    device = take()
    kept = device.ask("read", WATCHDOG)[1:]
    for written, deadline, period, motor, taken in SENSE:
        for axis in range(3):
            now, motors = now_ns(), np.zeros(3)
            motors[axis] = motor
            write(servo, now + written, now + deadline, period, *motors)
            answer = device.ask("read", WATCHDOG)
            assert (int(answer[0]), answer[1:] == kept) == (taken, taken < 0), (written, deadline, period, motors)
            kept = answer[1:]
    for written, deadline in ((2**63 - 1, 0), (-(2**63), 0), (0, 2**63 - 1), (0, -(2**63))):
        now = now_ns()
        write(servo, written or now, deadline or now, 1_000_000, 0.0, 0.0, 0.0)
        assert device.ask("read", WATCHDOG) == ["-1", *kept]
    device.close()


def test_no_record_is_ever_torn_in_c(take):
    device = take()
    assert device.ask("torn", 20_000) == ["0"]
    device.close()


def test_a_write_that_its_servo_died_in_is_none(take, servo):
    device, now = take(), now_ns()
    write(servo, now, now, 1_000_000, 1.0, 0.0, 0.0)
    servo.words[shared_memory.SERVO_LOCK] |= 1
    assert device.ask("read", WATCHDOG)[0] == "0"
    servo.words[shared_memory.SERVO_LOCK] += 1
    assert device.ask("read", WATCHDOG)[0] == "1"
    device.close()


def test_no_record_of_the_device_is_ever_torn_in_python(take, servo):
    device, seen, block = take(), set(), np.zeros(shared_memory.DEVICE_WORDS, np.int64)
    device.order("hammer", 10**15)

    def many():
        turn = atomic.collect(servo.words, shared_memory.DEVICE_LOCK, shared_memory.DEVICE_FIRST, block)
        assert turn < 0 or len({int(word) for word in block[[1, 2, 4, 5, 6, 10]]}) == 1
        seen.add(int(block[1]))
        return len(seen) > 2000

    until(many, "records that differ", look=lambda: None)
    device.process.kill()
    device.process.wait(60.0)


@given(
    namespace=st.one_of(
        st.text("/ab_Z9", max_size=30),
        st.lists(st.text("abcXYZ_019", min_size=1, max_size=12), max_size=6).map("/".join),
    ),
    domain=st.integers(0, 232),
)
def test_the_file_has_the_name_that_python_gives_it(names, namespace, domain):
    names.order(f"{domain}\t{namespace}")
    assert names.answer() == [file_name(domain, namespace)]


@pytest.fixture(scope="module")
def names(tool):
    """The tool that answers with names."""
    asked = object.__new__(Tool)
    asked.process = subprocess.Popen([tool, "names"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    yield asked
    asked.process.stdin.close()
    assert asked.process.wait(60.0) == 0
    asked.process.stdout.close()


def test_a_name_that_does_not_fit_is_told(names):
    fits = 256 - 1 - len("haptic_display.0.")
    for length, told in ((fits, False), (fits + 1, True)):
        names.order("0\t" + "a" * length)
        assert (names.process.stdout.readline() == "too long\n") == told


@pytest.mark.parametrize("domain, taken", [("0", True), ("232", True), ("233", False), ("-1", False), ("07", False)])
@pytest.mark.parametrize("where", ["argument", "environment"])
def test_a_domain_that_ros_would_not_take_is_refused_in_a_sentence(
    space, start, tool, domain, taken, where, monkeypatch
):
    monkeypatch.delenv("ROS_DOMAIN_ID")
    if where == "environment":
        monkeypatch.setenv("ROS_DOMAIN_ID", domain)
    asked = Tool(start, tool, space, domain="" if where == "environment" else domain)
    if taken:
        assert asked.said == f"{shared_memory.FOLDER / file_name(domain, space)} 0"
        asked.close()
    else:
        assert asked.said == f"the ROS domain is '{domain}'; a whole number from 0 to 232 is needed"


@pytest.mark.parametrize("domain", ["x", "1x", "1e3", "99999999999999999999"])
def test_a_domain_that_is_no_number_is_refused_in_a_sentence(space, start, tool, domain):
    assert Tool(start, tool, space, domain=domain).said.startswith(f"the ROS domain is '{domain}'; ")


def test_without_a_domain_it_is_that_of_ros(space, start, tool, monkeypatch):
    for said, domain in ((None, 0), ("", 0), ("9", 9)):
        monkeypatch.delenv("ROS_DOMAIN_ID") if said is None else monkeypatch.setenv("ROS_DOMAIN_ID", said)
        asked = Tool(start, tool, space, domain="")
        assert asked.said == f"{shared_memory.FOLDER / file_name(domain, space)} 0"
        asked.close()


def test_a_namespace_that_is_too_long_for_a_file_is_refused_in_a_sentence(start, tool):
    assert re.fullmatch(r"the namespace is longer than \d+ characters", Tool(start, tool, "/" + "a" * 400).said)


def test_the_motor_watchdog_waits_its_time_and_no_longer(take):
    device = take()
    assert [device.ask("watchdog", age, 15) for age in (-1, 14, 15, 16)] == [["0"], ["0"], ["0"], ["1"]]
    device.close()


def test_the_delay_told_is_what_99_in_100_lie_below(take):
    device, draws = take(), np.random.default_rng(0).integers(0, 1_000_000, 20_000)
    said = [int(device.ask("p99", late)[0]) for late in draws]
    assert 970_000 < np.mean(said[2000:]) < 1_000_000
    assert [int(device.ask("p99", 0)[0]) for _ in range(11_000)][-1] == 0
    device.close()
