# SPDX-License-Identifier: Apache-2.0
"""Makes the scene of a hundred stones again, config/scenes/gravel.yaml."""

from pathlib import Path

from bench.methods.loads import gravel_content

FILE = Path(__file__).parents[2] / "config" / "scenes" / "gravel.yaml"
COUNT, DURATION = 100, 3.0
TIP = -0.071
START, TARGET = [-0.022, 0.125, 0.0], [0.0121, 0.105, 0.0]
"""Less deep than the load of `python -m bench growth`, off the wall: a stone jammed there is more than sweeps carry."""
HEAD = """# 100 stones of 6 to 9 mm at rest between two walls 100 mm apart; the tool is a shovel, led down through them.
# Made by `python -m bench gravel`. SI: m, kg, rad; x right, y up.
name: gravel
description: A shovel in a box of a hundred stones
gravity: [0.0, -9.81]
materials:
  stone: {friction: 0.5}
bodies:
"""


def main() -> None:
    """Writes config/scenes/gravel.yaml again."""
    content = gravel_content(COUNT, DURATION)
    lines = [f"  - {_flow({key: body[key] for key in body if key != 'layers'})}" for body in content["bodies"]]
    tool = content["tool"] | {"pose": START}
    motion = content["motion"] | {"start": START, "target": TARGET}
    lines += ["tool:", *(f"  {key}: {_flow(tool[key])}" for key in ("mass", "material", "pose")), "  shapes:"]
    lines += [f"    - {_flow(shape)}" for shape in tool["shapes"]]
    ends = {"from": -round(motion["start"][1] + TIP, 6), "to": -round(motion["target"][1] + TIP, 6)}
    lines += ["measure:", f"  dug: {_flow({'body': 'tool', 'point': [0.0, TIP], 'axis': [0.0, -1.0]} | ends)}"]
    lines += ["motion:", *(f"  {key}: {_flow(motion[key])}" for key in ("name", "start", "target", "duration"))]
    FILE.write_text(HEAD + "\n".join(lines) + "\n", encoding="utf-8")


def _flow(value):
    """YAML in one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_flow, value)) + "]"
    if isinstance(value, float):  # YAML takes 3 for an integer and 5e-05 for a word
        text = f"{value:.7f}".rstrip("0")
        return text + "0" if text.endswith(".") else text
    return str(value).lower() if value is True else str(value)
