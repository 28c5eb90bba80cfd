# SPDX-License-Identifier: Apache-2.0
"""Parameters of haptic_recorder."""

from haptic_device.parameter import Parameter

PARAMETERS = (
    Parameter("autostart", True, "", "configure and activate by itself at start"),
    Parameter(
        "realtime",
        "prefer",
        "",
        "SCHED_FIFO, so that no load starves it, and one core",
        choices=("require", "prefer", "off"),
    ),
    Parameter("bag", "", "", "folder of the bag, new or empty; if no name is given, haptic_bags/<date>-<time>"),
    Parameter("queue", 2000, "messages", "what each topic may hold between two looks", low=1, high=100000),
    Parameter("look_period", 0.04, "s", "time between two looks at the queues", low=0.001, high=0.5),
    Parameter("flush_period", 0.25, "s", "time between chunks written out: what a kill can lose", low=0.02, high=0.75),
    Parameter("split.size", 2000.0, "MB", "size from which on a new file is begun; 0: never", low=0.0, high=1e6),
    Parameter("split.duration", 0.0, "s", "time after which a new file is begun; 0: never", low=0.0, high=1e6),
    Parameter("disk_reserve", 200.0, "MB", "with less than this free, recording stops and ends its bag", 0.0, 1e6),
    Parameter("trial.participant", "", "", "code of the participant, kept in the next bag", live=True),
    Parameter("trial.condition", "", "", "experimental condition, kept in the next bag", live=True),
    Parameter("trial.fields", ("",), "", "further facts of the trial, each as name=value", live=True),
)
