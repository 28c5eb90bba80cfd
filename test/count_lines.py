# SPDX-License-Identifier: Apache-2.0
"""`python test/count_lines.py [FOLDER…]`: lines of code of Python files in git; no blanks, comments, docstrings."""

import ast
import io
import subprocess
import sys
import tokenize
from collections import Counter
from pathlib import Path

NO_CODE = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}


def lines_of_code(text):
    """How many lines of this source hold code; a string that stands alone is a docstring."""
    held = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in NO_CODE:
            held.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            held.difference_update(range(node.lineno, node.end_lineno + 1))
    return len(held)


if __name__ == "__main__":
    command = ["git", "ls-files", *(sys.argv[1:] or ["test"])]
    listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    files = [Path(name) for name in listed.splitlines() if name.endswith(".py")]
    folders = Counter()
    for file in files:
        folders[str(file.parent)] += lines_of_code(file.read_text())
    for folder, count in sorted(folders.items()):
        print(f"{count:7d} {folder}")
    print(f"{folders.total():7d} in {len(files)} files")
