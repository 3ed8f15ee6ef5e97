"""The seal opens with its key only."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from missing_physics.challenge.seals.seal import new_key, seal, unseal
from robot_model import InputError


@given(st.binary(max_size=300))
def test_sealed_content_is_restored(content: bytes) -> None:
    key = new_key()
    assert unseal(seal(content, key), key, what="it") == content


@given(st.binary(max_size=60), st.data())
def test_any_changed_byte_is_reported(content: bytes, data: st.DataObject) -> None:
    key = new_key()
    sealed = bytearray(seal(content, key))
    place = data.draw(st.integers(0, len(sealed) - 1))
    sealed[place] ^= data.draw(st.integers(1, 255))
    with pytest.raises(InputError, match="it cannot be opened"):
        unseal(bytes(sealed), key, what="it")


@given(st.binary(max_size=40))
def test_random_bytes_are_rejected_as_a_seal(rubbish: bytes) -> None:
    with pytest.raises(InputError):
        unseal(rubbish, new_key(), what="it")


def test_another_key_does_not_open() -> None:
    with pytest.raises(InputError):
        unseal(seal(b"truth", new_key()), new_key(), what="it")


def test_sealing_twice_gives_different_bytes() -> None:
    key = new_key()
    assert seal(b"truth", key) != seal(b"truth", key)
