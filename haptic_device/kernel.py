# SPDX-License-Identifier: Apache-2.0
"""`@kernel`: a function that Python calls as a whole, and other kernels take in as a part (whole.py)."""

import numba

from haptic_device.whole import part, whole


def kernel(*signature):
    """As `numba.njit(nogil=True, cache=True)`; division by zero follows IEEE 754, nothing raises.

    With a signature it is compiled at once, and is for Python and function pointers.
    """
    if not signature or not callable(signature[0]):
        return lambda function: whole(function, *signature)
    made = whole(*signature)
    if not numba.config.DISABLE_JIT:
        below = part(made.py_func, arrays=True)
        made.get_call_template, made.get_overload = below.get_call_template, below.get_overload
    return made
