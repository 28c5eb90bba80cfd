# SPDX-License-Identifier: Apache-2.0
"""Measurements of the display: `python -m bench` in the clone lists them. Nothing of it is installed."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "test"))  # of searches
