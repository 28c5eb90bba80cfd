# SPDX-License-Identifier: Apache-2.0
"""What the operating system refuses, in words: the file, and why; never `[Errno 28]`."""

import contextlib
from collections.abc import Iterator
from os import PathLike, fspath


def in_words(error: BaseException) -> str:
    """An exception on one line; of an OSError `FILE: reason`, or the reason alone where it names no file."""
    if isinstance(error, OSError) and error.strerror:
        files = [str(file) for file in (error.filename, error.filename2) if file is not None]
        return ": ".join((*files, error.strerror))
    return " ".join(str(error).split())


@contextlib.contextmanager
def naming(file: str | PathLike[str]) -> Iterator[None]:
    """An OSError that comes meanwhile without a file's name (a full disk, while it is written) gets this one."""
    try:
        yield
    except OSError as error:
        if error.errno is None or error.filename is not None:
            raise
        raise OSError(error.errno, error.strerror, fspath(file)) from error
