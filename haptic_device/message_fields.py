# SPDX-License-Identifier: Apache-2.0
"""Names of the fields of our messages; apart, so that who only reads them loads neither ROS nor a compiler."""

import numpy as np

AXES = ("x", "y", "theta")
TAIL = (
    "layout_version",
    "session",  # of the sender's run, random 48 bits
    "sequence",  # own, from 1
    "answered_session",  # session and sequence of the sample this one answers; 0 where it answers none
    "answered",
    "exchange_method",
    "gains_hash",
    "stiffness",  # of the coupling, translation [N/m], [N s/m]
    "damping",
    "rotational_stiffness",  # [N m/rad], [N m s/rad]
    "rotational_damping",
    "contact",  # 1 while the tool touches something
    "energy",  # [J] shipped by the sender so far, cumulative so that a lost sample loses none
)
"""After the axes of `handle` and `tool`."""

MOST = 8  # contacts in a set
COMMON = (
    *("session", "sequence", "answered_session", "answered"),  # of the tool sample that it goes with
    *("scene", "offered", "trust"),  # worlds loaded so far; contacts there were; way [m] within which no other matters
    *("mass", "inertia", "extent"),  # of the tool; farthest point from its origin
    *("gravity_x", "gravity_y", "tool_pose_x", "tool_pose_y", "tool_pose_theta"),
)
EACH = (
    *("identity", "group", "kind", "gap"),  # identity 0: no contact in this place; group 0: of none
    *("point_x", "point_y", "tool_x", "tool_y"),  # of the other body, in the world; of the tool, in its frame
    *("normal_x", "normal_y", "low", "high"),  # in the world; FLAT_HERE: in the tool's frame
    *("radius", "tool_radius", "friction", "restitution"),  # radius: ρ, both together
    *("velocity_x", "velocity_y", "turn_rate"),  # of the other body at its point
    *("mobility", "slip_mobility", "force"),  # of the other body along normal and tangent [1/kg]; on it already [N]
)
LOCAL_CONTACT = np.dtype([(name, "f8") for name in COMMON + EACH])
"""A point of `local_contacts`: what the whole set says, and one contact. A message has MOST of them."""


def frame_id(namespace: str, name: str) -> str:
    """The frame of this name of the display in a namespace: map (of the scene), base_link (of the device; both as in
    REP-105), handle or tool. Two displays share none, unless / and _ are all that their namespaces differ in."""
    return "_".join(filter(None, (*namespace.split("/"), name)))


def exchange_names(axes: int) -> tuple[str, ...]:
    """Names of a `handle` or `tool` message with that many axes."""
    return AXES[:axes] + TAIL


def truth_names(axes: int) -> tuple[str, ...]:
    """Names of `operator/state` with that many axes."""
    return AXES[:axes] + tuple(f"motor_{name}" for name in AXES[:axes]) + ("energy_given", "time", "motion_done")
