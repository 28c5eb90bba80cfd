# SPDX-License-Identifier: Apache-2.0
"""Where a Chromium is on this machine; as a program it installs Debian's if there is none, or says what is missing."""

import os
import shutil
import subprocess
import sys

NAMES = ("chromium", "chromium-browser", "google-chrome-stable", "google-chrome")
# A sandbox of its own needs rights that root in a container lacks; the rest keeps it from calling anybody, and silent.
OPTIONS = (
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-audio-output",
)


def find() -> str | None:
    """Path of a Chromium: that of the variable CHROMIUM, or the first of the usual names."""
    return os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)


def main() -> int:
    """Exit code 0 with a Chromium, 2 without one."""
    if find():
        return 0
    if os.geteuid() != 0 or not shutil.which("apt-get"):
        print(
            "test-browser: no Chromium found; install one (Debian: apt-get install chromium) or name it in CHROMIUM",
            file=sys.stderr,
        )
        return 2
    print("test-browser: installing chromium", flush=True)
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    for words in ("update -q", "install -q -y --no-install-recommends chromium fonts-dejavu-core"):
        done = subprocess.run(["apt-get", *words.split()], env=quiet, capture_output=True, text=True)
    if found := find():
        print(f"test-browser: {found} is there")
        return 0
    why = (done.stderr.strip().splitlines() or ["it does not say why"])[-1]
    print(f"test-browser: apt-get cannot install chromium here ({why})", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main())
