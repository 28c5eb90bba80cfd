# SPDX-License-Identifier: Apache-2.0
"""Where ROS goes: variables of the environment and namespaces, looked at before it dies of them or goes elsewhere."""

import os
import re
import shutil
from pathlib import Path

MOST = 232  # the highest domain whose ports exist
SHARED = Path("/dev/shm")
ROOM = 64 * 2**10  # bytes of it for what is written there with no way out: LTTng's pages and the device's
_DISCOVERY_SERVER = "ROS_DISCOVERY_SERVER"


def domain() -> int:
    """The ROS domain that the environment names. Raises ValueError, one sentence, if it names none."""
    given = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not re.fullmatch("0|[1-9][0-9]{0,2}", given) or int(given) > MOST:
        raise ValueError(f"ROS_DOMAIN_ID is {given!r}; a whole number from 0 to {MOST} is needed")
    return int(given)


def check() -> None:
    """Raises ValueError, one sentence, where ROS would not start, or, asked for domain −1, would go to domain 0."""
    domain()
    folder = _log_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        why = f"ROS keeps its log in {folder}, which cannot be made ({error.strerror})"
        raise ValueError(f"{why}; let ROS_LOG_DIR name another folder") from None


def check_room() -> None:
    """Raises ValueError, one sentence, where loading ROS may end the process by SIGBUS: to be asked before.

    For its own queues, some MB, Fast DDS looks itself, and sends over the network where there is no room.
    """
    if (free := shutil.disk_usage(SHARED).free) < ROOM:
        raise ValueError(f"{SHARED} has {free >> 10} kB free; ROS and the device's page need {ROOM >> 10} kB there")


def check_namespace(given: str) -> None:
    """Raises ValueError, one sentence, for what is no namespace of ROS."""
    if not re.fullmatch(r"/|/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", given, re.ASCII):
        raise ValueError(f"namespace is {given!r}; words of letters, digits and _ are needed, such as /haptic")


def discovery() -> str:
    """Sentence on whom this process can hear of at all; "" where nodes find each other without a server."""
    given = os.environ.get(_DISCOVERY_SERVER)
    return f"{_DISCOVERY_SERVER} is {given!r}: nodes hear of each other only if that server runs" if given else ""


def _log_folder() -> Path:
    if given := os.environ.get("ROS_LOG_DIR"):
        return Path(given)
    if given := os.environ.get("ROS_HOME"):
        return Path(given) / "log"
    if given := os.environ.get("HOME"):
        return Path(given) / ".ros/log"
    raise ValueError("HOME is not set, below which ROS keeps its log; set it, or ROS_LOG_DIR")
