# SPDX-License-Identifier: Apache-2.0
"""Runs a page of docs as its reader does: every fenced block, in order, in one shell and one folder.

The folder holds what a page may use of the folder of the sources: firmware.

* sh: commands, one a line. One that ends in & runs on until the page ends. One with `# refused` behind it must fail;
  all others must not. In `ROS_DOMAIN_ID=7` the number is replaced by the domain of the test.
* text, behind sh or python: each of its lines is found, in this order, in what that block printed, stdout and stderr
  together. `…` stands for anything. White space is squeezed, and the lines of tables are white space.
* python without a title: a script.
* any language with title="a.yaml": that file.

Any other block is refused. Displays are patient (patient.yaml) with a machine that the tests keep busy. Where `haptic
demo` says that only a late machine kept a run from being done, this is kept, and what the page shows of the run is not
compared.
"""

import contextlib
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import patient
import psutil
import waiting

FENCED = re.compile(r"^( *)```([^\n]*)\n(.*?)(^ *```$|\Z)", re.MULTILINE | re.DOTALL)
DRAWN = re.compile("[\u2500-\u257f\\s]+")  # the lines of tables, and white space
COMMAND = 240.0  # [s] that a command may take, less than the whole page: beside a display, programs only start slowly
# Of haptic demo, where nothing but unanswered samples kept a run from being done, and the machine is to blame for them.
LATE = re.compile(
    r"^not done because \d+ of \d+ handle samples were answered, .*\n(the machine was late: .*)", re.MULTILINE
)
ENDED = {"0", "127", "130", "143"}  # codes of what is ended in the background; 127: the page itself has waited for it


class Block(NamedTuple):
    """A fenced block: its language, the file that it is or "", its text, and the number of its first line."""

    language: str
    title: str
    text: str
    line: int


def blocks(page):
    """Blocks of the text of a page in their order; AssertionError for one that would not be executed."""
    found = []
    for indent, head, text, line in _fenced(page):
        language, _, option = head.partition(" ")
        title = re.fullmatch(r'title="([\w.-]+)"', option)
        assert not indent, f"line {line}: a block begins at the start of a line"
        assert title or not option, f"line {line}: {option!r} is no title of a file"
        assert title or language in ("sh", "python", "text"), f"line {line}: {head!r} is not executed"
        prints = bool(found) and not found[-1].title and found[-1].language in ("sh", "python")
        assert title or language != "text" or prints, f"line {line}: text stands behind what prints it"
        found.append(Block(language, title[1] if title else "", text, line + 1))
    return found


def _fenced(page):
    """Indent, head, text and number of each block; AssertionError for one without an end."""
    for match in FENCED.finditer(page):
        line = page.count("\n", 0, match.start()) + 1
        assert match[4] and "\n```" not in match[3], f"line {line}: this block has no end"
        yield match[1], match[2], match[3], line


def missing(expected, printed):
    """The first of the expected lines that is not found in its order in what was printed; None if all are."""
    lines = iter([_squeezed(line) for line in re.split(r"[\r\n]+", printed)])
    for line in filter(None, map(_squeezed, expected.splitlines())):
        pattern = re.compile(".*".join(map(re.escape, line.split("…"))))
        if not any(pattern.fullmatch(one) for one in lines):
            return line
    return None


def _squeezed(line):
    return DRAWN.sub(" ", line).strip()


