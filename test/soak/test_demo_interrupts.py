# SPDX-License-Identifier: Apache-2.0
"""`haptic demo` interrupted while it starts."""

import signal

import pytest
from live_demo import BUSY, children, demos, ends_well, until
from live_nodes import loaded

pytestmark = pytest.mark.timeout(900)

MOMENTS = {
    "its first node is there": (signal.SIGINT, lambda run: children(run.process)),
    "it loads ROS while its nodes start": (signal.SIGINT, lambda run: loaded(run.process, "rclpy")),
    "its bag is open": (signal.SIGTERM, lambda run: run.bag.exists()),
}


@pytest.mark.parametrize("moment", MOMENTS)
def test_an_interrupt_at_its_start_leaves_no_process_no_page_and_no_half_written_bag(tmp_path, moment):
    number, come = MOMENTS[moment]
    with demos(tmp_path) as demo:
        run = demo(*BUSY)
        until(lambda: come(run), moment, said=lambda: run.progress)
        ends_well(run, number)
