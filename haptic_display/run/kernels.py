# SPDX-License-Identifier: Apache-2.0
"""What is compiled in advance (haptic_device/jit.py): each entry is a short run of what a node or a command runs."""

import importlib

import numpy as np

from haptic_device.config.description import load_device
from haptic_device.config.link_registry import LINKS
from haptic_device.config.parameter_types import defaults
from haptic_device.control import contact_model, controller_config, exchange_samples
from haptic_device.control.records import TRACE_ROW
from haptic_device.device import axis_rerun, loopback_config, operator_hand, simulated_device
from haptic_device.link import bridge_loop
from haptic_device.message_fields import LOCAL_CONTACT, MOST, exchange_names
from haptic_device.os_errors import in_words
from haptic_device.process import say
from haptic_device.realtime import (
    clock,
    exchange_loop,
    exchange_step,
    hardware_interface,
    null_device,
    servo_loop,
    shared_memory,
    tick_replay,
)
from haptic_device.realtime.seqlock import SeqLock
from haptic_device.realtime.servo_thread import ServoThread
from haptic_device.recording.layouts import CloudLayout, JointLayout
from haptic_device.theory import zwidth
from haptic_sim.exchange.endpoint import ExchangeEndpoint
from haptic_sim.exchange.simulation import Simulation
from haptic_sim.lockstep.lockstep import Lockstep
from haptic_sim.lockstep.recorded_operator import PlayedDevice
from haptic_sim.lockstep.trace_verification import verdict_on
from haptic_sim.method_registry import make
from haptic_sim.node.parameters import NODES
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

DEVICE = "desktop"
FREE, JOINTED, IN_CLOSED_FORM = "push_block", "ratchet", "wall"  # a scene of each kind
LONGEST = 500  # characters of why a link cannot be compiled
TIME = 1e-3  # [s] that a run lasts, and a sub-step


def driven():
    """The driver's servo, and all by which others meet it."""
    values = _values("haptic_driver")
    settings = controller_config.settings_from(load_device(DEVICE), values)
    thread = ServoThread(null_device.NullDevice(), settings)
    thread.gains.put(controller_config.gains_from(values, settings))
    thread.ring.take(1)
    scratch = clock.scratch()
    clock.sleep_until(clock.now_ns(scratch), scratch)
    hardware_interface.compiled()


def loopback_plant():
    """The loopback's loop around the plant, told to stop before it begins."""
    words, control = np.zeros(shared_memory.WORDS, np.int64), np.zeros(simulated_device.CONTROLS, np.int64)
    control[simulated_device.STOP] = 1
    truth, mail = np.zeros(1, simulated_device.TRUTH), SeqLock(simulated_device.TRUTH).words
    hand = loopback_config.hand_from(load_device(DEVICE), _values("haptic_loopback"))
    simulated_device.serve(words, control, mail, 1, *hand, truth)
    simulated_device.gather(mail, control, 1, 1, truth.view(np.int64).reshape(1, -1), clock.scratch())


def bridge():
    """The bridge's loop, and the codec of each link."""
    bridge_loop.compiled()
    for name, module in LINKS.items():
        try:
            importlib.import_module(module).compiled()
        except Exception as error:  # of one link: the others are compiled all the same
            if module.startswith("haptic_device."):
                raise
            say(f"link {name} ({module}) cannot be compiled: {type(error).__name__}: {in_words(error)[:LONGEST]}")


def exchange_of_the_driver():
    """The driver's side of the exchange, with and without local contacts, told to stop before it touches librcl."""
    layout, buffer = JointLayout(exchange_names(3)), np.zeros(8, np.int64)
    frame = exchange_step.make_frame(layout.template, layout.fixed, layout.offsets, layout.count)
    near_frame = exchange_step.make_near_frame(*CloudLayout(LOCAL_CONTACT).fixed(MOST))
    state, watch = np.zeros(1, exchange_step.STATE), np.zeros(exchange_step.WATCHES, np.int64)
    watch[exchange_step.STOP] = 1
    records = [np.zeros(1, kind) for kind in (TRACE_ROW, exchange_samples.COUPLING_GAINS, servo_loop.TOOL)]
    mails = [SeqLock(record.dtype).words for record in records]
    near = exchange_loop.Near(1, near_frame, SeqLock(contact_model.SET).words, np.zeros(1, contact_model.SET))
    line = exchange_loop.Line(1, 1, buffer, buffer, frame, 1)
    owned = exchange_loop.Mails(*mails), exchange_loop.Records(*records)
    exchange_loop.load_library()
    for contacts in (near, None):
        exchange_loop.run_exchange(line, state, watch, *owned, contacts)


def replay():
    """The servo's ticks on a recorded hand, and again from their trace."""
    system = _lock_step(hand=PlayedDevice(np.zeros(1), np.zeros((1, 3))))
    start = tick_replay.snapshot_of(-1, system.settings[0], system.memory[0])
    verdict_on(system.run(TIME), start)


def lock_step():
    """Servo and plant in lock-step."""
    system = _lock_step()
    system.run(TIME)
    operator_hand.target_at(system.motion[0], 0.0, np.zeros(3))


def wall_maps():
    """Cells of the K-B plane."""
    zwidth.run_cells(zwidth.Setup(0.1, 1.0, TIME, seconds=10.0 * TIME), zwidth.operators_of("none"), 1.0, 0.0)


def identification():
    """One axis run again under recorded forces, over no tick."""
    reals = np.zeros(1)
    axis_rerun.run_segments(np.zeros(2, np.int64), *[reals] * 3, *[0.0] * 5, *[reals] * 3)


def methods():
    """Generalized coordinates; from event to event it is the same kernel."""
    make("partitioned", reduce_scene(load(JOINTED)), TIME).energy()


def penalty():
    """Contacts as springs."""
    for method in ("penalty_explicit", "penalty_implicit"):
        make(method, reduce_scene(load(JOINTED)), TIME).energy()


def closed_form():
    """A tool among flat walls, the ports behind which any method stands, and what judges their samples."""
    values = _values("haptic_simulation")
    simulation = Simulation.by_parameters(reduce_scene(load(IN_CLOSED_FORM)), values)
    ExchangeEndpoint(simulation, simulation.scene.tool.pose, values["exchange.method"])


def local_contacts():
    """What the servo's own tool may touch."""
    for scene in (FREE, JOINTED):
        Simulation(reduce_scene(load(scene), "impulse")).local_contacts.look(0.0)


def _values(node):
    return defaults(NODES[node])


def _lock_step(hand=None):
    return Lockstep(load_device(DEVICE), _values("haptic_driver"), _values("haptic_loopback"), None, hand=hand)


ENTRIES = {  # those that take longest first
    "methods": methods,
    "servo": driven,
    "replay": replay,
    "local contacts": local_contacts,
    "exchange": exchange_of_the_driver,
    "bridge": bridge,
    "lock-step": lock_step,
    "closed form": closed_form,
    "methods of penalty": penalty,
    "loopback": loopback_plant,
    "wall maps": wall_maps,
    "identification": identification,
}
