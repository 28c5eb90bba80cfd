# SPDX-License-Identifier: Apache-2.0
"""How far two bodies are apart."""

from haptic_sim.scene.geometry import distance


def apart(a, pose_a, b, pose_b):
    """Distance of two bodies at these poses [m], below 0 the depth: the least over all pairs of their outlines."""
    return min(distance(one, pose_a, other, pose_b) for one in a.outlines for other in b.outlines)
