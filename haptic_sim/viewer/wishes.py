# SPDX-License-Identifier: Apache-2.0
"""What a page may ask for: one JSON object a message, judged here before anything is done. ValueError sentences."""

import json
import math

LONGEST = 4096  # bytes of a message
MOST_PER_SECOND = 300
BURST = 150
AXES = ("x", "y", "theta")
TRIGGERS = ("enable", "disable", "estop", "reset")
_FIELDS = {  # what each wish carries: name → kind
    "seen": {"frame": int},
    "aim": {},
    "trigger": {"service": str},
    "set": {"name": str, "value": object},
    "scene": {"name": str},
    "method": {"name": str},
    "start_scene": {},
    "mark": {"text": str},
    "record": {"on": bool},
    "restart": {"name": str, "value": object},
    "compare": {"on": bool},
}
FREE = ("seen",)  # what a page without control may say
_TEXT = 200
LARGEST = 2.0**53  # a number beyond it is none that a page means


def parse(text: str) -> dict:
    """The wish in a message: {"do": …, fields}. Raises ValueError, one sentence."""
    try:
        wish = json.loads(text, parse_constant=_refuse, parse_int=_whole, parse_float=_number)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"a message is not JSON ({error})") from None
    if not isinstance(wish, dict) or not isinstance(wish.get("do"), str) or wish["do"] not in _FIELDS:
        raise ValueError(f"a message asks for none of {', '.join(_FIELDS)}")
    if wish["do"] == "aim":
        return _aim(wish)
    for name, kind in _FIELDS[wish["do"]].items():
        value = wish.get(name)
        if value is None or (kind is not object and type(value) is not kind):
            raise ValueError(f"{wish['do']}: {name} is {value!r}; {kind.__name__} is needed")
        if isinstance(value, str) and len(value) > _TEXT:
            raise ValueError(f"{wish['do']}: {name} has {len(value)} characters; the limit is {_TEXT}")
    return wish


def _aim(wish):
    given = {axis: wish[axis] for axis in AXES if axis in wish}
    for axis, value in given.items():
        if type(value) not in (int, float) or not math.isfinite(value):
            raise ValueError(f"aim: {axis} is {value!r}; a finite number is needed")
    if not given:
        raise ValueError("aim names none of x, y, theta")
    return {"do": "aim", **{axis: float(value) for axis, value in given.items()}}


def _number(text):
    value = float(text)
    return value if abs(value) < LARGEST else _refuse(text[:20])


def _whole(text):
    value = int(text)
    return value if abs(value) < LARGEST else _refuse(text[:20])


def _refuse(constant):
    raise ValueError(f"{constant} is no number")


class Flood:
    """Counts messages of one page: `allows` is False above MOST_PER_SECOND, beyond a short burst."""

    def __init__(self, now: float):
        self._left, self._at = float(BURST), now

    def allows(self, now: float) -> bool:
        """Whether one more message at this time [s] is taken."""
        self._left = min(BURST, self._left + (now - self._at) * MOST_PER_SECOND)
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
