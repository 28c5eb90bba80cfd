# SPDX-License-Identifier: Apache-2.0
"""What import-linter cannot say about the rooms."""

from pathlib import Path

from haptic_device.cache import BESIDE, ROOMS

ROOT = Path(__file__).parents[2]


def test_every_kernel_lies_in_a_room_whose_sources_name_the_cache():
    decorated = [
        path.relative_to(ROOT)
        for package in ("haptic_device", "haptic_sim")
        for path in (ROOT / package).rglob("*.py")
        if any(f"\n@{word}\n" in path.read_text(encoding="utf-8") for word in ("kernel", "part", "whole"))
    ]
    assert len(decorated) > 10
    assert [path for path in decorated if path.parent.as_posix() not in ROOMS and path.as_posix() not in BESIDE] == []
