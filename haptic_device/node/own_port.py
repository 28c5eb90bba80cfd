# SPDX-License-Identifier: Apache-2.0
"""A node that is killed and started again gets a network port of its own, which nobody has sent to before.

Fast DDS passes messages on one host through a queue in shared memory, one for each port, and a port is numbered by the
least participant id that is free. Of a reader that was killed (SIGKILL) while it took a message, the others do not
notice the end: they go on filling its queue, and a successor on the same port hears nobody but itself, for good
(https://github.com/eProsima/Fast-DDS/issues/5469). So a participant id is drawn, out of those that nobody gets unasked.
"""

import contextlib
import os
import random
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
IDS = range(40, 119)  # other participants have the least ones that are free; the last before the next domain's ports
_SPACE = "http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"
_BARE = f'<profiles xmlns="{_SPACE}"><participant profile_name="own_port" is_default_profile="true"/></profiles>'


@contextlib.contextmanager
def own_port() -> Iterator[None]:
    """The node that is made inside takes a port of its own.

    Fast DDS profiles that the environment names are kept; where they cannot be read, or choose an id, nothing is done.
    """
    given = os.environ.get(PROFILES)
    profiles = _profiles(given)
    if profiles is None:
        yield
        return
    with tempfile.NamedTemporaryFile(suffix=".xml") as file:
        file.write(profiles)
        file.flush()
        os.environ[PROFILES] = file.name
        try:
            yield
        finally:
            os.environ.pop(PROFILES)
            os.environ |= {PROFILES: given} if given else {}


def _profiles(given: str | None) -> bytes | None:
    """The given file of profiles with an id drawn for its default participant; None if that cannot be."""
    try:
        profiles = ElementTree.fromstring(Path(given).read_bytes() if given else _BARE)
    except (OSError, ElementTree.ParseError):
        return None
    participant = profiles.find(f".//{{{_SPACE}}}participant[@is_default_profile='true']")
    if participant is None or participant.find(f".//{{{_SPACE}}}participantID") is not None:
        return None
    rtps = participant.find(f"{{{_SPACE}}}rtps")
    rtps = ElementTree.SubElement(participant, f"{{{_SPACE}}}rtps") if rtps is None else rtps
    ElementTree.SubElement(rtps, f"{{{_SPACE}}}participantID").text = str(random.choice(IDS))
    ElementTree.register_namespace("", _SPACE)
    return ElementTree.tostring(profiles)
