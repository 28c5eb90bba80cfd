# SPDX-License-Identifier: Apache-2.0
"""What a page may ask for: one JSON object a message, of one model each, judged before anything is done."""

from collections.abc import Mapping
from functools import reduce
from operator import or_
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator

from haptic_device.message_fields import AXES

LONGEST = 16384  # bytes of a message: all live values at once, with as many walls as there may be
LARGEST = 2.0**53  # a number beyond it is none that a page means
TEXT = 200  # characters
_SHOWN = 60  # characters of a value that a refusal repeats

Number = Annotated[float, Field(gt=-LARGEST, lt=LARGEST, allow_inf_nan=False, description="a finite number below 2^53")]
Whole = Annotated[int, Field(gt=-LARGEST, lt=LARGEST, description="a whole number below 2^53")]
Switch = Annotated[bool, Field(description="true or false")]
Text = Annotated[str, Field(max_length=TEXT, description="a text")]
Item = bool | Whole | Number | Text
Service = Literal["enable", "disable", "estop", "reset"]
Act = Literal["play", "pause", "step", "slow", "fast"]
SERVICES = get_args(Service)  # of the driver that a page may trigger
VALUE = "a switch, a finite number, a text or a list of them"
Value = Annotated[Item | list[Item], Field(description=VALUE)]


class Message(BaseModel):
    """A message of a page; fields that it does not know are left out. A subclass is what a page may ask for."""

    model_config = ConfigDict(frozen=True, strict=True)
    do: str


class Seen(Message):
    """The page has drawn the frame of this number."""

    do: Literal["seen"] = "seen"
    frame: Whole


class Aim(Message):
    """Where the hand shall go, in the world [m, m, rad]; axes that are not named stay."""

    do: Literal["aim"] = "aim"
    x: Number = 0.0
    y: Number = 0.0
    theta: Number = 0.0

    @property
    def place(self) -> dict[str, float]:
        """The axes that are named."""
        return {axis: getattr(self, axis) for axis in AXES if axis in self.model_fields_set}

    @model_validator(mode="after")
    def _names_an_axis(self) -> Self:
        if not self.place:
            raise ValueError("names none of x, y, theta")
        return self


class Trigger(Message):
    """A service of the driver."""

    do: Literal["trigger"] = "trigger"
    service: Annotated[Service, Field(description=f"one of {', '.join(SERVICES)}")]


class SetAll(Message):
    """Live parameters of the driver: all or none of these are set."""

    do: Literal["set_all"] = "set_all"
    values: Annotated[dict[Text, Value], Field(min_length=1, description="a mapping of names to values")]


class LoadScene(Message):
    """Another scene."""

    do: Literal["scene"] = "scene"
    name: Text


class ChooseMethod(Message):
    """Another simulation method."""

    do: Literal["method"] = "method"
    name: Text


class StartScene(Message):
    """The scene from its start."""

    do: Literal["start_scene"] = "start_scene"


class ShowWay(Message):
    """What the guide shall do, who shows the scene's suggested way with the hand."""

    do: Literal["guide"] = "guide"
    act: Annotated[Act, Field(description=f"one of {', '.join(get_args(Act))}")]


class Mark(Message):
    """A mark in the bag."""

    do: Literal["mark"] = "mark"
    text: Text


class Record(Message):
    """Opens or closes a bag."""

    do: Literal["record"] = "record"
    on: Switch


class Restart(Message):
    """Starts the nodes again with another value of what is fixed while they run."""

    do: Literal["restart"] = "restart"
    name: Text
    value: Value


class LetGo(Message):
    """The hand pulls at nothing any more."""

    do: Literal["let_go"] = "let_go"


class TakeOver(Message):
    """This page leads the hand from now on, and no other."""

    do: Literal["take_over"] = "take_over"


class Mend(Message):
    """Ends the trouble that the banner of the page tells of, by its title."""

    do: Literal["mend"] = "mend"
    title: Text


_MODELS = {model.model_fields["do"].default: model for model in Message.__subclasses__()}
_ANY: Any = reduce(or_, _MODELS.values())
_ADAPTER: TypeAdapter[Message] = TypeAdapter(Annotated[_ANY, Field(discriminator="do")])


def parse(text: str) -> Message:
    """The message in a text. Raises ValueError, one sentence."""
    try:
        return _ADAPTER.validate_json(text)
    except ValidationError as error:
        raise ValueError(_sentence(error.errors()[0])) from None


def _sentence(error: Mapping[str, Any]) -> str:
    if error["type"] == "json_invalid":
        return f"a message is not JSON ({error['ctx']['error']})"
    if not error["loc"]:
        return f"a message asks for none of {', '.join(_MODELS)}"
    do, *path = error["loc"]
    if not path:
        return f"{do} {error['msg'].removeprefix('Value error, ')}"
    name, given = path[0], error["input"]
    if error["type"] == "string_too_long":
        return f"{do}: {name} has {len(given)} characters; the limit is {TEXT}"
    shown = "missing" if error["type"] == "missing" else repr(given)[:_SHOWN]
    needed = _MODELS[do].model_fields[name].description
    if name == "values" and len(path) > 1:
        name, needed = path[1], VALUE
    return f"{do}: {name} is {shown}; {needed} is needed"
