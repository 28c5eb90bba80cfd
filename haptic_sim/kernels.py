# SPDX-License-Identifier: Apache-2.0
"""What is compiled in advance (haptic_device/jit.py): each entry makes ready what a node or a command makes ready."""

import numba
import numpy as np

from haptic_device import controller_config, parameters
from haptic_device.control import contact_model, exchange_samples, records
from haptic_device.description import load_device
from haptic_device.device import axis_rerun, loopback_config, operator_hand, simulated_device
from haptic_device.device import wall_tapping as cell
from haptic_device.message_fields import LOCAL_CONTACT, MOST, exchange_names
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
from haptic_sim.exchange.simulation import Simulation
from haptic_sim.method_registry import make
from haptic_sim.node.parameters import PARAMETERS
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

NODES = {**parameters.NODES, "haptic_simulation": PARAMETERS}
DEVICE = "desktop"
FREE, JOINTED, IN_CLOSED_FORM = "push_block", "ratchet", "wall"  # a scene of each kind
SUB_STEP = 1e-3  # [s]


def driven():
    """The driver's servo, and all by which others meet it."""
    thread = ServoThread(null_device.NullDevice(), _settings())
    thread.gains.put(controller_config.gains_from(_values("haptic_driver")))
    thread.ring.take(1)
    scratch = clock.scratch()
    clock.sleep_until(clock.now_ns(scratch), scratch)
    hardware_interface.compiled()


def loopback_plant():
    """The loopback's loop around the plant."""
    words, control = np.zeros(shared_memory.WORDS, np.int64), np.zeros(simulated_device.CONTROLS, np.int64)
    truth = np.zeros(1, simulated_device.TRUTH)
    mail = SeqLock(simulated_device.TRUTH).words
    _compile(simulated_device.serve, words, control, mail, 1, *_hand(), truth)
    _compile(simulated_device.gather, mail, control, 1, 1, truth.view(np.int64).reshape(1, -1), clock.scratch())


def exchange_of_the_driver():
    """The driver's side of the exchange, with and without local contacts, on librcl and by rclpy."""
    layout = JointLayout(exchange_names(3))
    frame = exchange_step.make_frame(layout.template, layout.fixed, layout.offsets, layout.count)
    near_frame = exchange_step.make_near_frame(*CloudLayout(LOCAL_CONTACT).fixed(MOST))
    state, watch = np.zeros(1, exchange_step.STATE), np.zeros(exchange_step.WATCHES, np.int64)
    row, gains, tool = (
        np.zeros(1, records.TRACE_ROW),
        np.zeros(1, exchange_samples.COUPLING_GAINS),
        np.zeros(1, servo_loop.TOOL),
    )
    row_mail, gains_mail, tool_mail = (SeqLock(record.dtype).words for record in (row, gains, tool))
    contacts = 1, near_frame, SeqLock(contact_model.SET).words, np.zeros(1, contact_model.SET)
    _compile(exchange_step.take_in_contacts, near_frame, 1, state[0], watch, contacts[3], contacts[2])
    exchange_loop.load_library()
    buffer = np.zeros(8, np.int64)
    for near in (contacts, (None, None, None, None)):
        _compile(
            exchange_loop.run_exchange,
            1,
            1,
            buffer,
            buffer,
            1,
            frame,
            state,
            watch,
            row_mail,
            gains_mail,
            tool_mail,
            row,
            gains,
            tool,
            *near,
        )
    _compile(exchange_step.next_handle, frame, state, row_mail, gains_mail, row, gains, clock.scratch())
    _compile(exchange_step.take_in, frame, 1, state[0], watch, gains[0], tool, tool_mail, 1)


def replay():
    """The servo's ticks again, from a trace and on a recorded hand's counts."""
    settings, memory, rows, tool = _lock_step_records()
    _compile(tick_replay.recompute, settings, memory, rows, tick_replay.NO_SETS)
    _compile(tick_replay.run_on_counts, settings, memory, rows, tool, np.zeros((1, 3)), 1, 0, 1, 1)


def lock_step():
    """Servo and plant in lock-step."""
    hand = _hand()
    _compile(simulated_device.run_lockstep, *_lock_step_records(), *hand, 1, 0, 1, 1)
    operator_hand.target_at(hand[2][0], 0.0, np.zeros(3))


def wall_maps():
    """Cells of the K-B plane."""
    _compile(cell.cells, np.zeros(1, cell.CELL), np.zeros(1), np.zeros(1), np.zeros(1, cell.OUTCOME))


def identification():
    """One axis run again under recorded forces."""
    reals = np.zeros(1)
    _compile(axis_rerun.run_segments, np.zeros(2, np.int64), *[reals] * 3, *[0.0] * 5, *[reals] * 3)


def methods():
    """Generalized coordinates; from event to event it is the same kernel."""
    make("partitioned", reduce_scene(load(JOINTED)), SUB_STEP).energy()


def penalty():
    """Contacts as springs."""
    for method in ("penalty_explicit", "penalty_implicit"):
        make(method, reduce_scene(load(JOINTED)), SUB_STEP).energy()


def closed_form():
    """A tool among flat walls, and the ports behind which any method stands."""
    for method in ("pspm", "wave"):
        values = _values("haptic_simulation") | {"exchange.method": method}
        Simulation.by_parameters(reduce_scene(load(IN_CLOSED_FORM)), values)


def local_contacts():
    """What the servo's own tool may touch."""
    for scene in (FREE, JOINTED):
        Simulation(reduce_scene(load(scene), "impulse")).local_contacts.look(0.0)


def _compile(kernel, *arguments):
    kernel.compile(tuple(map(numba.typeof, arguments)))


def _values(node):
    return {parameter.name: parameter.default for parameter in NODES[node]}


def _settings():
    return controller_config.settings_from(load_device(DEVICE), _values("haptic_driver"))


def _hand():
    return loopback_config.hand_from(load_device(DEVICE), _values("haptic_loopback"))


def _lock_step_records():
    return _settings(), np.zeros(1, records.STATE), np.zeros(1, records.TRACE_ROW), np.zeros(1, servo_loop.TOOL)


ENTRIES = {  # those that take longest first
    "methods": methods,
    "servo": driven,
    "replay": replay,
    "local contacts": local_contacts,
    "exchange": exchange_of_the_driver,
    "lock-step": lock_step,
    "closed form": closed_form,
    "methods of penalty": penalty,
    "loopback": loopback_plant,
    "wall maps": wall_maps,
    "identification": identification,
}
