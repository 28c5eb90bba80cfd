# SPDX-License-Identifier: Apache-2.0
"""How many connections an address may have, and how long one may ask for nothing."""

import asyncio

MOST_CONNECTIONS = 64  # of one address: more than all pages there can be, and what their browsers fetch
HANDSHAKE = 10.0  # s for a first request, and from one request to the next


class Door:
    """Makes the protocol of each new connection; inside() makes the one that serves those that are let in."""

    def __init__(self, inside):
        self._inside, self._waiting = inside, {}

    def __call__(self) -> asyncio.Protocol:
        return _Knock(self)

    def admit(self, transport) -> None:
        """Serves a connection, or breaks it off: at once if its address has enough, later if it asks for nothing."""
        self._waiting = {one: timer for one, timer in self._waiting.items() if not one.is_closing()}
        if sum(_address(one) == _address(transport) for one in self._waiting) >= MOST_CONNECTIONS:
            transport.abort()
            return
        self._waiting[transport] = asyncio.get_running_loop().call_later(HANDSHAKE, transport.abort)
        protocol = self._inside()
        transport.set_protocol(protocol)
        protocol.connection_made(transport)

    def heard(self, transport) -> None:
        """A request has come: what is asked for afterwards has the server's own time-out."""
        if transport in self._waiting:
            self._waiting[transport].cancel()


class _Knock(asyncio.Protocol):
    def __init__(self, door):
        self._door = door

    def connection_made(self, transport):
        self._door.admit(transport)


def _address(transport):
    return transport.get_extra_info("peername")[0]
