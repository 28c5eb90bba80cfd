# SPDX-License-Identifier: Apache-2.0
"""What a handle may be given while the force on it changes, by the forces that act: the truth of a late display."""

from haptic_device.jit import njit


@njit
def most_given(acts, forces, sent, start, period, moved, damping):
    """Most energy [J] that one axis gives over the period that begins at sample `start`, by any path of this way.

    acts, forces: as of `held`. With the forces f_j of this period, each for its time τ_j, and their mean F̄ that is

        max Σ (f_j Δx_j − b Δx_j²/τ_j) = F̄ Δx − b Δx²/T + Σ (f_j − F̄)² τ_j / 4b,   Σ Δx_j = Δx.
    """
    mean = held(acts, forces, sent, start, 0.0, 1)
    square = held(acts, forces, sent, start, mean, 2)
    return mean * moved - damping * moved * moved / period + square * period / (4.0 * damping)


@njit
def held(acts, forces, sent, start, less, power):
    """Mean of (f − less)^power over the period that begins at sample `start`, f the force that acts [N].

    acts, forces: of the `sent` motor values so far, when each begins to act [periods] and what it is; none acts before.
    """
    total, end, at = 0.0, start + 1.0, sent - 1
    while end > start:
        begin = max(start, acts[at]) if at >= 0 else start
        if begin < end:
            total += ((forces[at] if at >= 0 else 0.0) - less) ** power * (end - begin)
            end = begin
        at -= 1
    return total
