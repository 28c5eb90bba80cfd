# SPDX-License-Identifier: Apache-2.0
"""What the simulation shows of its world, for pages, markers and recordings: never part of the exchange.

The node calls it after an answer has left: what it takes, some 30 us at 60 Hz, only the next question sees.
"""

import numpy as np

from haptic_device.message_fields import AXES, frame_id
from haptic_device.nodes.messages import STATE, STREAM, JointState, PointCloud2, String
from haptic_device.nodes.transforms import Transforms
from haptic_device.recording.layouts import CloudLayout, JointLayout
from haptic_sim.exchange.simulation import Simulation
from haptic_sim.protocol import STILL
from haptic_sim.scene.shapes import TOOL

PERIOD_NS = 1_000_000_000 // 60
HANDLE, RESULT, ENERGY = "handle", "result.", "energy"
CONTACT = np.dtype(
    [(name, "f8") for name in ("body_a", "body_b", "x", "y", "normal_x", "normal_y", "force_x", "force_y", "depth")]
)
"""Bodies by their place in the scene from 1, the tool is 0; point, normal from a to b, force on a [N], depth [m]."""


def state_names(scene) -> tuple[str, ...]:
    """Names of `scene/state`: three coordinates of the handle, the tool and each body, then energy and results."""
    solids = (HANDLE, TOOL, *(body.name for body in scene.bodies))
    results = tuple(f"{RESULT}{name}" for name in scene.measure)
    return tuple(f"{solid}.{axis}" for solid in solids for axis in AXES) + (ENERGY, *results)


class ScenePublisher:
    """Publishes `scene` when it is new; `scene/state`, `scene/contacts` and the tool on /tf up to 60 times a second."""

    def __init__(self, node):
        self._node, self._shown, self._due_ns = node, None, 0
        self._scene = node.create_publisher(String, "scene", STATE)
        self._state = node.create_publisher(JointState, "scene/state", STREAM)
        self._contacts = node.create_publisher(PointCloud2, "scene/contacts", STREAM)
        self._map, self._tool = (frame_id(node.get_namespace(), name) for name in ("map", TOOL))
        self._cloud, self._transforms = CloudLayout(CONTACT, self._map), Transforms(node)

    def show(self, simulation: Simulation, handle, now_ns: int) -> bool:
        """The world as it is, if it is time; whether it was. handle: its pose in the world, as last heard, or None."""
        if simulation.scene is not self._shown:
            self._introduce(simulation.scene)
        elif now_ns < self._due_ns:
            return False
        self._due_ns = max(self._due_ns + PERIOD_NS, now_ns)
        stamp = self._node.clock.stamp(now_ns)
        self._state.publish(self._layout.pack(stamp, *self._numbers(simulation, handle)))
        self._contacts.publish(self._cloud.pack(stamp, self._touching(simulation)))
        self._transforms.publish(stamp, [(self._map, self._tool, tuple(simulation.method.position))])
        return True

    def close(self) -> None:
        """Ends the publishers."""
        self._transforms.close()
        for publisher in (self._scene, self._state, self._contacts):
            self._node.destroy_publisher(publisher)

    def _introduce(self, scene):
        self._shown, self._layout = scene, JointLayout(state_names(scene), self._map)
        self._places = {TOOL: 0, **{body.name: i for i, body in enumerate(scene.bodies, 1)}}
        self._scene.publish(String(data=scene.model_dump_json(by_alias=True, exclude_unset=True)))

    def _numbers(self, simulation, handle):
        method, results = simulation.method, list(simulation.measure().values())
        poses = [method.pose(body.name) for body in simulation.scene.bodies]
        tail = [simulation.ledger.supplied, *results]
        position = [*(handle or (float("nan"),) * 3), *method.position, *(x for pose in poses for x in pose), *tail]
        still = [0.0] * (3 * len(poses) + len(tail))
        return position, [*STILL, *method.velocity, *still], [*STILL, *method.force_on_tool, *still]

    def _touching(self, simulation):
        found = simulation.method.contacts()
        rows = [
            (self._places[c.body_a], self._places[c.body_b], *c.point, *c.normal, *c.force_on_a, c.depth) for c in found
        ]
        return np.array(rows, CONTACT)
