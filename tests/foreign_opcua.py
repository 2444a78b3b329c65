"""A server of asyncua alone, nothing of ours: tests import it as ``from foreign_opcua import …``."""

from __future__ import annotations

import socket
from contextlib import contextmanager

URI = "urn:another:maker"


@contextmanager
def foreign_opcua(values, writable=(), more=lambda server: None, port=0):
    """A PLC of another maker.

    Args:
        values: First value of each node, by name.
        writable: Those that clients may write.
        more: Adds what else there is to the server (`asyncua.sync.Server`).
        port: Where it listens; any that is free when 0.

    Yields:
        Address, and nodes by name: ``nodes["lamp"].write_value(True)``.
    """
    from asyncua.sync import Server

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = port or free.getsockname()[1]
    server = Server()
    try:
        server.set_endpoint(f"opc.tcp://127.0.0.1:{port}/")
        index = server.register_namespace(URI)
        nodes = {}
        for name, value in values.items():
            nodes[name] = server.nodes.objects.add_variable(f"ns={index};s={name}", f"{index}:{name}", value)
            if name in writable:
                nodes[name].set_writable()
        more(server)
        server.start()
        yield f"opc.tcp://127.0.0.1:{port}", nodes
    finally:
        server.stop()


@contextmanager
def strict_opcua(folder, trusted=(), user=("op", "right"), anonymous=False, uri="urn:strict:plc"):
    """A PLC of another maker that takes protected sessions only, of clients whose certificates it has.

    It checks what the standard wants of them: dates, the application's URI against what the client announces,
    what the key may be used for.

    Args:
        folder: Where it keeps its own certificate (``server.der``) and key.
        trusted: Certificates of clients, DER.
        user: Who may log in.
        anonymous: Whether others may, too.
        uri: Its own.

    Yields:
        Address.
    """

    from asyncua import Server, ua
    from asyncua.crypto.cert_gen import setup_self_signed_certificate
    from asyncua.crypto.permission_rules import User, UserRole
    from asyncua.crypto.truststore import TrustStore
    from asyncua.crypto.validator import CertificateValidator, CertificateValidatorOptions
    from asyncua.sync import ThreadLoop
    from cryptography.x509.oid import ExtendedKeyUsageOID

    class Users:
        def get_user(self, iserver, username=None, password=None, certificate=None):
            known = (anonymous and username is None) or (username, password) == user
            return User(role=UserRole.User) if known else None

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"opc.tcp://127.0.0.1:{free.getsockname()[1]}"
    (folder / "trusted").mkdir(exist_ok=True)
    for k, data in enumerate(trusted):
        (folder / "trusted" / f"{k}.der").write_bytes(data)

    async def begin():
        server = Server(user_manager=Users())
        await server.init()
        await server.set_application_uri(uri)
        await setup_self_signed_certificate(
            folder / "server-key.pem", folder / "server.der", uri, "127.0.0.1",
            [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH], {"commonName": "strict"},
        )  # fmt: skip
        await server.load_certificate(folder / "server.der")
        await server.load_private_key(folder / "server-key.pem")
        store = TrustStore([folder / "trusted"], [])
        await store.load()
        server.set_certificate_validator(
            CertificateValidator(
                CertificateValidatorOptions.TRUSTED_VALIDATION | CertificateValidatorOptions.PEER_CLIENT,
                store,
            )
        )
        policies = ["Basic256Sha256_SignAndEncrypt", "Basic256Sha256_Sign"]
        server.set_security_policy([getattr(ua.SecurityPolicyType, policy) for policy in policies])
        logins = [ua.UserNameIdentityToken, *([ua.AnonymousIdentityToken] if anonymous else [])]
        server.set_identity_tokens(logins)
        server.set_endpoint(address)
        index = await server.register_namespace(URI)
        await server.nodes.objects.add_variable(f"ns={index};s=lamp", f"{index}:lamp", True)
        await server.start()
        return server

    with ThreadLoop() as loop:
        server = loop.post(begin())
        try:
            yield address
        finally:
            loop.post(server.stop())
