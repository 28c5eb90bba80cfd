# SPDX-License-Identifier: Apache-2.0
"""What a writer of bags that is killed leaves behind; what it flushed is read in test/unit/test_recording.py."""

import subprocess
import sys


def test_a_writer_that_is_killed_leaves_no_reserve_behind(tmp_path, start):
    code = "import sys, pathlib; from haptic_device.recording.writer import Bag; bag = Bag(pathlib.Path(sys.argv[1]))"
    ending = "; print('begun', flush=True); sys.stdin.read()"
    writer = start(
        [sys.executable, "-c", code + ending, str(tmp_path / "bag")], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert writer.stdout.readline() == "begun\n"
    writer.kill()
    writer.wait()
    assert [path.name for path in (tmp_path / "bag").iterdir()] == ["bag_0.mcap"]
