# SPDX-License-Identifier: Apache-2.0
"""What the compiled methods calculate with: the model (constants of the scene), and the work.

The work is a record too, of one layout for all scenes: state of the bodies, and a record of each stage's own.
"""

import numba
import numpy as np

from haptic_sim.reduction.model import MOST, MOST_LINKED, Model, too_much

MOST_ROWS = 200
STAGES = 12

(_n, _s, _v, _p, _j), _r = MOST, MOST_ROWS
_c, _k = 3 * MOST_LINKED, 2 * _j
_z = 2 * _r + 2 * _j  # of two rows one is a normal; a joint may have friction and a motor alone


def _reals(**shapes):
    return [(name, "f8", shape) for name, shape in shapes.items()]


def _whole(**shapes):
    return [(name, "i8", shape) for name, shape in shapes.items()]


CONTACT = _reals(gap=(), nx=(), ny=(), ax=(), ay=(), bx=(), by=(), px=(), py=(), curvature=(), owner=())
"""Gap [m], unit normal from a to b, the points of a and of b whose distance is the gap (in the plane), the point of
contact, 1/ρ [1/m], and whose the edge is: 1 if a's, -1 if b's, 0 if there is none."""

WORK = np.dtype(
    [
        *_reals(q=(_n, 3), v=(_n, 3)),  # state of the bodies: poses of the mass centres, velocities
        *_whole(active=_n),  # linkages that are being advanced
        # at the end of the sub-step; start: when it began, rate: its change in it
        (
            "handle",
            _reals(position=3, velocity=3, start_position=3, start_velocity=3, position_rate=3, velocity_rate=3),
        ),
        # event_driven: a force along the motion, not a part of the backward difference
        ("coupling", _reals(stiffness=3, damping=3) + _whole(event_driven=())),
        ("contact_model", _reals(stiffness=(), damping=())),  # [N/m], 0: rigid; [N s/m]
        # force on the tool over the last sub-step; since the call began: energy supplied [J], largest force of a pair
        # of shapes [N], deepest overlap [m], whether a contact pushed the tool
        ("port", _reals(force=3, supplied=(), largest_force=(), deepest_overlap=()) + _whole(touched=())),
        # energy [J] since the call began that contacts, joint friction, motors and belts have taken, and that
        # stabilization has put in
        ("accounts", _reals(contacts=(), correction=())),
        # sub-steps since the start in which the integration of events gave up; contacts since the call began that there
        # was no row for
        ("counters", _whole(refusals=(), left_out=())),
        # contacts of the last sub-step; on b: impulse [N s], and force [N] while it rests
        (
            "report",
            _whole(count=(), key=_r, pair=_r)
            + _reals(place=(_r, 2), normal=(_r, 2), impulse=(_r, 2), overlap=_r, resting_force=(_r, 2)),
        ),
        # where a step would lead, and the energy [J] that the coupling supplies and rows take on the way
        ("trial", _reals(q=(_n, 3), v=(_n, 3), supplied=(), taken=())),
        ("clock", _reals(state=(), stage=())),  # time since the sub-step began [s]
        *_reals(joint_row=6),
        # From here on a record belongs to the module of its name, which writes it.
        (
            "narrow_phase",
            _reals(points=(_v, 2), normals=(_v, 2), middles=(_s, 2))
            + _whole(features=(2, 4))  # kind, first, second, sign
            + [("contact", CONTACT)],
        ),
        (
            "constraints",
            _whole(body_a=_r, body_b=_r, kind=_r, partner=_r, twin=_r, source=_r, index=_r, key=_r, feature=(_r, 4))
            + _reals(mu=_r, bound=_r, G=(_r, 6), gamma=_r, gap=_r, place=(_r, 2)),
        ),
        ("warm_start", _whole(count=(), key=_r, mode=_r)),  # of constraints: modes that rows had in the last solution
        (
            "linkage",
            _reals(Y=(3 * _n, _c), bias=(_n, 3), jacobian=(_k, _c + 2), N=(_c, _c))
            + _reals(mass=_c, reduced=(_c, _c), seen=_c)
            + _whole(freedoms=_n, dependent=_c, pivot=_k),
        ),
        ("delassus_operator", _reals(force=(_n, 3), answer=(_n, 3), response=(_r, _n, 3)) + _whole(linkages=(_r, 2))),
        # w = A λ + b; mode: the first guess, then the answer
        (
            "lcp",
            _reals(A=(_r, _r), b=_r, lam=_r, system=(_r, _r + 1))
            + _whole(mode=_r, free=_r, column=_r, last=_r, bottom=_r),
        ),
        ("lemke", _reals(tableau=2 * _z * (_z + 1), z=_z) + _whole(start=_r, basis=_z)),
        # tool_force: of the coupling at a stage; slopes of the energies: power [W] of the coupling, and taken by rows
        (
            "constrained_dynamics",
            _reals(force=(_n, 3), acceleration=(_n, 3), tool_force=3, stage_q=(_n, 3), stage_v=(_n, 3))
            + _reals(slopes_q=(STAGES, _n, 3), slopes_v=(STAGES, _n, 3), slopes_supplied=STAGES, slopes_taken=STAGES),
        ),
        # linkages that the call advances, and those in motion; force: λ of the rows at its beginning
        ("event_integration", _whole(advanced=_n, moving=_n) + _reals(force=_r)),
        ("continuous_collision", _reals(around=(_s, 2)) + _whole(met=_p)),
        ("implicit_step", _reals(momentum=(_n, 3), velocity=(_n, 3))),
        ("stabilization", _reals(momentum=(_n, 3))),
        ("penalty_kernel", _reals(force=(_n, 3))),
    ]
)


def records(model: Model):
    """(model, work), arrays of one record each, bodies at the start; ValueError if there is too much."""
    if refusal := too_much(model):
        raise ValueError(refusal)
    work = np.zeros(1, dtype=WORK)
    for name, start in (("q", model.pose), ("v", model.velocity)):
        work[name][0, : len(start)] = start
    return tuple(one.view(np.recarray) if numba.config.DISABLE_JIT else one for one in (model.record, work))
