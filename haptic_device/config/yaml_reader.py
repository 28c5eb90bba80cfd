# SPDX-License-Identifier: Apache-2.0
"""The one reader of YAML files that people write, scenes, device descriptions and operating points; and their writer.

Numbers are those of ROS 2's parameter parser (rcl_yaml_param_parser), which differ from YAML 1.1 and 1.2: `1e3` is one,
`010` is eight, `1_000` and `1:30` are text. A key that is written twice is refused. A scene or a device may use
anchors, aliases and merge keys; an operating point may not, since ROS 2 reads it again and refuses them, and its `y`
and `n` are booleans. Needs no library but PyYAML: the launch file has no other.
"""

import math
import re
from pathlib import Path
from typing import Any

import yaml

from haptic_device.config.files import ConfigError
from haptic_device.os_errors import in_words

PARSER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # ten times as fast, where PyYAML has libyaml
PLAIN, MERGE_TAG, MERGE = "plain", "tag:yaml.org,2002:merge", "<<"
BOOLEANS = {
    spelt: value
    for word, value in (("yes", True), ("true", True), ("on", True), ("no", False), ("false", False), ("off", False))
    for spelt in (word, word.capitalize(), word.upper())
}
ROS_BOOLEANS = BOOLEANS | {"Y": True, "y": True, "N": False, "n": False}
NULL = ("", "~", "null", "Null", "NULL")
INTEGER = re.compile(r"[+-]?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)")
OCTAL = re.compile("(?<![^+-])0(?=[0-7])")
DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(\.?(nan|inf)|infinity)", re.IGNORECASE)
INT64 = range(-(2**63), 2**63)
MOST = 200_000  # values; a few lines of aliases within aliases would make any number of them
DEEPEST = 100  # mappings and lists within each other
NO_ALIAS = "ROS 2 parameter files have no aliases (*name)"


def load(path: str | Path, ros: bool = False) -> dict[str, Any]:
    """The mapping in the YAML file at path, as nested dict, list, bool, int, float, str and None.

    ros: read it as ROS 2 reads a parameter file: no aliases, `y` is true, nothing is None. Raises ConfigError, one
    sentence, when it cannot be read, is not a mapping, repeats a key or is not YAML at all.
    """
    try:
        return loads(Path(path).read_bytes(), ros)
    except OSError as error:
        raise ConfigError(in_words(error), [error.strerror or str(error)]) from None
    except ValueError as error:
        raise ConfigError(f"{path}: {error}", [str(error)]) from None


def loads(text: str | bytes, ros: bool = False) -> dict[str, Any]:
    """As load, from text or bytes in UTF-8. Raises ValueError, one sentence without a file's name."""
    try:
        text = text.decode("utf-8") if isinstance(text, bytes) else text
        _look_through(text, ros)
        found = _Loader(text, ros).get_single_data()
        if not isinstance(found, dict):
            raise ValueError("the file holds no mapping of names to values")
        return found
    except RecursionError:
        raise ValueError(f"aliases nest values too deep; the limit is {DEEPEST}") from None
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        if "\t" in _indentation(str(text), line):
            raise ValueError(f"line {line} begins with a tab; use spaces") from None
        raise ValueError(f"line {line} is not YAML: {error.problem}") from None
    except (yaml.YAMLError, UnicodeError) as error:
        raise ValueError(f"this is not a YAML text: {' '.join(str(error).split())}") from None


def dump(content: Any, flow: bool = False) -> str:
    """YAML text that `loads`, ROS 2 and any YAML reader read as the content again, in its order, without aliases.

    flow: what is innermost in braces and brackets.
    """
    style = None if flow else False
    return yaml.dump(content, Dumper=_Dumper, sort_keys=False, allow_unicode=True, default_flow_style=style)


