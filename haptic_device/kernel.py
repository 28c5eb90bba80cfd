# SPDX-License-Identifier: Apache-2.0
"""`@kernel`: a function that Python calls as a whole, and other kernels take in as a part (whole.py)."""

from haptic_device.whole import part_of, whole


def kernel(*signature):
    """As `numba.njit(nogil=True, cache=True)`; division by zero follows IEEE 754, nothing raises.

    With a signature it is compiled at once, and is for Python and function pointers.
    """
    if not signature or not callable(signature[0]):
        return lambda function: whole(function, *signature)
    return part_of(whole(*signature))
