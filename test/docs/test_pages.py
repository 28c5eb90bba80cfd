# SPDX-License-Identifier: Apache-2.0
"""Each page: its links and files are there, its pictures say what is on them, and it is short, its sentences too."""

import re
from pathlib import Path

import pytest

from bench import houses
from bench.houses import HOUSES

ROOT = Path(__file__).parents[2]
PAGES = {
    str(page.relative_to(ROOT)): page.read_text(encoding="utf-8")
    for page in sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
}
ARCHITECTURE = "docs/theory/architecture.md"
PUBLISHED = "docs/benchmarks/published.md"  # a table, and notes that people write in YAML files
GENERATED = {PUBLISHED, "docs/reference/faults.md", "docs/reference/parameters.md", "docs/reference/scenes/README.md"}
GENERATED |= {f"docs/benchmarks/{name}.md" for name in ("chosen", "hard_cases", "speed_error")}
OTHERS = {"CHANGELOG.md", "SECURITY.md"}
MOST_WORDS = 35_500
LONG, LONGEST, MOST_LONG = 28, 40, 3  # words of a long sentence and of the longest; long ones of a page
THING = "\N{REPLACEMENT CHARACTER}x"  # stands for code or a formula: one word
NAMES = rf"{THING}(?:(?:, | and | or |, and |, or ){THING})+"


def written_by_hand():
    """Text of the pages that people write, decisions left out."""
    names = PAGES.keys() - GENERATED - OTHERS
    return {name: PAGES[name] for name in names if not name.startswith("docs/decisions/")}


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


def test_pages_written_by_hand_have_no_more_words_than_somebody_reads_in_short_sentences():
    pages = written_by_hand()
    words = {name: count(text_of(text)) for name, text in pages.items()}
    assert len(pages) > 40 and sum(words.values()) <= MOST_WORDS, sorted(words.items(), key=lambda item: -item[1])
    for name, text in {**pages, PUBLISHED: PAGES[PUBLISHED]}.items():
        long = [(length, sentence) for sentence in sentences(text) if (length := count(sentence)) > LONG]
        assert len(long) <= MOST_LONG, (name, long)
        assert [sentence for length, sentence in long if length > LONGEST] == [], name


def test_words_of_a_sentence_are_counted_as_a_reader_would():
    for markdown, lengths in (
        ("See Fig. 7 of [the long paper](https://a.b/c d). `x y z` is $a + b$!", [7, 3]),
        ("A list:\n\n* one two\n* three.\n\n```\nnot this. Nor this\n```\n| nor | this |\n# Nor this\n", [2, 2, 1]),
        ("It has `a`, `b` and `c`.\nIt is 0.5 N\nlong.", [3, 5]),
        ("A price of $5 and of $6 each.", [8]),
    ):
        assert [count(sentence) for sentence in sentences(markdown) if count(sentence)] == lengths


def test_links_and_paths_lead_somewhere():
    gone = []
    for name, text in PAGES.items():
        for target in re.findall(r"\]\((?!https?:)([^)#]+)[^)]*\)|src=\"([^\"]+)\"", text):
            gone += [(name, target)] * (not (ROOT / name).parent.joinpath("".join(target)).exists())
        for path in re.findall(r"`((?:bench|config|docs|launch|test|haptic_(?:device|display|sim))/[\w./]+\w)`", text):
            gone += [(name, path)] * (not (ROOT / path).exists())
    assert gone == []


def test_each_file_that_a_tour_of_the_tree_names_exists_and_each_room_is_named():
    for name in (ARCHITECTURE, "CONTRIBUTING.md"):
        for part in re.split(r"\n\n|\n(?=\*|\d+\. )", PAGES[name]):
            room = ROOT
            for path in re.findall(r"`([\w./-]+\.(?:py|md|yaml|toml))`", part):
                assert (ROOT / path).exists() or (room / path).exists(), (name, path)
                room = (ROOT / path).parent if "/" in path else room  # a bare name: a neighbour of the path before it
    folders = {file.parent for house in HOUSES for file in (ROOT / house).rglob("*.py")}
    rooms = {str(folder.relative_to(ROOT)) for folder in folders} - HOUSES.keys()
    assert {room for room in rooms if f"`{room}`" not in PAGES[ARCHITECTURE]} == set()


def test_the_picture_of_the_packages_is_made_from_their_imports_and_no_arrow_goes_up(tmp_path, monkeypatch):
    rooms = {house: houses.rooms_of(house) for house in HOUSES}
    assert houses.PICTURE.read_text() == houses.drawn(rooms)
    assert all(len(houses.floors(house, rooms[house])) <= 7 for house in HOUSES)
    assert all(len([*(ROOT / house).glob("[!_]*.py")]) <= 6 for house in HOUSES)
    assert houses.needed({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == [("a", "b"), ("b", "c")]
    with pytest.raises(ValueError, match=r"^shed: imports among a, b go in a circle$"):
        houses.floors("shed", {"a": {"b"}, "b": {"a"}, "c": set()})
    (tmp_path / "haptic_device").mkdir()
    (tmp_path / "haptic_device/law.py").write_text("from haptic_sim.scene import language\n")
    monkeypatch.setattr(houses, "ROOT", tmp_path)
    with pytest.raises(ValueError, match=r"^haptic_device/law.py imports \S+: haptic_sim stands above haptic_device$"):
        houses.rooms_of("haptic_device")


def test_every_picture_in_the_documents_says_what_is_on_it():
    shown = 0
    for name, text in PAGES.items():
        words = re.findall(r"!\[([^\]]*)\]\(", text) + re.findall(r'<img [^>]*alt="([^"]*)"', text)
        assert len(words) == len(re.findall(r"!\[|<img ", text)), name
        assert [alt for alt in words if len(alt.split()) < 3] == [], name
        shown += len(words)
    assert shown > 10
