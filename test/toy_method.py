# SPDX-License-Identifier: Apache-2.0
"""The smallest simulation method there can be: a tool that nothing meets, held to the handle by a rigid hand."""

from haptic_sim.protocol import STILL, Coupling, StepResult
from haptic_sim.scene.shapes import TOOL


class Toy:
    """Implements `World`."""

    passive, inner, touching = False, 1, False

    def __init__(self, reduced, sub_step):
        self.scene, self.sub_step = reduced.scene, sub_step
        self.reset()

    def reset(self):
        tool = self.scene.tool
        self.position, self.velocity, self.force_on_tool = tool.pose, tool.velocity, STILL

    def couple(self, coupling: Coupling):
        coupling.checked()

    def step(self, target, n):
        if n:
            row = target[-1].tolist()
            self.position, self.velocity = tuple(row[:3]), tuple(row[3:])
        return StepResult()

    def contacts(self):
        return []

    def bodies(self):
        return [(self.position, self.velocity)]

    def pose(self, body):
        return self.position if body == TOOL else next(one.pose for one in self.scene.bodies if one.name == body)

    def energy(self):
        return 0.5 * self.scene.tool.mass * (self.velocity[0] ** 2 + self.velocity[1] ** 2), 0.0
