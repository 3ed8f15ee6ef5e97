"""Sealing of the truth: AES-256-GCM with a random key that exists only in the memory of one process.

The library `cryptography` (pyca) encrypts and authenticates, so that a changed file or a wrong key is
detected (NIST SP 800-38D). The key is published when the seal is opened.
"""

from __future__ import annotations

import hashlib
import os

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import AESGCM

from robot_model import InputError

__all__ = ["digest", "new_key", "seal", "unseal"]

KEY_BITS = 256
#: Length of the random number that makes every sealing different [bytes].
NONCE = 12
#: Description of the sealed content, authenticated with it.
LABEL = b"missing-physics challenge, schema 1"


def new_key() -> bytes:
    """A fresh random key."""
    return AESGCM.generate_key(KEY_BITS)


def seal(content: bytes, key: bytes) -> bytes:
    """`content`, encrypted and authenticated."""
    nonce = os.urandom(NONCE)
    return nonce + AESGCM(key).encrypt(nonce, content, LABEL)


def unseal(sealed: bytes, key: bytes, *, what: str) -> bytes:
    """The content of `sealed`.

    Raises:
        InputError: wrong key, or the sealed bytes were changed; `what` names them in the message.
    """
    try:
        return AESGCM(key).decrypt(sealed[:NONCE], sealed[NONCE:], LABEL)
    except (InvalidTag, ValueError):
        raise InputError(
            f"{what} cannot be opened: it was changed after it was sealed, or the key belongs to another one."
        ) from None


def digest(content: bytes) -> str:
    """SHA-256 in hexadecimal."""
    return hashlib.sha256(content).hexdigest()
