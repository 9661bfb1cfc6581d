"""Hashes of data that are kept in files."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hashlib import _Hash


def sha256(data: bytes = b"") -> _Hash:
    """Return a hash object of some bytes, which can be updated with more.

    The module is imported here, because it loads 3.5 MB of OpenSSL that planning without a cache does not need.
    """
    from hashlib import sha256 as of

    return of(data)
