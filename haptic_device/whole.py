# SPDX-License-Identifier: Apache-2.0
"""`@whole` and `@part`: a kernel of many functions that Python calls as one.

A part is called by wholes and other parts only, and makes no array unless it says so. Where numba is a version that
`fused.py` was tested with, the parts of a whole are optimised and compiled together, once. Anywhere else each function
is an ordinary `numba.njit`: the same bits, some three times as long to compile (bench/plain_njit.py). `PLAIN` says why,
or is "".
"""

import contextlib
import importlib
import sys

import numba

from haptic_device import cache

KNOWN = ("0.68",)
"""Versions of numba that fused.py was tested with; setup.py names the same."""
ERROR_MODEL = "numpy"  # division by zero follows IEEE 754, nothing raises
_OPTIONS = {"nogil": True, "error_model": ERROR_MODEL}


def _skip_blas():
    """Has numba's array functions loaded without its search for BLAS: that imports scipy.linalg, 0.2 s of every node's
    start, and no kernel multiplies matrices."""
    blas = "scipy.linalg.cython_blas"
    if blas not in sys.modules:
        sys.modules[blas] = None
        with contextlib.suppress(ImportError):  # another numba may have it elsewhere, and then looks for BLAS
            importlib.import_module("numba.np.arraymath")
        del sys.modules[blas]


def _why_plain():
    """(the module fused, "") or (None, why not)."""
    if cache.PLAIN_WANTED:
        return None, f"{cache.PLAIN_NAME} is set"
    if ".".join(numba.__version__.split(".")[:2]) not in KNOWN:
        return None, f"numba {numba.__version__} is not one of the known versions, {', '.join(KNOWN)}"
    try:
        from haptic_device import fused
    except (ImportError, AttributeError) as error:
        return None, f"numba {numba.__version__} lacks an inner part: {error}"
    return fused, ""


_skip_blas()
_fused, PLAIN = (None, "the compiler is off") if numba.config.DISABLE_JIT else _why_plain()


def part(function, arrays=False):
    """A function of kernels: called by `whole` ones and other parts; may it make arrays?"""
    return _fused.part(function, arrays, _OPTIONS) if _fused else numba.njit(**_OPTIONS)(function)


def whole(function, *signature):
    """A kernel that Python calls; all the parts it calls are compiled with it. With a signature, at once."""
    numba.config.CACHE_DIR = cache.FOLDER
    made = numba.njit(cache=True, **_OPTIONS)(function)
    if signature and not numba.config.DISABLE_JIT:
        made.compile(*signature)
        made.disable_compile()
    return made


def part_of(made):
    """Has other kernels take in the whole `made` as a part."""
    if _fused:
        below = _fused.part(made.py_func, True, _OPTIONS)
        made.get_call_template, made.get_overload = below.get_call_template, below.get_overload
    return made
