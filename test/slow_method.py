# SPDX-License-Identifier: Apache-2.0
"""A simulation method that takes as long as a test wants it to."""

import time

from toy_method import Toy


class Slow(Toy):
    """Each sub-step takes `each` seconds, and each step beside it `fixed`; `sleep` waits."""

    each = fixed = 0.0
    sleep = staticmethod(time.sleep)

    def step(self, target, n):
        self.sleep(self.fixed + n * self.each)
        return super().step(target, n)