class Shell:
    """A bash, in which what `cd` and `export` change holds for the lines behind them."""

    def __init__(self, folder, kept):
        self._kept, self._count, self._background, self._begun = kept, 0, [], 0
        self._terminal = kept / "terminal"
        self._terminal.touch()
        patient.write_programs(kept / "programs")
        programs = [str(kept / "programs"), str(Path(sys.executable).parent), os.environ["PATH"]]
        environment = {**os.environ, "PATH": os.pathsep.join(programs), "MPLBACKEND": "Agg"}
        bash = ["bash", "--noprofile", "--norc", "-m"]  # -m: what runs in the background hears SIGINT
        files = {"stdin": subprocess.PIPE, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "text": True}
        self._bash = subprocess.Popen(bash, **files, cwd=folder, env=environment, start_new_session=True)
        self._tell("trap 'kill -KILL $(jobs -p)' EXIT")  # also where the test run itself dies

    def begin(self):
        """From here on is what a block prints."""
        self._begun = self._terminal.stat().st_size

    def printed(self):
        """What was printed since `begin`."""
        return self._terminal.read_bytes()[self._begun :].decode()

    def run(self, command, stdin="/dev/null"):
        """Exit code of a command, as text, when it has ended or runs in the background."""
        self._count += 1
        code = self._kept / f"{self._count}"
        self._tell(f"{{ {command}\n}} >>'{self._terminal}' 2>&1 <'{stdin}'; echo $? $! >'{code}'")

        def ended():
            assert self._bash.poll() is None, f"{command}: the shell has ended"
            return code.exists() and code.read_text().endswith("\n")

        waiting.until(ended, f"the end of {command}", said=self.printed, limit=COMMAND)
        number, *job = code.read_text().split()
        self._background += [one for one in job if one not in self._background]
        return number

    def end(self):
        """Ends what runs in the background as Ctrl-C does, the last first; codes of what failed, by pid."""
        codes = {}
        for pid in reversed(self._background):
            codes[pid] = self.run(f"if kill -0 {pid}; then kill -INT {pid}; fi 2>/dev/null; wait {pid}")
        return {pid: code for pid, code in codes.items() if code not in ENDED}

    def close(self):
        """Leaves nothing behind."""
        if self._bash.poll() is None:
            for process in psutil.Process(self._bash.pid).children(recursive=True):
                with contextlib.suppress(psutil.NoSuchProcess):
                    process.kill()
            self._bash.kill()
        self._bash.stdin.close()
        self._bash.wait()

    def _tell(self, line):
        self._bash.stdin.write(line + "\n")
        self._bash.stdin.flush()


def run(page, folder, domain):
    """Executes the blocks of the text of a page in this empty folder; AssertionError where one is not as it says.

    Returns what demos said of a machine that was too late for them, each with its line.
    """
    late = []
    with tempfile.TemporaryDirectory() as kept:
        patient.write_firmware(folder)
        shell, before = Shell(folder, Path(kept)), None
        try:
            for block in blocks(page):
                if block.title:
                    (folder / block.title).write_text(block.text, encoding="utf-8")
                elif block.language == "text":
                    if before.line not in dict(late):
                        _compare(block, before, shell)
                else:
                    shell.begin()
                    late += [(block.line, said) for said in _execute(block, shell, domain, Path(kept) / "script")]
                before = block
            shell.begin()
            failed = shell.end()
            assert not failed, f"codes of what failed in the background, by pid: {failed}; {shell.printed()}"
            return late
        finally:
            shell.close()


def _execute(block, shell, domain, script):
    """What demos of the block said of a machine that was too late for them."""
    late = []
    if block.language == "python":
        script.write_text(block.text, encoding="utf-8")
        code = shell.run("python -", stdin=script)
        assert code == "0", f"line {block.line}: this script ended with {code}; {shell.printed()}"
        return late
    for number, line in enumerate(block.text.splitlines(), block.line):
        code = shell.run(re.sub(r"\bROS_DOMAIN_ID=\d+", f"ROS_DOMAIN_ID={domain}", line))
        if code == "1" and line.startswith("haptic demo ") and (said := LATE.findall(shell.printed())):
            late += said
            continue
        refused = line.endswith("# refused")
        wrong = "is not refused" if refused else f"ended with {code}"
        assert (code != "0") == refused, f"line {number}: {line} {wrong}; {shell.printed()}"
    return late


def _compare(block, before, shell):
    def found():
        return missing(block.text, shell.printed()) is None

    if any(line.partition(" #")[0].rstrip().endswith("&") for line in before.text.splitlines()):
        waiting.until(found, f"line {block.line}: what the page shows", said=shell.printed)
    printed = shell.printed()
    assert found(), f"line {block.line}: not printed: {missing(block.text, printed)}; printed:\n{printed}"
