"""What has to agree once a seal is open: promise, sealed files, key, truth, cases and answers."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from missing_physics.challenge.cases.truth import commitment
from missing_physics.challenge.seals.records import Answers, Made, Opened, Promise, Sealed
from missing_physics.challenge.seals.seal import digest, unseal
from missing_physics.challenge.seals.store import Store
from robot_model import InputError

__all__ = ["cases_fingerprint", "check_cases", "checked_answers", "opened_by"]


def _changed(path: Path, why: str) -> InputError:
    return InputError(
        f"{path} was changed: {why}, so this challenge proves nothing any more; begin a new one with another "
        "--out."
    )


def cases_fingerprint(store: Store, names: Iterable[str]) -> str:
    """Joint fingerprint of all cases."""
    parts = []
    for name in names:
        store.expected(Made, "manifest", f"{name}.json")
        parts.append(store.path("manifest", f"{name}.json").read_bytes())
    return digest(b"\0".join(parts))


def check_cases(store: Store, names: Iterable[str], sealed: Sealed) -> None:
    """Raise `InputError` if the cases are not those that were sealed."""
    if sealed.cases_sha256 != cases_fingerprint(store, names):
        raise InputError(f"{store.path('manifest')} was changed after the cases were sealed.")


def opened_by(store: Store) -> Opened:
    """The opened truth, after checking its key, the sealed file and the fingerprint of the truth.

    Raises:
        InputError: one of the files, which is named, does not agree with the others.
    """
    opened = store.expected(Opened, "opened.json")
    sealed = store.expected(Sealed, "seal.json")
    if opened.sealed != f"{len(sealed.sealed)}.bin":
        raise _changed(store.path("opened.json"), "it does not name the last sealed file")
    fingerprints = {f"{number}.bin": found for number, found in enumerate(sealed.sealed, start=1)}
    content = store.files("sealed", ".", fingerprints)[opened.sealed]
    path = store.path("sealed", opened.sealed)
    try:
        key = bytes.fromhex(opened.key)
    except ValueError:
        raise _changed(store.path("opened.json"), "its key is invalid") from None
    truth = digest(unseal(content, key, what=str(path)))
    if truth != store.expected(Promise, "challenge.json").truth_sha256:
        raise InputError(f"{path} does not hold the truth that was promised.")
    if commitment(opened.truth) != truth:
        raise _changed(store.path("opened.json"), "its truth is not the sealed one")
    return opened


def checked_answers(store: Store, made: Iterable[str], opened: Opened) -> dict[str, str]:
    """Fingerprint of every answer, checked against the fingerprint recorded when the seal was opened."""
    path = store.path("answers.json")
    promised = store.expected(Answers, "answers.json").answers
    if digest(path.read_bytes()) != opened.answers_sha256:
        raise _changed(path, "its fingerprint is not the one that was written when the seal was opened")
    if set(promised) != set(made):
        raise _changed(path, "it does not list the generated cases")
    return promised
