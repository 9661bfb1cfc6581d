"""What a server shows to other machines: under which addresses, and whether its traffic can be read on the way."""

from __future__ import annotations

import ipaddress
import socket
import ssl
from pathlib import Path

from rrtik_ompl.base.errors import InputError

PASSIVE = socket.AI_PASSIVE  # as who wants to listen asks


def all_addresses(host: str) -> bool:
    """Whether a host, however it is spelt (``0``, ``0x0``, ``::``, ``::ffff:0.0.0.0``), means all addresses."""
    try:
        found = [ipaddress.ip_address(entry[4][0]) for entry in socket.getaddrinfo(host or None, 0, flags=PASSIVE)]
    except (OSError, UnicodeError, ValueError):
        return not host
    return any((getattr(each, "ipv4_mapped", None) or each).is_unspecified for each in found)


def tls_context(certificate: Path | None, key: Path | None) -> ssl.SSLContext | None:
    """What TLS needs: a certificate and its private key, both PEM; None without a certificate.

    Raises:
        InputError: If they cannot be used, or the key is encrypted.
    """
    if certificate is None:
        if key is not None:
            raise InputError(f"--key {key} needs the --certificate that it belongs to")
        return None
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    try:
        context.load_cert_chain(certificate, key, password=_no_password)
    except (OSError, ValueError) as error:  # ssl.SSLError is an OSError
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{certificate}: no certificate with its key (PEM): {reason}") from None
    return context


def _no_password() -> str:
    raise ValueError("the key is encrypted, and nobody asks for its password")
