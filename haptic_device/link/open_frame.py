# SPDX-License-Identifier: Apache-2.0
"""The host's side of the link protocol (docs/reference/link_protocol.md): the codec of both open links, serial and UDP.

Frames are whole datagrams, or coded by COBS on a stream of bytes. What they say is open_say's, what they tell
open_hear's.
"""

import functools

import numpy as np

from haptic_device.link import codec, frame, open_hear, open_say


@functools.cache
def datagrams():
    """encode and decode of one frame a datagram; compiled where there is such a link."""
    return codec.encoder(_encode_datagram), codec.decoder(_decode_datagram)


@functools.cache
def streams():
    """encode and decode of frames by COBS on a stream of bytes; compiled where there is such a link."""
    return codec.encoder(_encode_stream), codec.decoder(_decode_stream)


def _encode_datagram(state, event, now, command, outgoing):
    return open_say.say(state, event, now, command, outgoing)


def _encode_stream(state, event, now, command, outgoing):
    plain = np.empty(frame.LONGEST, np.uint8)
    count = open_say.say(state, event, now, command, plain)
    if count == 0:
        return 0
    start = 1  # the 0 before a frame ends what came before, also one that the line took in part
    outgoing[0] = 0
    end = start + frame.cobs_encode(plain, count, outgoing[start:])
    outgoing[end] = 0
    return end + 1


def _decode_datagram(state, incoming, count, now, answer):
    open_hear.hear(state, incoming, count, now, answer)
    return count


def _decode_stream(state, incoming, count, now, answer):
    answer[codec.KIND] = codec.NOTHING
    first = 0
    while first < count and incoming[first] == 0:
        first += 1
    end = first
    while end < count and incoming[end] != 0:
        end += 1
    if end == count and end - first <= frame.LONGEST_CODED:
        return first  # more have to come
    plain = np.empty(frame.LONGEST, np.uint8)
    length = frame.cobs_decode(incoming, first, end - first, plain)
    open_hear.hear(state, plain, length, now, answer)
    return min(end + 1, count)
