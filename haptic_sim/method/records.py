# SPDX-License-Identifier: Apache-2.0
"""What the compiled methods calculate with: three records of fixed layout, made once for a model.

A record is passed to a kernel as one pointer, and all scenes share one compiled code. So there is a most of each thing;
a scene that needs more is refused with that number. The records: the model (constants of the scene), its layout (what
follows from it: edge normals, linkages) and the work (state of the bodies, and a record of each stage's own).
"""

import numba
import numpy as np

from haptic_sim.method.layout import lay_out
from haptic_sim.reduction.model import (
    MOST_BODIES,
    MOST_CORNERS,
    MOST_JOINTS,
    MOST_LINKED,
    MOST_PAIRS,
    MOST_SHAPES,
    Model,
    too_much,
)

MOST_ROWS = 200
STAGES = 12

_n, _s, _v, _p, _j, _r = MOST_BODIES, MOST_SHAPES, MOST_CORNERS, MOST_PAIRS, MOST_JOINTS, MOST_ROWS
_c, _k = 3 * MOST_LINKED, 2 * MOST_JOINTS
_z = 2 * MOST_ROWS + 2 * MOST_JOINTS  # of two rows one is a normal; a joint may have friction and a motor alone


def _reals(**shapes):
    return [(name, "f8", shape) for name, shape in shapes.items()]


def _whole(**shapes):
    return [(name, "i8", shape) for name, shape in shapes.items()]


MODEL = np.dtype(
    [
        *_whole(bodies=(), shapes=(), corners=(), pair_count=(), joints=()),
        *_whole(shape_body=_s, shape_start=_s + 1, pairs=(_p, 2), joint_kind=_j, joint_bodies=(_j, 2)),
        *_reals(mass=_n, inertia=_n, gravity=2, vertices=(_v, 2), radius=_s),
        *_reals(pair_friction=_p, pair_restitution=_p, pair_surface=(_p, 2)),
        *_reals(joint_anchor=(_j, 2, 2), joint_axis=(_j, 2), joint_angle=_j, joint_limit=(_j, 2), joint_friction=_j),
        *_reals(joint_motor=(_j, 2), joint_spring=(_j, 3)),
    ]
)

LAYOUT = np.dtype(
    [
        *_whole(linkages=(), pair_bodies=(_p, 2), linkage=_n, place_in=_n),
        *_whole(body_start=_n + 1, order=_n, joint_start=_n + 1, joint_order=_j),
        *_reals(
            normals=(_v, 2),
            covered=(_v, 2),
            straight=_v,
            disc=_v,
            middle=(_s, 2),
            reach=_s,
            thickness=_s,
            extent=_n,
            rate=_n,
        ),
    ]
)

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
    """(model, layout, work), arrays of one record each, bodies at the start; ValueError if there is too much."""
    if refusal := too_much(model):
        raise ValueError(refusal)
    layout = lay_out(model)
    counts = {
        "bodies": len(model.mass),
        "shapes": len(model.radius),
        "corners": len(model.vertices),
        "pair_count": len(model.pairs),
        "joints": len(model.joint_kind),
    }
    fixed = _filled(MODEL, {**model._asdict(), **counts})
    laid = _filled(LAYOUT, {**layout._asdict(), "linkages": len(layout.body_start) - 1})
    work = _filled(WORK, {"q": model.pose, "v": model.velocity})
    return fixed, laid, work


def _filled(dtype, values):
    record = np.zeros(1, dtype=dtype)
    for name, value in values.items():
        if name not in dtype.names:
            continue
        value = np.asarray(value)
        if value.ndim:
            record[name][0][tuple(slice(size) for size in value.shape)] = value
        else:
            record[name] = value
    return record.view(np.recarray) if numba.config.DISABLE_JIT else record
