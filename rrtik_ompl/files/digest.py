"""Hashes of what is kept in files."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hashlib import _Hash


def sha256(data: bytes = b"") -> _Hash:
    """Return the hash of some bytes, to which more may be added.

    Python's module takes 3.5 MB, of OpenSSL; who imports this package to plan without a cache does not load it.
    """
    from hashlib import sha256 as of

    return of(data)
