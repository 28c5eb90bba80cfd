# SPDX-License-Identifier: Apache-2.0
"""A ROS domain for a run: on the loopback interface alone, with nodes that meet at once.

On the loopback interface Fast DDS, in its default settings, lets a node that starts later than half a second after
another often wait up to 3 s for it, until the next announcement. Here they announce themselves every 0.1 s.
"""

import contextlib
import os
import random
import socket
from collections.abc import Iterator
from pathlib import Path

from haptic_device import ros_environment
from haptic_device.process import environment

_PORT_BASE = 32768  # the port whose owner owns the domain, as ROS 2's domain_coordinator has it
_DOMAINS = range(1, 101)
_PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
_QUICK = """<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <participant profile_name="quick_discovery" is_default_profile="true">
    <rtps><builtin><discovery_config>
      <leaseAnnouncement><sec>0</sec><nanosec>100000000</nanosec></leaseAnnouncement>
    </discovery_config></builtin></rtps>
  </participant>
</profiles>
"""


@contextlib.contextmanager
def isolated_domain(folder: Path) -> Iterator[int]:
    """Sets the environment for this process and its children, yields the domain's number, and puts all back.

    ROS_DOMAIN_ID and Fast DDS profiles given by the environment are kept. `folder` gets the profile file. Raises
    OSError if every domain is taken, ValueError if ROS would not start here.
    """
    ros_environment.check()
    with contextlib.ExitStack() as stack:
        given = os.environ.get("ROS_DOMAIN_ID")
        domain = ros_environment.domain() if given else stack.enter_context(_claimed_domain())
        settings = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": str(domain)}
        if _PROFILES not in os.environ:
            settings[_PROFILES] = _write_profile(folder)
        stack.enter_context(environment(settings))
        yield domain


@contextlib.contextmanager
def _claimed_domain() -> Iterator[int]:
    for domain in random.sample(_DOMAINS, len(_DOMAINS)):
        with contextlib.closing(socket.socket()) as claim:
            try:
                claim.bind(("127.0.0.1", _PORT_BASE + domain))
            except OSError:
                continue
            yield domain
            return
    raise OSError("all ROS domains from 1 to 100 are taken; set ROS_DOMAIN_ID")


def _write_profile(folder: Path) -> str:
    folder.mkdir(parents=True, exist_ok=True)
    profile = folder / "discovery.xml"
    profile.write_text(_QUICK)
    return str(profile.absolute())
