"""Who is whom in OPC UA: certificates of applications, what a server offers, and why it lets nobody in.

A certificate of an application names that by a URI among its alternative names; a client has to announce the
same one (OPC 10000-4, 5.7.2; OPC 10000-6, 6.2.2). Servers say what they offer to whoever asks (GetEndpoints),
their certificate with it; a session that is refused may be refused with as little as a closed connection.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from hashlib import sha256
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from cryptography import x509

LASTS = 1825
"""Days that a certificate lasts which is made here: five years, as others make them."""
BITS = 2048
"""Of its RSA key: what Basic256Sha256 takes at least, and every server."""
POLICY = "Basic256Sha256"
"""The one that is spoken here."""
MODES = {1: "none", 2: "sign", 3: "encrypt"}
"""MessageSecurityMode, as the workstation file has it."""
LOGINS = {0: "anonymous", 1: "user and password", 2: "certificate", 3: "token"}
"""UserTokenType."""
_LOGIN_REFUSED = ("BadUserAccessDenied", "BadIdentityTokenRejected", "BadIdentityTokenInvalid")


class Certificate(NamedTuple):
    """What a certificate says."""

    name: str
    uris: tuple[str, ...]
    """Of the application that it is of."""
    begins: datetime
    ends: datetime
    fingerprint: str
    """SHA-256 of it, ``AB:CD:…``."""

    def __str__(self) -> str:
        """In a line."""
        who = f"{self.name!r}" + (f" ({self.uris[0]})" if self.uris else "")
        return f"{who}, until {self.ends:%Y-%m-%d}, SHA-256 {self.fingerprint}"


class Endpoint(NamedTuple):
    """One way in that a server offers."""

    url: str
    mode: str
    """``none``, ``sign`` or ``encrypt``."""
    policy: str
    """``None``, ``Basic256Sha256``, …"""
    certificate: bytes
    """The server's, DER; empty for none."""
    logins: tuple[str, ...]

    def __str__(self) -> str:
        """In a line."""
        how = 'security = "none"' if self.mode == "none" else f'security = "{self.mode}" with {self.policy}'
        spoken = "" if self.spoken else ", which is not spoken here"
        return f"{how}{spoken}; login: {', '.join(self.logins) or 'none'} ({self.url})"

    @property
    def spoken(self) -> bool:
        """Whether it can be taken here."""
        return self.mode == "none" or self.policy == POLICY


def endpoint(said: Any) -> Endpoint:
    """One way in, from an ``EndpointDescription`` of asyncua."""
    return Endpoint(
        url=str(said.EndpointUrl or ""),
        mode=MODES.get(int(said.SecurityMode), str(said.SecurityMode)),
        policy=str(said.SecurityPolicyUri or "").rpartition("#")[2],
        certificate=first_of(said.ServerCertificate or b""),
        logins=tuple(dict.fromkeys(LOGINS.get(int(t.TokenType), "?") for t in said.UserIdentityTokens or ())),
    )


def first_of(chain: bytes) -> bytes:
    """The first certificate of several in a row, DER: the server's own."""
    if len(chain) < 4 or chain[1] != 0x82:
        return chain
    return chain[: 4 + int.from_bytes(chain[2:4], "big")]


def certificate(data: bytes) -> Certificate:
    """What a certificate says.

    Args:
        data: PEM or DER.

    Raises:
        ValueError: It is none.
    """
    from cryptography import x509
    from cryptography.hazmat.primitives.serialization import Encoding
    from cryptography.x509.oid import NameOID

    pem = data.lstrip().startswith(b"-----")
    found = x509.load_pem_x509_certificate(data) if pem else x509.load_der_x509_certificate(data)
    digest = sha256(found.public_bytes(Encoding.DER)).hexdigest().upper()
    names = found.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return Certificate(
        name=str(names[0].value) if names else found.subject.rfc4514_string(),
        uris=_uris(found),
        begins=found.not_valid_before_utc,
        ends=found.not_valid_after_utc,
        fingerprint=":".join(re.findall("..", digest)),
    )


def pem_of(der: bytes) -> bytes:
    """A certificate as text.

    Raises:
        ValueError: It is none.
    """
    from cryptography import x509
    from cryptography.hazmat.primitives.serialization import Encoding

    return x509.load_der_x509_certificate(der).public_bytes(Encoding.PEM)


