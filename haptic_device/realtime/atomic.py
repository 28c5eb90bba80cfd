# SPDX-License-Identifier: Apache-2.0
"""Acquire and release words on shared int64 arrays, and records handed over under a sequence lock.

numba has no atomics of memory order for CPU code, and the compiler may reorder plain reads and writes; so load, store
and fence write LLVM's own instructions, and words_of spares a compilation for each kind of record. That takes parts
of numba that are not public (cgutils, imputils, arrayobj): public atomics in numba, or these few functions in C called
by pointer, would replace them.

The sequence lock (seqlock of Linux; H.-J. Boehm, "Can seqlocks get along with programming language memory models?",
MSPC 2012): the word is odd while the writer writes; a reader that finds it odd, or changed after its copy, reads anew.
"""

from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

from haptic_device.jit import kernel, njit

ATTEMPTS = 1000  # of a reader: a writer that was put off in the middle must not hold up a servo


def _pointer(context, builder, array_type, array, index):
    struct = cgutils.create_struct_proxy(array_type)(context, builder, array)
    return builder.gep(struct.data, [index])


@intrinsic
def load(typing_context, array, index):
    """array[index] of int64, with acquire ordering."""

    def generate(context, builder, signature, arguments):
        pointer = _pointer(context, builder, signature.args[0], arguments[0], arguments[1])
        return builder.load_atomic(pointer, "acquire", 8)

    return types.int64(array, types.intp), generate


@intrinsic
def store(typing_context, array, index, value):
    """array[index] = value of int64, with release ordering."""

    def generate(context, builder, signature, arguments):
        pointer = _pointer(context, builder, signature.args[0], arguments[0], arguments[1])
        builder.store_atomic(arguments[2], pointer, "release", 8)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.int64), generate


@intrinsic
def fence(typing_context):
    """Full barrier: no read or write moves across."""

    def generate(context, builder, signature, arguments):
        builder.fence("seq_cst")
        return context.get_dummy_value()

    return types.void(), generate


@intrinsic
def words_of(typing_context, records):
    """records.view(np.int64), which numba would compile from its Python source once for each kind of record."""
    words = types.int64[::1]

    def generate(context, builder, signature, arguments):
        given, made = make_array(records)(context, builder, arguments[0]), make_array(words)(context, builder)
        size, each = (context.get_constant(types.intp, number) for number in (8, records.dtype.size // 8))
        data, count = builder.bitcast(given.data, made.data.type), builder.mul(given.nitems, each)
        populate_array(made, data, [count], [size], size, given.meminfo, given.parent)
        return impl_ret_borrowed(context, builder, words, made._getvalue())

    return words(records), generate


@njit
def publish(words, lock, first, values):
    """Writes int64 values into words from first on, under the sequence lock at words[lock]; one writer only."""
    turn = load(words, lock) | 1  # odd already, where a writer died in the middle
    store(words, lock, turn)
    fence()  # odd is seen before any new word
    for i in range(values.size):
        words[first + i] = values[i]
    fence()
    store(words, lock, turn + 1)


@njit
def collect(words, lock, first, values):
    """Copies a consistent record out of words; returns its even sequence, or −1 if the writer never left it alone."""
    for _ in range(ATTEMPTS):
        turn = load(words, lock)
        if turn & 1:
            continue
        fence()
        for i in range(values.size):
            values[i] = words[first + i]
        fence()  # all words are read before the sequence is read again
        if load(words, lock) == turn:
            return turn
    return -1


@kernel
def collect_whole(words, lock, first, staged, values):
    """collect by way of `staged`: where the writer never left it alone (−1), values stay the record that they were."""
    turn = collect(words, lock, first, staged)
    if turn >= 0:
        for i in range(values.size):
            values[i] = staged[i]
    return turn
