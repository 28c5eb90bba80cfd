# SPDX-License-Identifier: Apache-2.0
"""Puts the figures of `chaos.py` and `chaos.py --soak` into docs/theory/safety.md, between its marks.

python test/fault_injection/safety_table.py CHAOS_OR_SOAK.json...
"""

import json
import re
import sys
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs/theory/safety.md"
HEADS = {
    "event": "event",
    "runs": "runs",
    "force": "force N",
    "change": "change N/ms",
    "step": "step N/ms",
    "energy": "energy mJ",
    "safe": "safe ms",
    "recovered": "recovered s",
    "faults": "faults",
    "note": "note",
    "wrong": "beyond its bound",
}


def _cell(name, value):
    if name == "energy":
        return f"{1e3 * value:.3g}"
    if isinstance(value, list):
        return ", ".join(map(str, value))
    return f"{value:.3g}" if isinstance(value, float) else "" if value is None else str(value)


def _table(rows, heads):
    lines = [" | ".join(heads.values()), " | ".join("---" for _ in heads)]
    lines += [" | ".join(_cell(name, row[name]) for name in heads) for row in rows]
    return "\n".join(f"| {line} |" for line in lines)


def main():
    """Writes each file's table between the marks of its kind."""
    text = PAGE.read_text(encoding="utf-8")
    for file in sys.argv[1:]:
        found = json.loads(Path(file).read_text(encoding="utf-8"))
        kind, rows = ("chaos", found["events"]) if "events" in found else ("soak", found["nodes"])
        heads = HEADS if kind == "chaos" else {name: name for name in rows[0]}
        marks = rf"(<!-- {kind}[^\n]*-->\n).*?(<!-- end of {kind} -->)"
        table = _table(rows, heads)
        text = re.sub(marks, lambda found, table=table: f"{found[1]}{table}\n{found[2]}", text, flags=re.DOTALL)
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
