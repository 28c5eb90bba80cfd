# SPDX-License-Identifier: Apache-2.0
"""`haptic record`: everything a running system says, into a bag, until Ctrl-C."""

import time
from pathlib import Path
from typing import Annotated

import typer

from haptic_device import ros_environment
from haptic_device.nodes import FIRST_ROW
from haptic_device.nodes.bag_attachments import trial_of
from haptic_display.cli.numbers import number
from haptic_display.cli.words import next_step, shown_path
from haptic_display.run.processes import NAMESPACE, NodeDiedError, Nodes, Program, interruptible

LOOK_PERIOD = 0.05  # s
HEARING = 60.0  # [s] for the first row of a recording that has a length
RECORDER = "haptic_recorder"
_SECONDS = "Length from the first row; else until Ctrl-C."
_SIZE = "New file from this size on [MB]; 0 never."


def record(
    out: Annotated[Path | None, typer.Option(help="New folder for the bag and its log [haptic_bags/TIME].")] = None,
    seconds: Annotated[float | None, number("s", 0.1, 1e7, help=_SECONDS)] = None,
    namespace: Annotated[str, typer.Option(help="Namespace of the system to record.")] = NAMESPACE,
    participant: Annotated[str, typer.Option(help="Code of the participant.")] = "",
    condition: Annotated[str, typer.Option(help="Experimental condition.")] = "",
    field: Annotated[list[str] | None, typer.Option(help="Further fact of the trial, name=value; repeatable.")] = None,
    split_size: Annotated[float | None, number("MB", 0.0, 1e6, help=_SIZE)] = None,
    split_duration: Annotated[float | None, number("s", 0.0, 1e6, help="New file after this time [s].")] = None,
) -> None:
    """Record all topics of a running system to a rosbag2 folder (MCAP). Ctrl-C is the normal end."""
    out = (out or Path("haptic_bags") / time.strftime("%Y%m%d-%H%M%S")).absolute()
    bag = out / "bag"
    trial = {"trial.participant": participant, "trial.condition": condition, "trial.fields": field}
    given = {"bag": str(bag), **trial, "split.size": split_size, "split.duration": split_duration}
    parameters = {name: value for name, value in given.items() if value not in (None, "")}
    trial_of({"trial.fields": [], "trial.participant": participant, "trial.condition": condition} | parameters)
    program = Program(RECORDER, "haptic_device.nodes.recorder", parameters, namespace=namespace)
    with Nodes(out / "log") as nodes:
        try:
            with interruptible():
                nodes.start(program)
                if _first_row_comes(nodes, None if seconds is None else HEARING):
                    typer.echo(f"recording to {bag}", err=True)
                    _wait(nodes, seconds)
        except KeyboardInterrupt:
            typer.echo("", err=True)
        except NodeDiedError as error:
            raise ValueError(str(error)) from error
    if not (bag / "metadata.yaml").exists():
        reason = "it was ended before it began, or was cut off: haptic report reads what is there"
        raise ValueError(f"no whole bag is in {bag}: {reason}; the log is in {out / 'log'}")
    if FIRST_ROW not in nodes.printed(RECORDER):
        why = ros_environment.discovery() or "is that where the nodes run?"
        raise ValueError(f"nothing was heard of {namespace} in domain {ros_environment.domain()}; {why}")
    _print_counts(bag)


def _first_row_comes(nodes: Nodes, limit: float | None) -> bool:
    """Whether it came before `limit` [s] had passed since the recorder said anything; None: without limit."""
    said, since = "", time.monotonic()
    while FIRST_ROW not in nodes.printed(RECORDER):
        line = nodes.check()[RECORDER]
        if line != said:
            said, since = line, time.monotonic()
        if limit is not None and time.monotonic() - since >= limit:
            return False
        time.sleep(LOOK_PERIOD)
    return True


def _wait(nodes: Nodes, seconds: float | None) -> None:
    end = None if seconds is None else time.monotonic() + seconds
    while end is None or time.monotonic() < end:
        nodes.check()
        time.sleep(LOOK_PERIOD)


def _print_counts(bag: Path) -> None:
    import yaml

    information = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    for topic in information["topics_with_message_count"]:
        name = topic["topic_metadata"]["name"]
        lost = information["custom_data"].get(f"lost {name}", "0")
        typer.echo(f"{name:32} {topic['message_count']:9d} messages, lost: {lost}")
    typer.echo(f"bag {bag}")
    next_step(f"haptic report {shown_path(bag)}")
