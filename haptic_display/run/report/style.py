# SPDX-License-Identifier: Apache-2.0
"""How a report looks: its verdict, and its page (report.css), light and dark; pictures stay on white."""

from pathlib import Path

LEVELS = {"good": ("Good.", "#0b6b3a"), "warn": ("Look at this.", "#8a4b00"), "bad": ("Not good.", "#a3160f")}
"""Of a verdict: words, and their colour on white."""
STYLE = Path(__file__).with_name("report.css").read_text(encoding="utf-8")
