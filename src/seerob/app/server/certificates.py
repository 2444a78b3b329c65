"""TLS of the page's server: a certificate that was given, or one by an authority that is made here.

The authority is for this machine's page alone: its certificate names the private networks and the names of
this machine, and nothing else that it may speak for.
"""

from __future__ import annotations

import contextlib
import os
import socket
import ssl
from collections.abc import Iterable
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from hashlib import sha256
from ipaddress import ip_address, ip_network
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from seerob.core.errors import InputError
from seerob.core.extras import need
from seerob.core.host_name import is_address

if TYPE_CHECKING:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey

AUTHORITY_LASTS, CERTIFICATE_LASTS = timedelta(days=1825), timedelta(days=397)
"""The second is the most that browsers take."""
RENEWED = timedelta(days=30)
"""Before its end."""
_OWN = (
    *("10.0.0.0/8", "172.16.0.0/12", "192.168.0.0/16", "100.64.0.0/10", "169.254.0.0/16", "127.0.0.0/8"),
    *("fc00::/7", "fe80::/10", "::1/128"),
)
"""Networks that are nobody's on the internet (RFC 1918, 6598, 3927, 4193, 4291)."""


class Tls(NamedTuple):
    """What a server needs to encrypt."""

    context: ssl.SSLContext
    authority: Path | None = None
    """Certificate of the authority that was made here, which visitors have to trust; None of a given one."""
    fingerprint: str = ""
    """SHA-256 of that certificate, to compare on the device."""
    names: tuple[str, ...] = ()
    """Under which the server may be asked for: those of its certificate, but for wildcards."""


def given(certificate: Path, key: Path | None) -> Tls:
    """TLS with a certificate that somebody gave.

    Args:
        certificate: PEM, the server's own first, then those between it and its authority.
        key: PEM; in the certificate's file when None.

    Raises:
        InputError: They cannot be read, or do not belong together.
    """
    context = _context()
    try:
        context.load_cert_chain(certificate, key, password=_no_password)
    except (OSError, ValueError) as error:  # ssl.SSLError is an OSError
        reason = getattr(error, "reason", None) or getattr(error, "strerror", None) or str(error)
        what = f"cannot be used: {str(reason).replace('_', ' ').lower()}"
        remedy = "give --certificate and --key, both PEM, which belong together and need no password"
        raise InputError.at(certificate, "", what, remedy) from error
    return Tls(context, names=_spoken(certificate))


def _no_password() -> str:
    raise ValueError("its key is locked by a password")


def _context() -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    return context


def own(folder: Path, host: str) -> Tls:
    """TLS with a certificate for this machine, by an authority that is made when there is none.

    Args:
        folder: Where both are kept; only its owner may read it.
        host: Address that is listened on.

    Raises:
        MissingPackage: The extra ``tls`` is not installed.
        InputError: The folder cannot be written, or holds something else.
    """
    need("cryptography")
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        authority, key = _authority(folder)
        chain = folder / "server.pem"
        names = names_of_this_machine(host)
        if not _is_current(chain, authority, names):
            _write(chain, _issue(names, authority, key))
        context = _context()
        context.load_cert_chain(chain)
    except (OSError, ValueError, TypeError) as error:
        what = f"holds no usable authority: {getattr(error, 'strerror', None) or error}"
        remedy = "remove its files to make new ones, or give --certificate and --key"
        raise InputError.at(folder, "", what, remedy) from error
    from cryptography.hazmat.primitives.serialization import Encoding

    digest = sha256(authority.public_bytes(Encoding.DER)).hexdigest().upper()
    shown = ":".join(digest[i : i + 2] for i in range(0, len(digest), 2))
    return Tls(context, folder / "authority.pem", shown, names)


def names_of_this_machine(host: str = "") -> tuple[str, ...]:
    """Names and addresses under which others find this machine, and ``host``."""
    name = socket.gethostname()
    found = {"localhost", "127.0.0.1", "::1", name, f"{name.partition('.')[0]}.local", host}
    with suppress(OSError, UnicodeError):
        found |= {str(address[0]).partition("%")[0] for *_, address in socket.getaddrinfo(name, None)}
    for family, far in ((socket.AF_INET, "192.0.2.1"), (socket.AF_INET6, "2001:db8::1")):
        # Nothing is sent: the system says from which address it would be.
        with suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as link:
            link.connect((far, 9))
            found.add(link.getsockname()[0].partition("%")[0])
    usable = {n for n in found if n and not (is_address(n) and ip_address(n).is_unspecified)}
    return tuple(sorted(usable))


