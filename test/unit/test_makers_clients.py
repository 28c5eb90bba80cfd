# SPDX-License-Identifier: Apache-2.0
"""The makers' own clients on the emulators: what they send is what the links send, byte for byte."""

import asyncio
import json
import math
import subprocess
import sys
from types import SimpleNamespace

import codec_host
import moteus as makers
import pytest
import serial.tools.list_ports
from codec_host import MS, Log, Wired

from haptic_device.link import haply, moteus

TORQUES = [(0.02, -0.05), (0.0, 0.0), (-0.12, 0.1), (1e-3, 1 / 3e2)]

HAPLY_CLIENT = """
import json, sys, time
sys.tracebacklimit = 0
from HaplyHAPI import Board, Device, Pantograph

class Joints(Pantograph):
    def torqueCalculation(self, torques):
        self.torques = torques
    def get_torque(self):
        return self.torques

port, generation = sys.argv[1], int(sys.argv[2])
turn, rest, resolution = {2: (0, (241, -61), 10752), 3: (1, (168, 12), 4880)}[generation]
board = Board("test", port, 0)
device = Device(5, board)
device.set_mechanism(Joints(generation))
device.add_actuator(1, 1, 2)
device.add_actuator(2, turn, 1)
device.add_encoder(1, 1, rest[0], resolution, 2)
device.add_encoder(2, turn, rest[1], resolution, 1)
device.device_set_parameters()
for line in sys.stdin:
    device.set_device_torques(json.loads(line))
    device.device_write_torques()
    while not board.data_available():
        time.sleep(0.001)
    device.device_read_data()
    print(json.dumps(device.get_device_angles()), flush=True)
"""


@pytest.fixture
def emulator(start, tmp_path):
    """emulator(name, …) starts one for the makers' client."""
    return lambda name, *words: codec_host.Emulator(start, name, tmp_path / "log", *words)


def our_haply(generation):
    """Our codec on a board of its own, in made-up time; and what the board told."""
    made, log = haply.codec(haply.Options(port="/dev/none", generation=generation), codec_host.five_bars()), Log()
    return Wired(made, codec_host.emulated("haply").Board(log, generation)), log


@pytest.fixture
def haply_client(start):
    """haply_client(emulator, generation) → ask(torques), which returns the angles [deg] that the client reads."""

    def run(emulator, generation):
        command = [sys.executable, "-c", HAPLY_CLIENT, emulator.port, str(generation)]
        client = start(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)

        def ask(torques):
            client.stdin.write(json.dumps(torques) + "\n")
            client.stdin.flush()
            return json.loads(client.stdout.readline())

        return ask

    return run


@pytest.mark.parametrize("generation, resolution", [(2, 10752), (3, 4880)])
def test_a_haply_gets_the_bytes_that_its_makers_client_sends_and_its_counts_are_the_angles_that_this_reads(
    emulator, haply_client, generation, resolution
):
    board, (line, ours) = emulator("haply", generation), our_haply(generation)
    ask = haply_client(board, generation)
    line.open()
    for event in (line.idle, line.idle):  # set up, and asked once with no torque
        event(after=20 * MS)
    for torques in TORQUES:
        ask(torques)
        line.write(*torques)
    theirs = board.log()
    assert ours.said("reset") == theirs.said("reset") == ["0000"]
    assert ours.said("setup") == theirs.said("setup") and len(ours.said("setup")) == 1
    assert len(theirs.said("write")) == len(TORQUES)
    assert ours.said("write") == ["02050000000000000000", *theirs.said("write")]
    assert ours.torques()[1:] == theirs.torques()
    ask((0.0, 0.0))
    line.sample(0.0, 0.0)
    for led in ((3.0, 0.0), (2.0, 0.5), (2.5, 1.2)):
        board.order(f"lead {led[0]} {led[1]}")
        line.emulator.order(["lead", *led])
        angles, counts = ask((0.0, 0.0)), line.sample(0.0, 0.0).counts
        assert angles == pytest.approx([math.degrees(angle) for angle in led], abs=1.1 * 360.0 / resolution)
        assert [counts[axis] * 360.0 / resolution for axis in range(2)] == pytest.approx(angles, abs=1e-4)


class Resolution(makers.QueryResolution):
    """What the link asks for."""

    position = makers.INT32
    velocity = torque = voltage = makers.IGNORE


@pytest.fixture
def client(monkeypatch):
    """client(emulator, script) runs script(drive 1, drive 2) with the makers' client, which finds its adapter there."""

    def run(emulator, script):
        adapter = SimpleNamespace(device=emulator.port, vid=0x0483, pid=0x5740, serial_number="1")
        monkeypatch.setattr(serial.tools.list_ports, "comports", lambda **_: [adapter])

        async def use():
            transport = makers.Fdcanusb(emulator.port)
            drives = [makers.Controller(id=name, query_resolution=Resolution(), transport=transport) for name in (1, 2)]
            try:
                return await asyncio.wait_for(script(*drives), 20.0)
            finally:
                transport.close()

        return asyncio.run(use())

    return run


def position(torque, **more):
    """Arguments of the makers' position command for this torque."""
    no_place = {"position": math.nan, "velocity": 0.0, "kp_scale": 0.0, "kd_scale": 0.0}
    return no_place | {"feedforward_torque": torque, "maximum_torque": 2.0, "watchdog_timeout": 0.5} | more


def our_moteus():
    """Our codec on drives of its own, in made-up time; and what they told."""
    options, log = moteus.Options(port="/dev/none", ids=(1, 2), watchdog=0.5), Log()
    emulated = codec_host.emulated("moteus")
    bus = emulated.Bus(log, {name: emulated.Drive(name, log, 0.0) for name in (1, 2)})
    return Wired(moteus.codec(options, codec_host.device(2, motor_limit=2.0)), bus), log


def test_moteus_drives_get_the_bytes_that_their_makers_client_sends(emulator, client):
    bus, (line, ours) = emulator("moteus", "1=0", "2=0"), our_moteus()

    async def script(one, two):
        for drive in (one, two):
            await drive.query()
        for torques in TORQUES:
            for drive, torque in zip((one, two), torques, strict=True):
                await drive.set_position(**position(torque, query=True))
        for drive in (one, two):
            await drive.set_position(**position(0.0))
        bus.order("1 fault 33")
        for drive in (one, two):
            await drive.set_position(**position(0.0, query=True))
        await one.set_stop(query=True)
        await two.set_position(**position(0.0, query=True))

    client(bus, script)
    line.open()
    for torques in TORQUES:
        line.write(*torques)
    line.cut()
    line.emulator.drives[1].break_down(line.now, 33)
    for _ in range(2):  # the second one knows of the fault
        line.write(0.0, 0.0, engaged=0)
    theirs = bus.log()
    assert theirs.said("line") == ours.said("line")
    assert theirs.said("mode") == ours.said("mode") == ["1 10", "2 10", "1 1", "1 0"]
    assert theirs.torques() == ours.torques()
