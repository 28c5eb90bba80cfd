# SPDX-License-Identifier: Apache-2.0
"""Who may come in: the token in the path says what a page may do, Host and Origin that it is this server's own page."""

import hmac
import ipaddress
import secrets

HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; connect-src 'self'; frame-ancestors 'none'; "
    "base-uri 'none'; form-action 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}


class Guard:
    """Two random tokens: of the page with control, and of the one that only looks on."""

    def __init__(self, host: str):
        self.control, self.look = secrets.token_urlsafe(16), secrets.token_urlsafe(16)
        self._own = is_loopback(host)

    def may_control(self, token: str) -> bool:
        """Whether this token gives control; PermissionError if it is none of ours."""
        if hmac.compare_digest(token.encode(errors="replace"), self.control.encode()):
            return True
        if hmac.compare_digest(token.encode(errors="replace"), self.look.encode()):
            return False
        raise PermissionError("this address has no valid token; take the one that haptic view printed")

    def check_host(self, host: str) -> None:
        """A server of this machine's own answers to this machine's own names: no other name may be led here."""
        if self._own and not is_loopback(_name(host)):
            raise PermissionError(f"this server does not answer to the name {host}")

    def check_origin(self, origin: str | None, host: str) -> None:
        """A websocket is opened by this server's own page only."""
        if origin != f"http://{host}":
            raise PermissionError(f"a page of {origin or 'an unknown origin'} may not open this connection")


def is_loopback(host: str) -> bool:
    """Whether a name or an address is this machine's own."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _name(host):
    """The name or address of a Host header, without its port."""
    if host.startswith("["):
        return host[1:].split("]")[0]
    return host.rsplit(":", 1)[0]
