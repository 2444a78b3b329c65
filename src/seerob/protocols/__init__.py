"""Protocols of controllers and machines: codecs as pure functions, and the clients that speak them."""

from __future__ import annotations

from seerob.core.errors import SeerobError


class ProtocolError(SeerobError):
    """What the other end sent cannot be understood; the connection has to begin anew."""


class NotLetIn(ProtocolError):
    """The other end is there and lets nobody in: a login, a certificate or a right is not what it wants."""
