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

import yaml

from haptic_device.config_files import ConfigError
from haptic_device.os_errors import in_words

PARSER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # ten times as fast, where PyYAML has libyaml
PLAIN = "plain"
TRUE = ("yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON")
FALSE = ("no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF")
ROS_TRUE, ROS_FALSE = ("Y", "y"), ("N", "n")
NULL = ("", "~", "null", "Null", "NULL")
MERGE = "<<"
INTEGER = re.compile(r"[+-]?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)")
DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(\.?(nan|inf)|infinity)", re.IGNORECASE)
INT64 = range(-(2**63), 2**63)
MOST = 200_000  # values; a few lines of aliases within aliases would make any number of them
DEEPEST = 100  # mappings and lists within each other
NO_ALIAS = "ROS 2 parameter files have no aliases (*name)"


def load(path, ros: bool = False) -> dict:
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


def loads(text: str | bytes, ros: bool = False) -> dict:
    """As load, from text or bytes in UTF-8. Raises ValueError, one sentence without a file's name."""
    try:
        text = text.decode("utf-8") if isinstance(text, bytes) else text
        _look_through(text, ros)
        root = yaml.compose(text, Loader=_Loader)
        if not isinstance(root, yaml.MappingNode):
            raise ValueError("the file holds no mapping of names to values")
        return _Values(ros).of(root)
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        if "\t" in _indentation(text, line):
            raise ValueError(f"line {line} begins with a tab; use spaces") from None
        raise ValueError(f"line {line} is not YAML: {error.problem}") from None
    except (yaml.YAMLError, UnicodeError) as error:
        raise ValueError(f"this is not a YAML text: {' '.join(str(error).split())}") from None
    except RecursionError:
        raise ValueError("an alias stands within what it names") from None


def dump(content, flow: bool = False) -> str:
    """YAML text that `loads`, ROS 2 and any YAML reader read as the content again, in its order, without aliases.

    flow: what is innermost in braces and brackets.
    """
    style = None if flow else False
    return yaml.dump(content, Dumper=_Dumper, sort_keys=False, allow_unicode=True, default_flow_style=style)


class _Dumper(yaml.SafeDumper):
    """Puts a text into quotes that would be read as a number or a boolean."""

    def ignore_aliases(self, data):
        return True

    def resolve(self, kind, value, implicit):
        tag = super().resolve(kind, value, implicit)
        if kind is yaml.ScalarNode and implicit[0] and tag == self.DEFAULT_SCALAR_TAG:
            return tag if isinstance(_scalar(value, True), str) else "tag:yaml.org,2002:float"
        return tag


class _Loader(PARSER):
    """Composes nodes and marks untagged plain scalars."""

    def resolve(self, kind, value, implicit):
        if kind is yaml.ScalarNode and implicit[0]:
            return PLAIN
        return super().resolve(kind, value, implicit)


def _indentation(text, line):
    """What the line begins with before its first character that is seen."""
    words = "".join(text.splitlines()[line - 1 : line])
    return words[: len(words) - len(words.lstrip())]


def _look_through(text, ros):
    """Refuses what must not come before a composer: it composes nests by recursion, in C, and follows aliases."""
    depth = 0
    for event in yaml.parse(text, Loader=PARSER):
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        elif ros and isinstance(event, yaml.AliasEvent):
            raise ValueError(f"line {event.start_mark.line + 1} is not YAML: {NO_ALIAS}")
        if depth > DEEPEST:
            raise ValueError(f"line {event.start_mark.line + 1} is nested {depth} deep; the limit is {DEEPEST}")


class _Values:
    """Makes values of composed nodes, at most MOST of them."""

    def __init__(self, ros):
        self._ros, self._made = ros, 0

    def of(self, node):
        self._made += 1
        if self._made > MOST:
            raise ValueError(f"the file holds more than {MOST} values, its aliases followed")
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node)
        if isinstance(node, yaml.SequenceNode):
            return [self.of(item) for item in node.value]
        return _scalar(node.value, self._ros) if node.tag == PLAIN else node.value

    def _mapping(self, node):
        merged, own = {}, {}
        for key, content in node.value:
            name, line = key.value, key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarNode) or not name.isprintable():
                raise ValueError(f"line {line} has no plain name where one belongs")
            if name in own or (name == MERGE and merged):
                raise ValueError(f"{name} is written twice, the second time in line {line}")
            if name == MERGE and key.tag == PLAIN and not self._ros:
                merged = self._merged(content, line)
            else:
                own[name] = self.of(content)
        return merged | own

    def _merged(self, node, line):
        """What `<<` brings in: of several mappings the first that has a key counts."""
        found = self.of(node)
        merged = {}
        for mapping in reversed(found if isinstance(found, list) else [found]):
            if not isinstance(mapping, dict):
                raise ValueError(f"line {line}: {MERGE} needs a mapping or a list of mappings")
            merged |= mapping
        return merged


def _scalar(text, ros):
    if text in TRUE or (ros and text in ROS_TRUE):
        return True
    if text in FALSE or (ros and text in ROS_FALSE):
        return False
    if text in NULL and not ros:
        return None
    if INTEGER.fullmatch(text) and (number := _integer(text)) in INT64:
        return number
    return _decimal(text) if DECIMAL.fullmatch(text) else text


def _integer(text):
    """C's strtol with base 0: a leading 0 means octal."""
    digits = text.lstrip("+-")
    number = int(digits, 8 if re.fullmatch("0[0-7]+", digits) else 0)
    return -number if text[0] == "-" else number


def _decimal(text):
    """C's strtod; a number beyond the range of a double stays text, as in ROS 2."""
    word = text.lower()
    number = float(word.replace(".inf", "inf").replace(".nan", "nan"))
    return text if math.isinf(number) and "inf" not in word else number
