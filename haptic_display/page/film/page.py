# SPDX-License-Identifier: Apache-2.0
"""film.html: the page that plays one film, or two on top of each other. One file, which needs no network."""

import base64
import hashlib
import html
import json
import re
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from haptic_display.page.film.reading import Film

OWN = Path(__file__).with_name("web")
SHARED = Path(__file__).resolve().parents[1] / "web"  # the live page, whose plane this is
UNITS = {"length": 1e-5, "angle": 1e-4, "curve": 1e-2}  # one step of the numbers: 0.01 mm, 0.1 mrad, 0.01 N, mJ, ms
FARTHEST = 1e9  # steps beyond which nothing is shown
_IMPORT = re.compile(r'^import \{([^}]*)\} from "\./([\w.]+)";\n', re.M)
_EXPORT = re.compile(r"^export (?=(?:async )?(?:function|class|const) (\w+))", re.M)
_STYLE = re.compile(r'<link rel="stylesheet" href="([\w.]+)">')
_FETCHED = re.compile(r'<title>.*</title>\n|<link .*>\n|<script .*</script>\n| href="operating_point.yaml"')


def page_of(films: list[Film]) -> str:
    """The text of film.html, of one film, or of two."""
    page = _text("index.html")
    style = "".join(_text(name) for name in ("film.css", *_STYLE.findall(page)))
    script = "".join(_modules("main.js", set()))
    title = html.escape("Film: " + " and ".join(dict.fromkeys(map(_title, films))))
    policy = f"default-src 'none'; base-uri 'none'; form-action 'none'; script-src {_digest(script)}; "
    policy += f"style-src {_digest(style)}"
    head = f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n<title>{title}</title>\n'
    data = f'<script type="application/json" id="films">{_harmless([_content(film) for film in films])}</script>'
    parts = {
        "</head>": f"{head}<style>{style}</style>\n</head>",
        "<body>": '<body class="film">',
        "<h1>haptic_display</h1>": f"<h1>{title}</h1>",
        '<section id="strips"': _text("film.html") + '<section id="strips"',
        "</body>": f"{data}\n<script>{script}</script>\n</body>",
    }
    return re.sub("|".join(map(re.escape, parts)), lambda found: parts[found[0]], _FETCHED.sub("", page))


def _title(film: Film) -> str:
    """Of the scene's task, else the name of the scene, else that of the recording."""
    scene = film.scene
    return scene.task["title"] if scene and scene.task else scene.name if scene else film.name


def _modules(name: str, done: set[str]) -> Iterator[str]:
    """A module of the page behind those that it imports, each once and in a function of its own: the others see what it
    exports. Raises ValueError for a line of import or export that this cannot read."""
    if name in done:
        return
    done.add(name)
    text = _text(name)
    for _, other in _IMPORT.findall(text):
        yield from _modules(other, done)
    names, body = ", ".join(_EXPORT.findall(text)), _EXPORT.sub("", _IMPORT.sub("", text))
    if left := re.search(r"^(?:import|export)\b.*", body, re.M):
        raise ValueError(f"{name}: a film cannot take the line {left[0]!r}")
    yield f"const {{ {names} }} = (() => {{\n{body}return {{ {names} }};\n}})();\n"


def _text(name: str) -> str:
    own = OWN / name
    return (own if own.exists() else SHARED / name).read_text(encoding="utf-8")


def _digest(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _harmless(content: list[Any]) -> str:
    """JSON in which nothing ends the element that it is in."""
    return json.dumps(content, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _content(film: Film) -> dict[str, Any]:
    steps = np.array([UNITS["length"], UNITS["length"], UNITS["angle"]])
    as_they_are = "name", "date", "facts", "notes", "rate", "first_contact", "room", "walls", "linkage"
    return {
        **{name: getattr(film, name) for name in as_they_are},
        "scene": asdict(film.scene) if film.scene else None,
        "begin": round(film.begin, 3),
        "count": film.pictures,
        "steps": UNITS,
        "places": {name: [_packed(column) for column in (place / steps).T] for name, place in film.places.items()},
        "curves": {name: _packed(curve / UNITS["curve"]) for name, curve in film.curves.items()},
        "force": [_packed(column / UNITS["curve"]) for column in film.force.T],
        "loose": np.flatnonzero(~film.coupled).tolist(),
        "contacts": [[picture, *(float(f"{number:.4g}") for number in rest)] for picture, *rest in film.contacts],
        "marks": [[round(at, 3), text] for at, text in film.marks],
    }


def _packed(column: npt.NDArray[np.float64]) -> list[Any]:
    """Whole numbers, each as its difference to the last one that is known; null where nothing is. What never is known,
    is one null."""
    known = np.isfinite(column)
    if not known.any():
        return [None]
    whole = np.round(np.clip(column[known], -FARTHEST, FARTHEST)).astype(np.int64)
    packed = np.full(len(column), None, object)
    packed[known] = np.diff(whole, prepend=0).tolist()
    return packed.tolist()
