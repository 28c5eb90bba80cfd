# SPDX-License-Identifier: Apache-2.0
"""A clock that goes on only where somebody sleeps, in place of the module `time`."""


class Clock:
    """`monotonic`, `perf_counter_ns` and `sleep` of a module that is given this in place of `time`."""

    def __init__(self):
        self.now = 1000.0

    def monotonic(self):
        return self.now

    def perf_counter_ns(self):
        return round(self.now * 1e9)

    def sleep(self, seconds):
        self.now += seconds

    def put(self, monkeypatch, *modules):
        """These modules live by this clock."""
        for module in modules:
            monkeypatch.setattr(module, "time", self)
        return self
