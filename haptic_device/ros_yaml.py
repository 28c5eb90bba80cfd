# SPDX-License-Identifier: Apache-2.0
"""YAML with the scalars of ROS 2's parameter parser (rcl_yaml_param_parser), which differ from YAML 1.1 and 1.2.

`1e3` is a number, `y` and `off` are booleans, `010` is eight, `1_000` and `1:30` are text. Reading a file in any other
way would accept what the node later refuses, or the reverse.
"""

import math
import re

import yaml

PLAIN = "plain"
TRUE = ("Y", "y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON")
FALSE = ("N", "n", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF")
INTEGER = re.compile(r"[+-]?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)")
DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(\.?(nan|inf)|infinity)", re.IGNORECASE)
INT64 = range(-(2**63), 2**63)


def load(path):
    """The mapping in the YAML file at path, as nested dict, list, bool, int, float and str.

    Raises OSError when it cannot be read and ValueError, one sentence, when it is not a mapping, repeats a key, uses an
    alias or is not YAML at all.
    """
    with open(path, encoding="utf-8") as stream:
        return loads(stream)


def loads(text):
    """As load, from a string or an open stream."""
    try:
        root = yaml.compose(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        raise ValueError(f"line {line} is not YAML: {error.problem}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ValueError(f"this is not a YAML text: {' '.join(str(error).split())}") from None
    if not isinstance(root, yaml.MappingNode):
        raise ValueError("the file holds no mapping of names to values")
    return _value(root)


class _Loader(yaml.SafeLoader):
    """Composes nodes, marks untagged plain scalars, and refuses aliases, which ROS 2 refuses too."""

    def resolve(self, kind, value, implicit):
        if kind is yaml.ScalarNode and implicit[0]:
            return PLAIN
        return super().resolve(kind, value, implicit)

    def compose_node(self, parent, index):
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark
            raise yaml.composer.ComposerError(None, None, "ROS 2 parameter files have no aliases (*name)", mark)
        return super().compose_node(parent, index)


def _value(node):
    if isinstance(node, yaml.MappingNode):
        return _mapping(node)
    if isinstance(node, yaml.SequenceNode):
        return [_value(item) for item in node.value]
    return _scalar(node.value) if node.tag == PLAIN else node.value


def _mapping(node):
    mapping = {}
    for key, content in node.value:
        if not isinstance(key, yaml.ScalarNode) or not key.value.isprintable():
            raise ValueError(f"line {key.start_mark.line + 1} has no plain name where one belongs")
        if key.value in mapping:
            raise ValueError(f"{key.value} is written twice, the second time in line {key.start_mark.line + 1}")
        mapping[key.value] = _value(content)
    return mapping


def _scalar(text):
    if text in TRUE or text in FALSE:
        return text in TRUE
    if INTEGER.fullmatch(text) and (number := _integer(text)) in INT64:
        return number
    if DECIMAL.fullmatch(text):
        return _decimal(text)
    return text


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
