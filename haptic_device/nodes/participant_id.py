# SPDX-License-Identifier: Apache-2.0
"""A node that is killed and started again gets a network port of its own, which nobody has sent to before.

Fast DDS passes messages on one host through a queue in shared memory, one for each port, and a port is numbered by the
least participant id that is free. Of a reader that was killed (SIGKILL) while it took a message, the others do not
notice the end: they go on filling its queue, and a successor on the same port hears nobody but itself, for good
(https://github.com/eProsima/Fast-DDS/issues/5469). So a participant id is drawn whose queues do not exist: neither of
somebody who lives, nor of somebody who died. Each kind of node has ids of its own, so that no two that start at once
draw the same.
"""

import contextlib
import os
import random
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

from haptic_device.process import environment

PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
KINDS = ("haptic_driver", "haptic_loopback", "haptic_simulation", "haptic_recorder")
AS = {"haptic_bridge": "haptic_loopback"}  # of the two only one can serve a display
FIRST, EACH = 8, 6  # ids below are left to others; beyond 31 nobody looks on the loopback interface
QUEUES = Path("/dev/shm")
_SPACE = "http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"
_BARE = f'<profiles xmlns="{_SPACE}"><participant profile_name="own_id" is_default_profile="true"/></profiles>'


@contextlib.contextmanager
def own_participant_id(kind: str) -> Iterator[None]:
    """The node of this kind that is made inside takes a port of its own.

    Fast DDS profiles that the environment names are kept; where they cannot be read, or choose an id, or every id of
    the kind has been used, nothing is done.
    """
    given = os.environ.get(PROFILES)
    ids = free_ids(kind)
    profiles = _profiles(given, random.choice(ids)) if ids else None
    if profiles is None:
        yield
        return
    with tempfile.NamedTemporaryFile(suffix=".xml") as file, environment({PROFILES: file.name}):
        file.write(profiles)
        file.flush()
        yield


def free_ids(kind: str) -> list[int]:
    """Participant ids of the kind whose queues do not exist in this domain; none for a kind that has no ids."""
    kind = AS.get(kind, kind)
    if kind not in KINDS:
        return []
    first = FIRST + EACH * KINDS.index(kind)
    return [number for number in range(first, first + EACH) if not any(queue.exists() for queue in queues(number))]


def queues(number: int) -> list[Path]:
    """Files of the two queues of a participant id, in the domain of the environment (RTPS 2.5, 9.6.2)."""
    domain = os.environ.get("ROS_DOMAIN_ID", "")
    base = 7400 + 250 * (int(domain) if domain.isdigit() else 0) + 2 * number
    return [QUEUES / f"fastrtps_port{base + offset}" for offset in (10, 11)]


def _profiles(given: str | None, number: int) -> bytes | None:
    """The given file of profiles with this id for its default participant; None if that cannot be."""
    try:
        profiles = ElementTree.fromstring(Path(given).read_bytes() if given else _BARE)
    except (OSError, ElementTree.ParseError):
        return None
    participant = profiles.find(f".//{{{_SPACE}}}participant[@is_default_profile='true']")
    if participant is None or participant.find(f".//{{{_SPACE}}}participantID") is not None:
        return None
    rtps = participant.find(f"{{{_SPACE}}}rtps")
    rtps = ElementTree.SubElement(participant, f"{{{_SPACE}}}rtps") if rtps is None else rtps
    ElementTree.SubElement(rtps, f"{{{_SPACE}}}participantID").text = str(number)
    ElementTree.register_namespace("", _SPACE)
    return ElementTree.tostring(profiles)
