# SPDX-License-Identifier: Apache-2.0
"""What the compiled methods calculate with: three records of fixed layout, made once for a model.

A record is passed to a kernel as one pointer, and all scenes share one compiled code. So there is a most of each thing;
a scene that needs more is refused with that number. The records: the model (constants of the scene), its layout (what
follows from it: edge normals, linkages) and the work (state of the bodies, and scratch of the kernels).
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
_z = 2 * MOST_ROWS + 2 * MOST_JOINTS  # of two rows one is a normal; a joint may have friction alone


def _fields(**shapes):
    return [(name, "i8" if name in _WHOLE else "f8", shape) for name, shape in shapes.items()]


_WHOLE = {
    "bodies",
    "shapes",
    "corners",
    "pair_count",
    "joints",
    "linkages",
    "shape_body",
    "shape_start",
    "pairs",
    "joint_kind",
    "joint_bodies",
    "pair_bodies",
    "linkage",
    "place_in",
    "body_start",
    "order",
    "joint_start",
    "joint_order",
    "active",
    "freedoms",
    "dependent",
    "pivot",
    "features",
    "row_a",
    "row_b",
    "row_linkages",
    "kind",
    "partner",
    "source",
    "index",
    "key",
    "old_key",
    "mode",
    "old_mode",
    "feature",
    "free",
    "column",
    "basis",
    "note_key",
    "note_pair",
    "counts",
    "flying",
    "moving",
    "last",
    "bottom",
    "met",
}

MODEL = np.dtype(
    _fields(
        bodies=(),
        shapes=(),
        corners=(),
        pair_count=(),
        joints=(),
        mass=_n,
        inertia=_n,
        shape_body=_s,
        shape_start=_s + 1,
        vertices=(_v, 2),
        radius=_s,
        pairs=(_p, 2),
        pair_friction=_p,
        pair_restitution=_p,
        pair_surface=(_p, 2),
        joint_kind=_j,
        joint_bodies=(_j, 2),
        joint_anchor=(_j, 2, 2),
        joint_axis=(_j, 2),
        joint_angle=_j,
        joint_limit=(_j, 2),
        joint_friction=_j,
        joint_motor=(_j, 2),
        joint_spring=(_j, 3),
        gravity=2,
    )
)

LAYOUT = np.dtype(
    _fields(
        linkages=(),
        normals=(_v, 2),
        disc=_v,
        middle=(_s, 2),
        reach=_s,
        thickness=_s,
        pair_bodies=(_p, 2),
        linkage=_n,
        place_in=_n,
        body_start=_n + 1,
        order=_n,
        joint_start=_n + 1,
        joint_order=_j,
        extent=_n,
    )
)

WORK = np.dtype(
    _fields(
        q=(_n, 3),
        v=(_n, 3),
        trial_q=(_n, 3),
        trial_v=(_n, 3),
        stage_q=(_n, 3),
        stage_v=(_n, 3),
        smooth=(_n, 3),
        slopes_q=(STAGES, _n, 3),
        slopes_v=(STAGES, _n, 3),
        force=(_n, 3),
        bias=(_n, 3),
        active=_n,
        flying=_n,
        moving=_n,
        Y=(3 * _n, _c),
        freedoms=_n,
        jacobian=(_k, _c + 2),
        row=6,
        dependent=_c,
        pivot=_k,
        N=(_c, _c),
        diagonal=_c,
        reduced=(_c, _c),
        seen=_c,
        points=(_v, 2),
        normals=(_v, 2),
        middles=(_s, 2),
        contact=11,
        features=(2, 4),
        row_a=_r,
        row_b=_r,
        row_linkages=(_r, 2),
        kind=_r,
        partner=_r,
        mu=_r,
        bound=_r,
        source=_r,
        index=_r,
        key=_r,
        old_key=_r,
        mode=_r,
        old_mode=_r,
        feature=(_r, 4),
        G=(_r, 6),
        gamma=_r,
        gap=_r,
        place=(_r, 2),
        b=_r,
        lam=_r,
        forces=_r,
        response=(_r, _n, 3),
        A=(_r, _r),
        system=(_r, _r + 1),
        free=_r,
        column=_r,
        free_v=(_n, 3),
        answer=(_n, 3),
        tableau=2 * _z * (_z + 1),
        basis=_z,
        z=_z,
        last=_r,
        bottom=_r,
        around=(_s, 2),
        met=_p,
        note=(_r, 9),
        note_key=_r,
        note_pair=_r,
        counts=5,
        port=22,
        clock=2,
        hand=(2, 6),
        pull=3,
        slopes_work=STAGES,
        slopes_lost=STAGES,
        supply=(),
        lost=(),
    )
)
"""`note`: contacts of the last step, each place (2), normal (2), impulse on b (2), overlap, force
on b while it rests (2). `counts`: refusals of
flight, rows remembered, events, contacts noted, contacts left out since there were too many at once. `port`: handle
position (3) and velocity (3), gains (4), force on the tool (3), energy supplied [J], whether a contact pushed the tool,
largest contact force [N], deepest overlap [m], contact stiffness [N/m] (0: rigid) and damping [N s/m],
whether the coupling is a force along the flight; energy that contacts, joint friction, motors and belts have taken, and
that putting constraints right has put in [J]. `clock`: time [s] since the sub-step began of the state and of a stage;
`hand`: handle (position, velocity) when it began, and how fast both change; `pull`: force of the coupling on the tool
at a stage; `supply`, `lost`: energy [J] it supplies and rows take on the way to the trial state."""


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
    fixed = _record(MODEL, {**model._asdict(), **counts})
    laid = _record(LAYOUT, {**layout._asdict(), "linkages": len(layout.body_start) - 1})
    work = _record(WORK, {"q": model.pose, "v": model.velocity})
    return fixed, laid, work


def _record(dtype, values):
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
