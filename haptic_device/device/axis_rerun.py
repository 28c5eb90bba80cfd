# SPDX-License-Identifier: Apache-2.0
"""One axis run again under the motor forces of a trace: where it would have been at each latch, for any m, b, f_c."""

from haptic_device.device import plant
from haptic_device.jit import kernel, njit

SEGMENT = 500e-6  # [s] longest step of the exact solution: at most one reversal fits in


@kernel
def run_segments(begins, time, written, force, mass, damping, coulomb, bias, delay, position, velocity, out):
    """Writes into out the position [m] at every time [s], each segment from its own state.

    begins: index at which each segment begins, and the end of all; time, written: of the latch and of the motor's write
    of each tick [s]; force [N], written once a tick; bias: a constant force [N]; delay [s]: from write to effect
    and from effect to latch together; position, velocity: where each segment begins.
    """
    for s in range(begins.size - 1):
        first, end = begins[s], begins[s + 1]
        out[first] = x = position[s]
        v, acting = velocity[s], first
        while acting > 0 and written[acting] + delay > time[first]:
            acting -= 1
        for k in range(first, end - 1):
            now = time[k]
            while now < time[k + 1]:
                until = time[k + 1]
                if acting + 1 < time.size and written[acting + 1] + delay < until:
                    until = max(now, written[acting + 1] + delay)
                x, v = _hold(mass, damping, coulomb, force[acting] + bias, x, v, until - now)
                now = until
                if now < time[k + 1]:
                    acting += 1
            out[k + 1] = x


@njit
def _hold(mass, damping, coulomb, force, x, v, time):
    while time > 0.0:
        step = min(time, SEGMENT)
        x, v, _ = plant.slide(mass, damping, 0.0, coulomb, force, 0.0, x, v, step)
        time -= step
    return x, v
