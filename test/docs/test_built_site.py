# SPDX-License-Identifier: Apache-2.0
"""The site of the documents: it is built without a warning, and its formulas are typeset or refused."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import markdown
import pytest

from haptic_device.config.files import names

ROOT = Path(__file__).parents[2]
FOLDERS = ("tutorials/", "how_to/", "reference/", "decisions/")
_SPEC = importlib.util.spec_from_file_location("hooks", ROOT / "docs" / "_site" / "hooks.py")
hooks = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(hooks)


def page(text):
    """HTML of a page."""
    finding = {"pymdownx.arithmatex": {"generic": True}}
    return markdown.markdown(text, extensions=["pymdownx.arithmatex", hooks.Maths()], extension_configs=finding)


def test_the_site_is_built_without_a_warning_its_search_prefers_tutorials_and_its_gallery_is_a_grid(tmp_path):
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)]
    quiet = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, env=quiet, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "index.html").exists()
    assert not (tmp_path / "_site").exists()
    _judge_the_search(json.loads((tmp_path / "search" / "search_index.json").read_text(encoding="utf-8"))["docs"])
    gallery = (tmp_path / "reference" / "scenes" / "index.html").read_text(encoding="utf-8")
    assert gallery.count("<section>") == gallery.count("<summary>Simulation</summary>") == len(names("scenes"))
    assert "<details open>" not in gallery, "a film that is folded is not loaded"


def _judge_the_search(docs):
    """Tutorials come before what is as near to the words, and decisions behind it."""
    boosts = {entry["location"].partition("#")[0]: entry.get("boost", 1.0) for entry in docs}
    of = {folder: {boost for page, boost in boosts.items() if page.startswith(folder)} for folder in FOLDERS}
    assert max(of["decisions/"]) < min(of["how_to/"]) == max(of["reference/"]) == 1.0 < min(of["tutorials/"])


def test_formulas_become_mathml_and_dollars_of_code_and_prices_stay():
    line, block = page(r"Damping $b > \frac{KT}{2}$ is enough."), page("$$\nb > |B|\n$$")
    assert "<mfrac><mrow><mi>K</mi><mi>T</mi></mrow><mrow><mn>2</mn></mrow></mfrac>" in line
    assert '<math display="inline"' in line and '<math display="block"' in block
    assert "$" not in line + block
    assert "<math" not in page("`echo $HOME or $USER` costs $5 and $6.")
    assert hooks.mathml(r"\{x, y", "inline").tag == "math"  # braces that are shown need no partner


@pytest.mark.parametrize(
    ("formula", "what"), [(r"\fraq{1}{2}", r"\\fraq"), (r"\frac{1}", "mfrac"), (r"\sqrt{x", "a brace")]
)
def test_a_formula_that_is_not_understood_ends_the_build(formula, what):
    with pytest.raises(ValueError, match=what):
        page(f"so ${formula}$ holds")
