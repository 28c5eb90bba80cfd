# SPDX-License-Identifier: Apache-2.0
"""Start and the tutorials: every block does what its page says; and what the runner of pages takes for true."""

from pathlib import Path

import pytest
import tutorials

DOCS = Path(__file__).parents[2] / "docs"
PAGES = [DOCS / "start.md", *sorted(DOCS.glob("tutorials/*.md"))]
TRUE = {
    "each line in its order": "```sh\nprintf 'a\\nb\\nc\\n'\n```\n```text\na\nc\n```\n",
    "an ellipsis, standard error": "```sh\necho took 3.1 s, twice >&2\n```\n```text\ntook … s, …\n```\n",
    "a table without its lines": "```sh\necho '│ rate   │ 4 kHz │'\n```\n```text\nrate 4 kHz\n```\n",
    "a refusal": "```sh\nfalse # refused\n```\n",
    "folder and variable": "```sh\nmkdir d\ncd d\nexport A=5\n```\n```sh\nbasename $PWD$A\n```\n```text\nd5\n```\n",
    "files": '```c title="a.c"\nint a;\n```\n```python\nprint(open("a.c").read())\n```\n```text\nint a;\n```\n',
    "the domain of the test": "```sh\nexport ROS_DOMAIN_ID=7\necho $ROS_DOMAIN_ID\n```\n```text\n42\n```\n",
    "what comes late from the background": "```sh\n(sleep 0.3; echo late; sleep 100) &\n```\n```text\nlate\n```\n",
}
WRONG = {
    "another order": ("```sh\nprintf 'a\\nb\\n'\n```\n```text\nb\na\n```\n", "line 5: not printed: a"),
    "a part of a line": ("```sh\necho 12\n```\n```text\n1\n```\n", "not printed: 1"),
    "what another block printed": ("```sh\necho a\n```\n```sh\necho b\n```\n```text\na\n```\n", "not printed: a"),
    "a command that fails": ("```sh\ntrue\nfalse\n```\n", "line 3: false ended with 1"),
    "a refusal that does not come": ("```sh\ntrue # refused\n```\n", "line 2: .* is not refused"),
    "a script that fails": ("```python\n1 / 0\n```\n", "line 2: this script ended with 1"),
    "a failure behind": ("```sh\n(sleep 0.2; exit 3) &\nsleep 0.4\n```\n", "failed in the background, .* '3'"),
    "another language": ("```json\n{}\n```\n", "line 1: 'json' is not executed"),
    "a file elsewhere": ('```yaml title="../a"\n```\n', "is no title"),
    "text behind nothing": ('```c title="a.c"\n```\n```text\na\n```\n', "line 3: text stands behind what prints it"),
}
LOOP = "(trap 'echo told >told; exit 130' INT; echo up; while true; do sleep 0.05; done) &"


@pytest.mark.timeout(300)
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_each_block_of_the_page_does_what_the_page_says(page, ros_domain, tmp_path, last_lines):
    late = tutorials.run(page.read_text(encoding="utf-8"), tmp_path, ros_domain)
    last_lines += [f"{page.name}, line {line}, is not judged: {said}" for line, said in late]


@pytest.fixture
def run(tmp_path):
    return lambda page: tutorials.run(page, tmp_path, 42)


@pytest.mark.parametrize("page", TRUE.values(), ids=TRUE.keys())
def test_a_page_that_is_true_passes(run, page):
    run(page)


@pytest.mark.parametrize("page, sentence", WRONG.values(), ids=WRONG.keys())
def test_a_page_that_is_not_true_is_refused_with_its_line(run, page, sentence):
    with pytest.raises(AssertionError, match=sentence):
        run(page)


UNANSWERED, BLAME = (
    "not done because 9 of 12 handle samples were answered, and 11 are the least",
    "the machine was late: 9 of 12",
)
DEMO = "```sh\nhaptic() {{ printf '{}\\n'; return 1; }}\nhaptic demo --out a\n```\n```text\ntask done\n```\n"
LATE = DEMO.format(f"{UNANSWERED}\\n{BLAME}")


def test_a_demo_whose_samples_a_late_machine_left_unanswered_is_told_and_not_judged(run):
    assert run(LATE) == [(2, BLAME)]


@pytest.mark.parametrize(
    ("page", "sentence"),
    [
        (DEMO.format(UNANSWERED), "line 3: haptic demo --out a ended with 1"),
        (DEMO.format(f"not done because of a fault\\n{BLAME}"), "line 3: haptic demo --out a ended with 1"),
        (f"{LATE}```sh\nfalse\n```\n", "line 9: false ended with 1"),
    ],
    ids=("nobody to blame", "a fault beside it", "the rest of the page"),
)
def test_all_else_is_judged(run, page, sentence):
    with pytest.raises(AssertionError, match=sentence):
        run(page)


def test_what_runs_in_the_background_hears_ctrl_c_at_the_end_of_the_page(run, tmp_path):
    run(f"```sh\n{LOOP}\n```\n```text\nup\n```\n")
    assert (tmp_path / "told").read_text() == "told\n"
