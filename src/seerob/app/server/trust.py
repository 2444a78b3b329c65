"""What a visitor's device has to trust: a page without a token, with the authority and the steps.

It tells nothing of the run. Whoever reads it compares the fingerprint with the one on the terminal: over a
connection that the device does not trust yet, somebody on the way could show another certificate.
"""

from __future__ import annotations

import ssl
from html import escape

from starlette.responses import HTMLResponse, PlainTextResponse, Response

from seerob.app.server.certificates import Tls

PATHS = frozenset({"/trust", "/trust/authority.pem", "/trust/authority.cer"})

STEPS = (
    (
        "Meta Quest",
        "Its browser takes no authority of yours: open the address, and choose Advanced, then Proceed. "
        "Or, with a cable, seerob run --adb, which needs no certificate.",
    ),
    (
        "Android",
        "Download authority.cer. Settings, Security, Encryption and credentials, Install a certificate, "
        "CA certificate. Chrome trusts it then.",
    ),
    (
        "iPhone, iPad",
        "Open authority.pem in Safari and allow the profile. Settings, General, VPN and Device Management: "
        "install it. General, About, Certificate Trust Settings: switch it on.",
    ),
    (
        "Windows",
        "Open authority.cer, Install Certificate, Current User, Trusted Root Certification Authorities.",
    ),
    ("macOS", "Open authority.pem in Keychain Access, and set it to Always Trust."),
    (
        "Linux",
        "Chromium: chrome://settings/certificates, Manage certificates, Authorities, Import authority.pem; "
        "in newer ones Local certificates, Custom, Installed by you, Trusted Certificates, Import. Firefox: "
        "Settings, Privacy & Security, View Certificates, Authorities, Import.",
    ),
    ("curl, Python", "curl --cacert authority.pem; ssl.create_default_context(cafile='authority.pem')."),
)
"""Device → what to do there; tried here for the last alone.

Chromium on Linux: its own docs/linux/cert_management.md, and for the newer menus warden's documentation
(wardenenv/docs#41, October 2025), read in November 2026. iPhone: that an authority without a common name is
not offered in Certificate Trust Settings (FiloSottile/mkcert#233); ours has one. The rest is from memory:
unverified.
"""


def answer(tls: Tls | None, path: str) -> Response:
    """One of `PATHS`; 404 where no authority was made here."""
    if tls is None or tls.authority is None:
        return PlainTextResponse("no authority was made here\n", 404)
    pem = tls.authority.read_text("ascii")
    if path.endswith(".pem"):
        return Response(pem, media_type="application/x-x509-ca-cert")
    if path.endswith(".cer"):
        return Response(ssl.PEM_cert_to_DER_cert(pem), media_type="application/x-x509-ca-cert")
    steps = "".join(f"<dt>{escape(device)}</dt><dd>{escape(what)}</dd>" for device, what in STEPS)
    return HTMLResponse(
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>seerob: whom to trust</title>'
        '<meta name="viewport" content="width=device-width">'
        "<h1>Trust this seerob</h1><p>The page is encrypted with a certificate by an authority that was "
        "made on the machine that serves it, for private addresses and that machine's names alone.</p>"
        "<p>Compare before you trust it: the terminal in which seerob runs shows the same SHA-256,</p>"
        f"<p><code>{escape(tls.fingerprint)}</code></p>"
        '<p><a href="/trust/authority.pem">authority.pem</a> · '
        '<a href="/trust/authority.cer">authority.cer</a></p>'
        f"<dl>{steps}</dl><p>Not tried on these devices; menus may be called otherwise. Remove it when you "
        "no longer need it.</p></html>"
    )
