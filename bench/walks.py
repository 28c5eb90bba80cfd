# SPDX-License-Identifier: Apache-2.0
"""Through which files a wall goes from its parameter to the motor, and a contact from pymunk to the hand.

A chain names functions as `file:name`, without a file in the one before. Of two neighbours one has the other's name in
its lines, as caller or as who takes the result; where neither has, both have the word after `=`. A file counts if a
function of it takes these numbers or the force made of them, judges, changes or pays for them, and hands them on; not
if it only says how things stand. Both walks end where the motor is written.
"""

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = [ROOT / name for name in ("haptic_device", "haptic_sim", "haptic_display")]
TABLE = """servo:tick > wishes:weigh_in > _fit > rows:force > pull
servo:tick > wishes:move > account:move > rows:blend
account:move > weigh > rows:force
servo:tick > account:settle"""
MOTOR = """
servo:tick > motor:command > servo_loop:run_realtime=motor > hardware_interface:__init__=write > compiled > _write"""
WALKS = {
    "a wall, from its parameter to the motor": f"""
parameters:Wall > OperatingPoint > Driver > DRIVER > driver:__init__ > lifecycle:__init__ > ros_parameters:declare
ros_parameters:declare > _initial > parameter_types:check_value
driver:__init__ > ros_parameters:on_change > _merged
driver:__init__ > _check > _settings > controller_config:settings_unjudged > settings_of > records:SETTINGS
controller_config:settings_unjudged > _set_walls
driver:_settings > gain_check:judge > margins > _left > _judged > _by_table > account:needs
gain_check:_judged > actuation_delay:set_lateness > control/passivity:weights
driver:__init__ > _apply > _set > servo_thread:set > seqlock:put > atomic:publish
servo_thread:set > _run=settings > __init__=_run_ticks > servo_loop:realtime > run_realtime > _take
servo_loop:run_realtime > run_tick > servo:tick
servo:tick > account:book
servo:tick > wishes:wish > _wish_walls > virtual_wall:wall_limit
{TABLE}{MOTOR}""",
    "a contact, from pymunk to the hand": f"""
world:step > port:step > exchange/simulation:_advance > exchange
port:step > _one_by_one > _drive > tool_side_tank:drive > port:kept_back=SHORT > exchange/simulation:exchange > _sample
exchange/simulation:exchange > endpoint:exchange > _in_time > answer > _pack > layouts:pack
endpoint:answer > node/simulation:_turn > __init__=_tool > exchange_server:__init__=tool > _run_rcl=_subscription
exchange_server:_run_rcl > exchange_loop:run_exchange > exchange_step:take_in > _judge > exchange_samples:judge_tool
exchange_step:take_in > servo_loop:run_realtime=tool > _take > atomic:collect_whole
servo_loop:run_realtime > run_tick > servo:tick > account:book
servo:tick > exchange_controller:wish > exchange_pspm:wish > set_position:slewed
servo:tick > wishes:wish > _wish_coupling
{TABLE}{MOTOR}""",
}


def main() -> None:
    """Print the two walks file by file, with their counts; ends with a sentence at a hop that the code has no more."""
    for name, chains in WALKS.items():
        lines = [f"{file.relative_to(ROOT)}: {', '.join(names)}" for file, names in walk(chains).items()]
        print(f"{name}: {len(lines)} files", *lines, sep="\n")


def walk(chains: str) -> dict[Path, list[str]]:
    """{file: functions} that the chains pass; ValueError, one sentence, for a hop that the code does not have."""
    passed: dict[Path, list[str]] = {}
    for chain in chains.strip().splitlines():
        tail, before, known = "", "", {""}
        for stop in chain.split(" > "):
            place, _, word = stop.partition("=")
            tail, name = place.split(":") if ":" in place else (tail, place)
            file, words = found(tail, name)
            linked = word in known & words if word else name in known or before in words
            if not (linked if before else not passed or name in passed.get(file, ())):
                raise ValueError(f"the code has no hop from {before or 'what comes before'} to {tail}:{name}")
            passed[file] = list(dict.fromkeys((*passed.get(file, ()), name)))
            before, known = name, words
    return passed


def found(tail: str, name: str) -> tuple[Path, set[str]]:
    """The one file whose path ends so that defines the name, and the words in that definition."""
    files = [file for package in PACKAGES for file in package.rglob(f"{tail}.py") if name in _words(file)]
    if len(files) != 1:
        raise ValueError(f"{tail}:{name} is in {len(files)} files; it must be in one")
    return files[0], _words(files[0])[name]


@cache
def _words(file: Path) -> dict[str, set[str]]:
    """{function, class or constant of a file: the names and texts in its lines}."""
    words: dict[str, set[str]] = {}
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        name = getattr(node, "name", None) or getattr(getattr(node, "targets", [None])[0], "id", "")
        inner = [each for child in ast.iter_child_nodes(node) for each in ast.walk(child)]
        texts = {text for each in inner for _, text in ast.iter_fields(each) if isinstance(text, str)}
        words[name] = words.get(name, set()) | texts
    return words
