# SPDX-License-Identifier: Apache-2.0
"""Managed nodes driven from outside, as `ros2 lifecycle` and a launch file do: each state is what it says."""

import rclpy
from lifecycle_msgs.msg import State, Transition
from live_nodes import SLOW
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.signals import SignalHandlerOptions

from haptic_sim.node.network_emulator import NetworkEmulator

NODES = {
    "haptic_loopback": {},
    "haptic_driver": {"auto_enable": True, **SLOW},
    "haptic_simulation": {"scene": "free_space"},  # its tool is where the handle is
}
INACTIVE, ACTIVE = State.PRIMARY_STATE_INACTIVE, State.PRIMARY_STATE_ACTIVE


def test_an_estop_outlives_a_deactivation_also_with_auto_enable(ear):
    def again():
        ear.change("haptic_driver", Transition.TRANSITION_ACTIVATE, ACTIVE)
        ear.news("haptic_driver", lambda level, message, values: values["fault"] == "estop", what="the e-stop")
        assert ear.trigger("enable") == (False, "fault estop is latched; call ~/reset first")

    ear.until(lambda: ear.trigger("estop")[0] and ear.state("haptic_driver") == ACTIVE, "an active driver's e-stop")
    ear.change("haptic_driver", Transition.TRANSITION_DEACTIVATE, INACTIVE)
    again()
    ear.cleared()
    ear.change("haptic_driver", Transition.TRANSITION_DEACTIVATE, INACTIVE)
    assert ear.trigger("estop") == (True, "e-stop latched for when the node is active again")
    again()


def test_who_disables_an_inactive_driver_finds_it_idle_when_it_is_active_and_the_next_time_it_enables_by_itself(ear):
    heard = ear.said["haptic_driver"]

    def states(after):
        """Those that were told since the last activation, once it has gone on for so many ticks."""
        ear.change("haptic_driver", Transition.TRANSITION_ACTIVATE, ACTIVE)
        begin = len(heard)
        ear.until(lambda: len(heard) > begin and int(heard[-1][2]["ticks"]) > after, f"{after} ticks")
        return [values["state"] for _, _, values in heard[begin:]]

    ear.cleared()
    # of what was said before, nothing is heard later
    ear.news("haptic_driver", lambda level, message, values: values["state"] == "idle", what="it is idle")
    ear.change("haptic_driver", Transition.TRANSITION_DEACTIVATE, INACTIVE)
    assert ear.trigger("disable") == (True, "motor zero: the servo does not run")
    assert set(states(after=2 * SLOW["servo__rate"])) == {"idle"}
    ear.change("haptic_driver", Transition.TRANSITION_DEACTIVATE, INACTIVE)
    states(after=1)
    ear.news("haptic_driver", lambda level, message, values: values["state"] != "idle", what="enabled by itself")


def test_a_relay_that_is_configured_and_cleaned_up_again_and_again_keeps_nothing():
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = NetworkEmulator()

        def entities():
            return len(list(node.subscriptions)), len(list(node.publishers))

        before = entities()
        for _ in range(3):
            assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
            assert entities() == (before[0] + 3, before[1] + 3)
            assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
            assert entities() == before
        node.finish()
        node.destroy_node()
    finally:
        rclpy.shutdown()
