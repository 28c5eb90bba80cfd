# SPDX-License-Identifier: Apache-2.0
"""What MkDocs does not know by itself.

Formulas become MathML, which a browser shows without a script. The search finds pages to learn from before pages to
look up and both before decisions. The gallery of scenes is a grid of pictures.
"""

import re
from xml.etree import ElementTree

from latex2mathml.converter import convert
from markdown import Extension
from markdown.treeprocessors import Treeprocessor

ARITY = {"mfrac": 2, "mover": 2, "mroot": 2, "msub": 2, "msubsup": 3, "msup": 2, "munder": 2, "munderover": 3}
GALLERY = "reference/scenes/README.md"
TABLE = r"<details><summary>Simulation</summary>\1</details>"
BOOSTS = {"tutorials": 3.0, "decisions": 0.1}  # of folders, in the search; 1 of the others


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


def on_page_markdown(markdown, page, **_):
    """MkDocs: the folder of a page decides how early the search shows it."""
    page.meta.setdefault("search", {"boost": BOOSTS.get(page.file.src_uri.partition("/")[0], 1.0)})


def on_page_content(html, page, **_):
    """MkDocs: each scene of the gallery is a card of a grid; its film and its table are folded."""
    if page.file.src_uri != GALLERY:
        return html
    head, *scenes = re.split("(?=<h2 )", html.replace("<details open>", "<details>"))
    folded = [re.sub("(?s)(<table>.*</table>)", TABLE, scene) for scene in scenes]
    return f'{head}<div class="scenes">{"".join(f"<section>{scene}</section>" for scene in folded)}</div>'


def on_post_page(output, **_):
    """MkDocs: the theme's dialog of the search gets a name, which screen readers say."""
    return output.replace(
        'data-md-component="search" role="dialog"', 'data-md-component="search" role="dialog" aria-label="Search"'
    )