class _Dumper(yaml.SafeDumper):
    """Puts a text into quotes that would be read as a number or a boolean."""

    def ignore_aliases(self, data: Any) -> bool:
        return True

    def resolve(self, kind: type[yaml.Node], value: str, implicit: tuple[bool, bool]) -> str:
        tag = super().resolve(kind, value, implicit)
        if kind is yaml.ScalarNode and implicit[0] and tag == self.DEFAULT_SCALAR_TAG:
            return tag if isinstance(_scalar(value, True), str) else "tag:yaml.org,2002:float"
        return tag


class _Loader(PARSER):  # type: ignore[valid-type,misc]  # one of two, as PyYAML was built
    """PyYAML's, but for plain values, which are ROS 2's, and names, which are texts; tags are not followed."""

    def __init__(self, text: str, ros: bool):
        super().__init__(text)
        self._ros, self._made = ros, 0
        self._looked_at: set[yaml.Node] = set()

    def resolve(self, kind: type[yaml.Node], value: str, implicit: tuple[bool, bool]) -> str:
        if kind is not yaml.ScalarNode or not implicit[0]:
            return super().resolve(kind, value, implicit)
        return MERGE_TAG if value == MERGE and not self._ros else PLAIN

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        self._made += 1
        if self._made > MOST:
            raise ValueError(f"the file holds more than {MOST} values, its aliases followed")
        if isinstance(node, yaml.MappingNode):
            self.flatten_mapping(node)
            return {key.value: self.construct_object(content) for key, content in node.value}
        if isinstance(node, yaml.SequenceNode):
            return [self.construct_object(item) for item in node.value]
        return _scalar(node.value, self._ros) if node.tag == PLAIN else node.value

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        """Refuses a name that stands twice, and then brings in what merge keys name; once, however often it is used."""
        names = set()
        for key, _ in node.value if node not in self._looked_at else ():
            if key.tag == MERGE_TAG and (self._ros or key.value != MERGE):  # a tag that was written
                key.tag = PLAIN
            line = key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarNode) or not key.value.isprintable():
                raise ValueError(f"line {line} has no plain name where one belongs")
            if key.value in names:
                raise ValueError(f"{key.value} is written twice, the second time in line {line}")
            names.add(key.value)
        self._looked_at.add(node)
        super().flatten_mapping(node)
        node.value = list({key.value: (key, content) for key, content in node.value}.values())  # else merges multiply


def _indentation(text: str, line: int) -> str:
    """What the line begins with before its first character that is seen."""
    words = "".join(text.splitlines()[line - 1 : line])
    return words[: len(words) - len(words.lstrip())]


def _look_through(text: str, ros: bool) -> None:
    """Refuses what must not come before a composer: it composes nests by recursion, in C, and follows aliases."""
    opened = []
    for event in yaml.parse(text, Loader=PARSER):
        line = event.start_mark.line + 1
        if isinstance(event, yaml.CollectionStartEvent):
            opened.append(event.anchor)
        elif isinstance(event, yaml.CollectionEndEvent):
            opened.pop()
        elif isinstance(event, yaml.AliasEvent) and ros:
            raise ValueError(f"line {line} is not YAML: {NO_ALIAS}")
        elif isinstance(event, yaml.AliasEvent) and event.anchor in opened:
            raise ValueError(f"line {line}: an alias stands within what it names")
        if len(opened) > DEEPEST:
            raise ValueError(f"line {line} is nested {len(opened)} deep; the limit is {DEEPEST}")


def _scalar(text: str, ros: bool) -> Any:
    booleans = ROS_BOOLEANS if ros else BOOLEANS
    if text in booleans:
        return booleans[text]
    if text in NULL and not ros:
        return None
    if INTEGER.fullmatch(text) and (number := int(OCTAL.sub("0o", text), 0)) in INT64:
        return number
    return _decimal(text) if DECIMAL.fullmatch(text) else text


def _decimal(text: str) -> float | str:
    """C's strtod; a number beyond the range of a double stays text, as in ROS 2."""
    word = text.lower()
    number = float(word.replace(".inf", "inf").replace(".nan", "nan"))
    return text if math.isinf(number) and "inf" not in word else number
