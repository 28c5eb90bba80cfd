# SPDX-License-Identifier: Apache-2.0
"""The cache of compiled kernels, which cannot hold a stale law.

numba's own cache looks only at the file of the function that was called; an edit of a law in another file would go
unseen. Here the cache folder's name is a digest of every source that can reach a kernel, of numba, of python and of
the CPU: any change is a new folder.
"""

import hashlib
import os
import shutil
import stat
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

import llvmlite.binding

ROOMS = ("haptic_device/law", "haptic_device/runtime", "haptic_sim/method")
BESIDE = (  # what compiles, and whose constants are compiled in
    "haptic_device/cache.py", "haptic_device/entries.py", "haptic_device/kernel.py", "haptic_device/whole.py",
    "haptic_device/fused.py", "haptic_device/parameters.py", "haptic_sim/compile/model.py",
    "haptic_device/analysis/exchange_search.py", "haptic_device/analysis/contact_search.py",
)  # fmt: skip
DECIDE = (  # which kernels of these sources a group compiles, and for what types
    "haptic_device/device.py", "haptic_device/node/kernels.py", "haptic_device/node/wire.py",
    "haptic_device/operating.py", "haptic_sim/at_once.py", "haptic_sim/kernels.py", "haptic_sim/local_contacts.py",
    "haptic_sim/simulation.py", "haptic_sim/tool_port.py",
)  # fmt: skip
KEPT = 4  # folders; older ones are removed
ROOM = 16 * 2**20  # bytes that must be free: all kernels take less
MEMORY = Path("/dev/shm")  # where kernels are kept until the next restart if the user's cache cannot be written
PLAIN_NAME = "HAPTIC_PLAIN_KERNELS"
PLAIN_WANTED = bool(os.environ.get(PLAIN_NAME))
ROOT = Path(__file__).resolve().parent.parent


def sources():
    """Every file that can reach a kernel."""
    rooms = (file for room in ROOMS for file in sorted((ROOT / room).glob("*.py")))
    return (*(ROOT / name for name in BESIDE), *rooms)


def sources_digest():
    """Digest of what the kernels are, and of the CPU that they are compiled for; 16 hexadecimal digits."""
    digest = hashlib.sha256()
    for fact in (version("numba"), sys.version, llvmlite.binding.get_host_cpu_name(), str(PLAIN_WANTED)):
        digest.update(fact.encode())
    for source in sources():
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def stamp():
    """Where the sources are and when they were written: numba looks at both; and of what decides which kernels of them
    are compiled. 16 hexadecimal digits."""
    files = *sources(), *(ROOT / name for name in DECIDE)
    facts = [(str(file), file.stat().st_mtime_ns) for file in files]
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:16]


def cache_folder():
    """(this code's own folder of kernels, "" or a sentence on why it is not under the user's cache).

    The newest is the last used; made here, older ones pruned.
    """
    base, digest = None, sources_digest()
    try:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "haptic_display"
        return _made(base, digest), ""
    except (OSError, RuntimeError) as error:  # RuntimeError: nobody's home is known
        why = getattr(error, "strerror", None) or str(error)
    try:
        folder = _made(_private(MEMORY / f"haptic_display_{os.geteuid()}"), digest)
    except OSError:
        folder = Path(tempfile.mkdtemp(prefix="haptic_display_"))
    return folder, f"{base or 'the cache folder'} cannot hold the compiled kernels ({why}); they are kept in {folder}"


def _made(base, digest):
    folder = base / digest
    folder.mkdir(parents=True, exist_ok=True)
    folder.touch()
    with tempfile.TemporaryFile(dir=folder) as file:
        if not any(folder.glob("*.done")):  # what is there already needs no room
            os.posix_fallocate(file.fileno(), 0, ROOM)
    for old in sorted((one for one in base.iterdir() if one.is_dir()), key=_last_used)[:-KEPT]:
        shutil.rmtree(old, ignore_errors=True)
    return folder


def _private(folder):
    """A folder that only this user can write: what lies in a cache is run."""
    folder.mkdir(mode=0o700, exist_ok=True)
    known = folder.lstat()
    if not stat.S_ISDIR(known.st_mode) or known.st_uid != os.geteuid() or known.st_mode & 0o077:
        raise PermissionError(f"{folder} is another user's")
    return folder


def _last_used(entry):
    try:
        return entry.stat().st_mtime
    except FileNotFoundError:  # another process prunes too
        return 0.0


_folder, NOTE = cache_folder()
FOLDER = str(_folder)
