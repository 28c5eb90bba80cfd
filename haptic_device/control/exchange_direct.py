# SPDX-License-Identifier: Apache-2.0
"""Exchange method `direct`: the tool as its last sample has it. Nothing is booked; only lock-step keeps it passive."""

from haptic_device.jit import kernel


@kernel
def move_set_point(tool, output):
    """The coupling pulls to the tool's last sample."""
    for i in range(output.position.size):
        output.coupling_position[i], output.coupling_velocity[i] = tool.position[i], tool.velocity[i]
