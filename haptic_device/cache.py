# SPDX-License-Identifier: Apache-2.0
"""The cache of compiled kernels, which cannot hold a stale law.

numba's own cache looks only at the file of the function that was called; an edit of a law in another file would go
unseen. Here the cache folder's name is a digest of every source that can reach a kernel, of numba, of python and of
the CPU: any change is a new folder.
"""

import hashlib
import os
import shutil
import sys
import tempfile
from pathlib import Path

import llvmlite.binding
import numba

ROOMS = ("haptic_device/law", "haptic_device/runtime", "haptic_sim/method")
BESIDE = (  # what compiles, and whose constants are compiled in
    "haptic_device/cache.py", "haptic_device/kernel.py", "haptic_device/whole.py", "haptic_sim/compile/model.py",
)  # fmt: skip
KEPT = 4  # folders; older ones are removed


def sources_digest():
    """Digest of what the kernels are, and of the CPU that they are compiled for; 16 hexadecimal digits."""
    root = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256()
    for part in (numba.__version__, sys.version, llvmlite.binding.get_host_cpu_name()):
        digest.update(part.encode())
    rooms = (file for room in ROOMS for file in sorted((root / room).glob("*.py")))
    for source in (*(root / name for name in BESIDE), *rooms):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def cache_folder():
    """This code's own folder under the user's cache, newest last used; made here, older ones pruned."""
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "haptic_display"
    folder = base / sources_digest()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        folder.touch()
        for old in sorted(base.iterdir(), key=_last_used)[:-KEPT]:
            shutil.rmtree(old, ignore_errors=True)
    except OSError:  # no cache to be had: compiled anew each time
        return Path(tempfile.mkdtemp(prefix="haptic_display_"))
    return folder


def _last_used(entry):
    try:
        return entry.stat().st_mtime
    except FileNotFoundError:  # another process prunes too
        return 0.0


FOLDER = str(cache_folder())
