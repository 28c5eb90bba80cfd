# SPDX-License-Identifier: Apache-2.0
"""Puts the table of docs/methods/speed_error.csv where README.md has its marks: python bench/readme_table.py."""

from pathlib import Path

from haptic_sim.bench.table import BEGIN, END, markdown, read_csv

ROOT = Path(__file__).parents[1]


def main():
    readme = ROOT / "README.md"
    before, rest = readme.read_text(encoding="utf-8").split(BEGIN)
    table = markdown(read_csv(ROOT / "docs" / "methods" / "speed_error.csv"))
    readme.write_text(f"{before}{BEGIN}\n{table}\n{END}{rest.split(END)[1]}", encoding="utf-8")


if __name__ == "__main__":
    main()
