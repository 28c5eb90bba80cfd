# SPDX-License-Identifier: Apache-2.0
"""Where a node listens: as it is on all interfaces, with the profile of the page on security on 127.0.0.1 only."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from haptic_device.nodes.participant_id import PROFILES

PAGE = Path(__file__).parents[2] / "docs" / "how_to" / "secure.md"
NODE = """
import os, re, rclpy
from pathlib import Path
from haptic_device.nodes.participant_id import own_participant_id
with own_participant_id("haptic_driver"):
    rclpy.init()
    node = rclpy.create_node("haptic_driver")
own = [os.readlink(found) for found in Path("/proc/self/fd").iterdir() if found.is_symlink()]
rows = [row.split() for row in Path("/proc/net/udp").read_text().splitlines()[1:]]
print(*{row[1].split(":")[0] for row in rows if f"socket:[{row[9]}]" in own and int(row[1].split(":")[1], 16) < 32768})
"""  # whose ports beyond are those that it sends from


@pytest.mark.parametrize(("profiled", "address"), [(False, "00000000"), (True, "0100007F")])
def test_a_node_listens_on_all_interfaces_and_with_the_profile_of_the_page_on_this_machine_only(
    ros_domain, monkeypatch, tmp_path, profiled, address
):
    (profile,) = re.findall(r"```xml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "here.xml").write_text(profile)
    if profiled:
        monkeypatch.setenv(PROFILES, str(tmp_path / "here.xml"))
    done = subprocess.run([sys.executable, "-c", NODE], capture_output=True, text=True, timeout=100)
    assert done.stdout.split() == [address], done
