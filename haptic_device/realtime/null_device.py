# SPDX-License-Identifier: Apache-2.0
"""A device that stands still and answers at once: what is measured with it is the servo alone."""

import numpy as np

from haptic_device.jit import kernel
from haptic_device.realtime import hardware_interface


# it answers at once, so that a tick is all that is measured
class NullDevice:
    """Always there, at count 0; what the motor is told goes nowhere."""

    def __init__(self):
        self.memory = np.zeros(1, np.int64)
        self.read, self.write = read, write

    def present(self):
        return True

    def delay(self):
        return 0.0

    def watchdog(self):
        return 0.0

    def close(self):
        """Nothing is held."""


@kernel(hardware_interface.READ)
def read(memory, deadline, give_up, sample):
    sample[:] = 0.0
    sample[hardware_interface.LATCHED] = deadline
    return 1


@kernel(hardware_interface.WRITE)
def write(memory, written, next_deadline, period, engaged, motor):
    return 0