def _authority(folder: Path) -> tuple[x509.Certificate, EllipticCurvePrivateKey]:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    certificate, key = folder / "authority.pem", folder / "authority.key"
    if not certificate.exists() and not key.exists():
        made, secret = _make_authority()
        _write(key, secret)
        _write(certificate, made)
    private = load_pem_private_key(key.read_bytes(), None)
    found = x509.load_pem_x509_certificate(certificate.read_bytes())
    if not isinstance(private, ec.EllipticCurvePrivateKey):
        raise ValueError("the key is none that seerob makes")
    if found.public_key() != private.public_key() or found.not_valid_after_utc < datetime.now(UTC) + RENEWED:
        raise ValueError("certificate and key do not belong together, or it ends")
    return found, private


def _make_authority() -> tuple[bytes, bytes]:
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    names = names_of_this_machine()
    permitted: list[x509.GeneralName] = [x509.IPAddress(ip_network(network)) for network in _OWN]
    permitted += [x509.IPAddress(ip_network(n)) for n in names if is_address(n)]
    permitted += [x509.DNSName(n) for n in names if not is_address(n)]
    builder = (
        _begun(f"seerob on {socket.gethostname()}", AUTHORITY_LASTS)
        .public_key(key.public_key())
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(x509.NameConstraints(permitted, None), critical=True)
        .add_extension(_usage(signs=True), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )
    return _pem(builder.sign(key, hashes.SHA256())), _private(key)


def _issue(names: Iterable[str], authority: x509.Certificate, signer: EllipticCurvePrivateKey) -> bytes:
    """Key and certificate for this machine, and the authority's."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import ExtendedKeyUsageOID

    key = ec.generate_private_key(ec.SECP256R1())
    made = (
        _begun("seerob", CERTIFICATE_LASTS, authority.subject)
        .public_key(key.public_key())
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.SubjectAlternativeName([_general(n) for n in names]), critical=False)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .add_extension(_usage(signs=False), critical=True)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(signer.public_key()), critical=False
        )
        .sign(signer, hashes.SHA256())
    )
    return _private(key) + _pem(made) + _pem(authority)


def _is_current(chain: Path, authority: x509.Certificate, names: tuple[str, ...]) -> bool:
    from cryptography import x509

    if not chain.exists():
        return False
    certificate = x509.load_pem_x509_certificates(chain.read_bytes())[0]
    spoken = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    lasts = certificate.not_valid_after_utc > datetime.now(UTC) + RENEWED
    try:
        certificate.verify_directly_issued_by(authority)
    except Exception:  # of several libraries: whatever it is, it is made anew
        return False
    return lasts and {_general(n) for n in names} <= set(spoken)


def _spoken(file: Path) -> tuple[str, ...]:
    """Names and addresses that a certificate is for; none where nothing is installed that reads it."""
    try:
        from cryptography import x509
    except ImportError:
        return ()
    with contextlib.suppress(ValueError, x509.ExtensionNotFound):
        certificate = x509.load_pem_x509_certificates(file.read_bytes())[0]
        every = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        names = (str(each.value) for each in every if isinstance(each, x509.DNSName | x509.IPAddress))
        return tuple(name for name in names if "*" not in name)
    return ()


def _begun(name: str, lasts: timedelta, issuer: x509.Name | None = None) -> x509.CertificateBuilder:
    from cryptography import x509
    from cryptography.x509.oid import NameOID

    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name[:64])])
    now = datetime.now(UTC)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer or subject)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=1))
        .not_valid_after(now + lasts)
    )


def _general(name: str) -> x509.GeneralName:
    from cryptography import x509

    return x509.IPAddress(ip_address(name)) if is_address(name) else x509.DNSName(name)


def _usage(*, signs: bool) -> x509.KeyUsage:
    from cryptography import x509

    return x509.KeyUsage(
        digital_signature=not signs,
        key_cert_sign=signs,
        crl_sign=signs,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _pem(certificate: x509.Certificate) -> bytes:
    from cryptography.hazmat.primitives.serialization import Encoding

    return certificate.public_bytes(Encoding.PEM)


def _private(key: EllipticCurvePrivateKey) -> bytes:
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())


def _write(file: Path, data: bytes) -> None:
    """Write a file that only its owner may read, whole or not at all."""
    hidden = file.with_name(f".{file.name}.{os.getpid()}")
    with os.fdopen(os.open(hidden, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as opened:
        opened.write(data)
    hidden.replace(file)