def _uris(found: x509.Certificate) -> tuple[str, ...]:
    from cryptography import x509

    try:
        names = found.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        return ()
    return tuple(names.get_values_for_type(x509.UniformResourceIdentifier))


class Made(NamedTuple):
    """A certificate of this application, and its key."""

    pem: bytes
    der: bytes
    key: bytes
    """PEM, without a password."""


def made(uri: str, name: str, hosts: Sequence[str], days: int = LASTS) -> Made:
    """A certificate of this application that it signs itself, as OPC 10000-6 (6.2.2) wants it.

    Args:
        uri: Of the application; ``urn:…`` is usual.
        name: Shown where it is to be trusted.
        hosts: Names of this machine.
        days: How long it lasts.
    """
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import rsa
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
    from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

    key = rsa.generate_private_key(public_exponent=65537, key_size=BITS)
    who = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name[:64])])
    others = [x509.UniformResourceIdentifier(uri), *(x509.DNSName(host) for host in hosts)]
    usage = x509.KeyUsage(
        digital_signature=True,
        content_commitment=True,
        key_encipherment=True,
        data_encipherment=True,
        key_cert_sign=True,  # of itself
        key_agreement=False,
        crl_sign=False,
        encipher_only=False,
        decipher_only=False,
    )
    public = key.public_key()
    now = datetime.now(UTC)
    found = (
        x509.CertificateBuilder()
        .subject_name(who)
        .issuer_name(who)
        .public_key(public)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=1))  # of clocks that differ
        .not_valid_after(now + timedelta(days=days))
        .add_extension(x509.SubjectAlternativeName(others), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.CLIENT_AUTH]), critical=False)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(public), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(public), critical=False)
        .sign(key, hashes.SHA256())
    )
    secret = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    return Made(found.public_bytes(Encoding.PEM), found.public_bytes(Encoding.DER), secret)


def chosen(offered: Sequence[Endpoint], mode: str) -> Endpoint | None:
    """The way in that a mode takes; None where the server does not offer it."""
    return next((each for each in offered if each.mode == mode and each.spoken), None)


def why_another(offered: Sequence[Endpoint], mode: str, pinned: Certificate | None = None) -> str:
    """Why this is not the server that is meant: it has no such way in, or another certificate; or empty.

    Args:
        offered: What it offers.
        mode: How the session is to be protected.
        pinned: Its certificate, as the user has it.
    """
    way = chosen(offered, mode)
    if way is None:
        ways = "; ".join(dict.fromkeys(str(each) for each in offered)) or "nothing"
        return f'the server does not offer security = "{mode}" with {POLICY}; it offers {ways}'
    if pinned is not None and way.certificate:
        shown = certificate(way.certificate)
        if shown.fingerprint != pinned.fingerprint:
            remedy = "if that is the right server, write it anew: seerob probe, --server-certificate FILE"
            return f"the server shows the certificate {shown}, server_certificate is {pinned}; {remedy}"
    return ""


def why_refused(
    offered: Sequence[Endpoint], mode: str, *, error: str, own: Certificate | None, user: str | None
) -> str:
    """Why a server lets nobody in, and what would be right; empty where nothing speaks for a refusal.

    Args:
        offered: What it offers.
        mode: How the session was to be protected: one of those.
        error: What it said, with the name of the status.
        own: The client's certificate, where it showed one.
        user: Who logs in.
    """
    said = f" (it says: {error})" if error else ""
    logins = [login for each in offered if each.mode == mode and each.spoken for login in each.logins]
    if user is None and "anonymous" not in logins:
        return f"the server lets nobody in without a login ({', '.join(logins)}): give user, password_env"
    if any(name in error for name in _LOGIN_REFUSED):
        return f"the server refuses the login of {user!r}{said}" if user else f"no login is refused{said}"
    if own is not None:
        now = datetime.now(UTC)
        if not own.begins <= now < own.ends:
            when = f"{own.begins:%Y-%m-%d} to {own.ends:%Y-%m-%d}"
            return f"the own certificate holds from {when}: make another (seerob opcua certificate){said}"
        if not own.uris:
            what = f"the own certificate {own} has no application URI, which servers want"
            return f"{what}: make another (seerob opcua certificate){said}"
        remedy = "let it be trusted there, or give one that it takes (seerob opcua certificate)"
        return f"the server does not take the own certificate {own}: {remedy}{said}"
    return ""
