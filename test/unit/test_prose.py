# SPDX-License-Identifier: Apache-2.0
"""The documents are short, and their sentences too."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GENERATED = {
    "docs/benchmarks/chosen.md",
    "docs/benchmarks/growth.md",
    "docs/benchmarks/hard_cases.md",
    "docs/benchmarks/published.md",
    "docs/benchmarks/speed_error.md",
    "docs/reference/faults.md",
    "docs/reference/parameters.md",
    "docs/reference/scenes/README.md",
}
PUBLISHED = ROOT / "docs" / "benchmarks" / "published.md"  # a table, and notes that people write in YAML files
MOST_WORDS = 36_000
LONG, LONGEST, MOST_LONG = 28, 40, 3  # words of a long sentence and of the longest; long ones of a page
THING = "\N{REPLACEMENT CHARACTER}x"  # stands for code or a formula: one word
NAMES = rf"{THING}(?:(?:, | and | or |, and |, or ){THING})+"


def written_by_hand():
    """The pages that people write, decisions left out."""
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
    names = {page: str(page.relative_to(ROOT)) for page in pages}
    return [page for page, name in names.items() if name not in GENERATED and not name.startswith("docs/decisions/")]


def text_of(markdown):
    """What is read of a page: no code block, comment, address or tag; code and formulas in a line are one word each."""
    for pattern, rest in (
        (r"^( *)(```+).*?^\1\2 *$", ""),
        (r"<!--.*?-->", ""),
        (r"\$\$.*?\$\$", THING),
        (r"(`+)[^`].*?\1", THING),
        (r"(?<![\w$])\$[^\s$][^$\n]*(?:\n[^$\n]+)?\$(?!\w)", THING),
        (r"!?\[([^\]]*)\]\([^)]*\)", r"\1"),
        (r"<[^>]+>", ""),
    ):
        markdown = re.sub(pattern, rest, markdown, flags=re.DOTALL | re.MULTILINE)
    return markdown


def count(text):
    """Words: what has a letter or a digit."""
    return sum(any(letter.isalnum() for letter in word) for word in text.split())


def sentences(markdown):
    """Sentences of paragraphs and of list items; a list of names is one word."""
    lines = [line for line in text_of(markdown).split("\n") if not re.match(r"\s*(\||#|:::)", line)]
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[*+-]|\d+\.)\s)", "\n".join(lines)):
        words = re.sub(NAMES, THING, " ".join(block.split()))
        yield from re.split(rf"(?<=[.!?])[)\"'*_]*\s+(?=[\"'(\[*_]*(?:[A-Z]|{THING}))", words)


def test_pages_written_by_hand_have_no_more_words_than_somebody_reads():
    words = {
        str(page.relative_to(ROOT)): count(text_of(page.read_text(encoding="utf-8"))) for page in written_by_hand()
    }
    assert sum(words.values()) <= MOST_WORDS, sorted(words.items(), key=lambda item: -item[1])


@pytest.mark.parametrize("page", [*written_by_hand(), PUBLISHED], ids=lambda page: str(page.relative_to(ROOT)))
def test_sentences_are_short(page):
    found = [(count(sentence), sentence) for sentence in sentences(page.read_text(encoding="utf-8"))]
    assert [sentence for sentence in found if sentence[0] > LONGEST] == []
    long = [sentence for sentence in found if sentence[0] > LONG]
    assert len(long) <= MOST_LONG, long


@pytest.mark.parametrize(
    ("markdown", "lengths"),
    [
        ("One two three. Four five.", [3, 2]),
        ("See Fig. 7 of [the long paper](https://a.b/c d). `x y z` is $a + b$!", [7, 3]),
        ("A list:\n\n* one two\n* three.\n\n```\nnot this. Nor this\n```\n| nor | this |\n# Nor this\n", [2, 2, 1]),
        ("It has `a`, `b` and `c`.\nIt is 0.5 N\nlong.", [3, 5]),
        ("A price of $5 and of $6 each.", [8]),
    ],
)
def test_words_of_a_sentence_are_counted_as_a_reader_would(markdown, lengths):
    assert [count(sentence) for sentence in sentences(markdown) if count(sentence)] == lengths
