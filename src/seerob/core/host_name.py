"""Names and addresses of other computers, as they may be written: what cannot be one is said at once."""

from __future__ import annotations

from ipaddress import ip_address
from urllib.parse import urlsplit

LONGEST = 253
"""Characters of a name (RFC 1035)."""


def check_host(key: str, host: str) -> None:
    """Check a name or an address, without asking anybody for it.

    Args:
        key: Of the option, for the message.
        host: What was given.

    Raises:
        ValueError: No computer can be called so.
    """
    shown = f"{key} = {host[:80]!r}"
    if "/" in host or "[" in host:
        raise ValueError(f"{shown} is no name or address: write it alone, such as 192.168.0.10")
    if ":" in host and not is_address(host):
        raise ValueError(f"{shown} is no name or address: a port is an option of its own, port = …")
    if len(host) > LONGEST or any(c.isspace() or not c.isprintable() for c in host) or not _has_labels(host):
        raise ValueError(f"{shown} is no name or address such as 192.168.0.10")


def check_url(key: str, url: str) -> None:
    """Check the name or address of the computer in a URL, and its port, without asking anybody for it.

    Raises:
        ValueError: It cannot be one.
    """
    try:
        parts = urlsplit(url)
        host, _ = parts.hostname, parts.port
    except ValueError as error:
        raise ValueError(f"{key} = {url[:80]!r}: {error}") from None
    if host:
        check_host(key, host)


def is_address(host: str) -> bool:
    """Whether a host is an IP address; a name can be made to point elsewhere, an address cannot."""
    try:
        ip_address(host)
    except ValueError:
        return False
    return True


def is_loopback(host: str) -> bool:
    """Whether a host is this machine itself: nobody else can reach it, and nobody listens on the way."""
    return host == "localhost" or (is_address(host) and ip_address(host).is_loopback)


def _has_labels(host: str) -> bool:
    """Whether it is parts of a bearable length between dots: what is looked up is encoded like that."""
    try:
        host.encode("idna")
    except UnicodeError:
        return False
    return True
