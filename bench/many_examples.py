# SPDX-License-Identifier: Apache-2.0
"""Tries what the tests try on few examples on many, other ones each time: python bench/many_examples.py [test ...]."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
USE = "from examples import"  # what a test file begins with that has a short and a long form


def main(files):
    tests = files or sorted(str(file) for file in (ROOT / "test").glob("test_*.py") if USE in file.read_text())
    return pytest.main(["--hypothesis-profile=search", "--timeout=0", *tests])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
