# SPDX-License-Identifier: Apache-2.0
"""`haptic docs`: writes docs/reference/parameters.md and faults.md from the code, which they cannot disagree with."""

import math
from pathlib import Path
from typing import Annotated

import typer

from haptic_device.config.parameter_types import Parameter
from haptic_device.control.faults import TABLE
from haptic_device.control.withheld import BREAK, LASTS, SHORT
from haptic_device.control.withheld import TABLE as WITHHELD
from haptic_device.os_errors import naming
from haptic_display.run.processes import parameter_text
from haptic_sim.node.parameters import NODES

HEAD = """# Parameters

Generated from the declarations by `haptic docs --out docs/reference/parameters.md`. Do not edit.

A *live* parameter may be changed while the node runs, by `haptic set` or `ros2 param set`. These commands accept `300`
for `300.0`. The other parameters are fixed at the start.

In a parameter file:

* A decimal number needs its point: `300.0`, not `300`. The words `y`, `yes`, `on`, `n`, `no` and `off` are booleans
  unless they are quoted.
* `device` and `scene` are names in `config/devices` and `config/scenes`, or paths. Every `haptic` command takes a path
  relative to the folder of the file. `ros2 run … --params-file` takes it relative to the working directory: write an
  absolute path there.
* A section `haptic_driver` applies only to a node outside any namespace. Write `/**/haptic_driver` or
  `/haptic/haptic_driver`.
* A node refuses a file that names its kind, or an unknown node, but has no section that applies to the node. Otherwise
  the node would run with its defaults. It accepts a file that names only nodes of other kinds.

`haptic check FILE` checks a file against these tables. `haptic save FILE` writes the present values of a running
display into a file.
"""
COLUMNS = "| name | default | unit | allowed | live | meaning |\n|---|---|---|---|---|---|"


FAULTS = """# Faults

Generated from `control/faults.py: TABLE` by `haptic docs --faults --out docs/reference/faults.md`. Do not edit.

A fault is a latched state in which the motor is off. It stays until it is cleared. First do what its row says, then:

| where | what to do |
|---|---|
| page of `haptic demo --view`, `haptic view` | press *Reset and engage* |
| `haptic status` | press `r`, then `e` |
| a program | call `~/reset`, then `~/enable` |

If the cause is still there, the fault is latched again at once. The page, `haptic demo` and `haptic status` show the
cause with the value that latched the fault, and what to do first where it came about (`fault_detail` and `fault_first`
in `/diagnostics`).

The device reports faults 11 to 14 by itself ([link_protocol.md](link_protocol.md#sample-4)), and haptic_bridge
finds 15 ([how exact a clock must be](link_protocol.md#how-exact-a-clock-must-be)). An end switch (13) is a
fault only while the display is enabled. While it is disabled, you can move the handle off the switch. If you enable it
on the switch, the fault is latched before any force acts.

`test/unit/test_device_faults.py` provokes every fault tick by tick, on either side of its bound. On running nodes
`test/live/smoke/test_stop_and_fault.py` and `test/live/test_fault_live.py` provoke some of them.

| code | name | in words | what latched it | what the motor does | what to do first |
|---|---|---|---|---|---|
"""
WITHHELD_FORCE = f"""
## Withheld force

Generated from `control/withheld.py: TABLE`. Withheld force is not a fault: the motor still acts, but with less force
than is wanted. It is reported if it lasts more than {LASTS:g} s without a break of more than {BREAK * 1e3:g} ms.
The page, `haptic status`, `haptic demo`, `haptic report` and `/diagnostics` show it.
`test/unit/test_withheld.py` provokes each cause of the table.
The simulation tells one more, `tool_port`: {SHORT}. It says so where this takes more than a fifth of the time; demo and
report say it from {LASTS:g} s in all.
If the simulated world [leaves time out](../theory/exchange.md#age-cuts-rates), no force is withheld, and the simulation
warns.

| bit | name | what keeps the force back | what to do |
|---|---|---|---|
"""


def docs(
    out: Annotated[Path | None, typer.Option(help="File to write; standard output if not given.")] = None,
    faults: Annotated[bool, typer.Option("--faults", help="The table of faults instead.")] = False,
):
    """Print the table of all parameters of all nodes, or of all faults, as Markdown."""
    text = fault_table() if faults else markdown(NODES)
    if out is None:
        typer.echo(text, nl=False)
    else:
        with naming(out):
            out.write_text(text, encoding="utf-8")


def fault_table() -> str:
    """The document of the faults, and of what withholds force."""
    faults = (
        f"| {each.code} | `{each.name}` | {each.title} | {each.cause} | {each.motor} | {each.first} |\n"
        for each in TABLE
    )
    withheld = (f"| {each.bit} | `{each.name}` | {each.cause} | {each.cure} |\n" for each in WITHHELD)
    return "".join((FAULTS, *faults, WITHHELD_FORCE, *withheld))


def markdown(nodes: dict[str, tuple[Parameter, ...]]) -> str:
    """The document for {node name: parameters}."""
    return HEAD + "".join(_section(node, parameters) for node, parameters in nodes.items())


def _section(node, parameters):
    rows = "\n".join(_row(parameter) for parameter in parameters)
    return f"\n## {node}\n\n{COLUMNS}\n{rows}\n"


def _row(parameter):
    live = "live" if parameter.live else ""
    name, default = f"`{parameter.name}`", f"`{parameter_text(parameter.default)}`"
    cells = [name, default, parameter.unit, _allowed(parameter), live, parameter.meaning]
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def _allowed(parameter):
    if parameter.choices:
        return ", ".join(f"`{choice}`" for choice in parameter.choices)
    low, high = math.isfinite(parameter.low), math.isfinite(parameter.high)
    if low and high:
        return f"{parameter.low} to {parameter.high}"
    return f"≥ {parameter.low}" if low else f"≤ {parameter.high}" if high else ""
