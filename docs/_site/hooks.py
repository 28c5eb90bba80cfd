# SPDX-License-Identifier: Apache-2.0
"""What MkDocs does not know by itself: formulas become MathML, which a browser shows without a script."""

import re
from xml.etree import ElementTree

from latex2mathml.converter import convert
from markdown import Extension
from markdown.treeprocessors import Treeprocessor

ARITY = {"mfrac": 2, "mover": 2, "mroot": 2, "msub": 2, "msubsup": 3, "msup": 2, "munder": 2, "munderover": 3}


def mathml(formula: str, display: str) -> ElementTree.Element:
    """The <math> of a formula; display: "inline" or "block". ValueError where the formula is not understood."""
    try:
        found = ElementTree.fromstring(convert(formula, display=display).replace(' xmlns="', ' data-xmlns="', 1))
    except Exception as error:  # it has a dozen of its own
        raise ValueError(f"the formula {formula!r} is not LaTeX: {type(error).__name__}") from error
    found.attrib.pop("data-xmlns", None)
    open_braces = re.sub(r"\\[{}]", "", formula)
    short = [part.tag for part in found.iter() if len(part) != ARITY.get(part.tag, len(part))]
    unknown = [part.text for part in found.iter() if "\\" in (part.text or "")]
    if short or unknown or open_braces.count("{") != open_braces.count("}"):
        raise ValueError(f"the formula {formula!r} is not understood: {' '.join(unknown + short) or 'a brace'}")
    return found


class _Formulas(Treeprocessor):
    def run(self, root):
        for found in root.iter():
            if found.get("class") == "arithmatex":  # \(…\) or \[…\]
                formula = found.text.strip()
                found.text = None
                found.append(mathml(formula[2:-2].strip(), "block" if formula.startswith("\\[") else "inline"))


class Maths(Extension):
    def extendMarkdown(self, md):
        md.treeprocessors.register(_Formulas(md), "formulas", 15)  # after what is inline, before the table of contents
        md.tab_length = 2  # lists are indented as GitHub has them


def on_config(config):
    """MkDocs: a formula that is not understood ends the build."""
    config.markdown_extensions.append(Maths())
    return config


def on_post_page(output, **_):
    """MkDocs: the theme's dialog of the search gets a name, which screen readers say."""
    return output.replace(
        'data-md-component="search" role="dialog"', 'data-md-component="search" role="dialog" aria-label="Search"'
    )
