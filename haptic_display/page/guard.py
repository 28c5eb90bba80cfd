# SPDX-License-Identifier: Apache-2.0
"""Who may come in: the token in the path says what a page may do, Host and Origin that it is this server's own page."""

import hmac
import ipaddress
import socket

from haptic_display.page.kept_tokens import fresh

HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; connect-src 'self'; frame-ancestors 'none'; "
    "base-uri 'none'; form-action 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}
ALONE = {
    "Content-Security-Policy": "sandbox allow-scripts; default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
}
"""For files that hold all they need, of recordings that may be anybody's: an origin of their own, and no way out."""

NOBODY = {4: "192.0.2.1", 6: "2001:db8::1"}  # addresses of documentation: nothing is ever sent there


class Guard:
    """Two tokens: of the page with control, and of the one that only looks on. host: where it listens."""

    def __init__(self, host: str):
        self.control, self.look = fresh()
        self._own, machine = is_loopback(host), socket.gethostname().lower()
        self._names = {host.lower(), machine, f"{machine}.local"}

    def may_control(self, token: str) -> bool:
        """Whether this token gives control; PermissionError if it is none of ours."""
        if hmac.compare_digest(token.encode(errors="replace"), self.control.encode()):
            return True
        if hmac.compare_digest(token.encode(errors="replace"), self.look.encode()):
            return False
        raise PermissionError("this address has no valid token; take the one that haptic view printed")

    def check_host(self, host: str) -> None:
        """A server of this machine's own answers to its loopback names only; one that is open to others to addresses
        and this machine's name too. Any other name may be a stranger's that was led here."""
        name = _name(host).lower()
        if not (is_loopback(name) or (not self._own and (name in self._names or _address(name)))):
            raise PermissionError(f"this server does not answer to the name {host}")

    def check_origin(self, origin: str | None, host: str) -> None:
        """A websocket is opened by this server's own page only."""
        if origin != f"http://{host}":
            raise PermissionError(f"a page of {origin or 'an unknown origin'} may not open this connection")


def is_loopback(host: str) -> bool:
    """Whether a name or an address is this machine's own."""
    address = _address(host)
    return address.is_loopback if address else host == "localhost"


def reachable(host: str) -> str:
    """Where others find a server that listens on this host: itself, or if that means every address of this machine, the
    one that leads outside; without any, this machine's name."""
    address = _address(host)
    if not address or not address.is_unspecified:
        return host
    family = socket.AF_INET6 if address.version == 6 else socket.AF_INET
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as way:
            way.connect((NOBODY[address.version], 9))  # of a datagram socket: looks up the route, sends nothing
            return way.getsockname()[0]
    except OSError:
        return socket.gethostname()


def _address(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """None for a name."""
    try:
        return ipaddress.ip_address(host)
    except ValueError:
        return None


def _name(host: str) -> str:
    """The name or address of a Host header, without its port."""
    if host.startswith("["):
        return host[1:].split("]")[0]
    return host.rsplit(":", 1)[0]
