"""Files of a challenge on disk, and checks that they were not changed.

    challenge.json     fingerprints of the truth and of the program, written first
    cases/NAME/        robot.toml, recording.csv, validation.csv: the diagnosis sees nothing else
    manifest/NAME.json fingerprints of these files, or why the case could not be generated
    sealed/NUMBER.bin  the truth, sealed again by every run that diagnoses
    seal.json          fingerprints of the sealed files and of all cases, written before any diagnosis
    answers/NAME/      diagnosis.json, robot.augmented.toml, answer.json with their fingerprints
    answers.json       fingerprints of all answers, written before the seal is opened
    opened.json        the truth and the keys, published
    scoring.json       fingerprints of the program that scored and of the scores
    scores/NAME.json   the score of each case

Every file is written atomically, so that work finished before an interruption stays valid.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from missing_physics.challenge.seals.records import Promise
from missing_physics.challenge.seals.seal import digest
from robot_model import InputError, replacing_set, write_atomically
from robot_model.system.owners import WRITING, remove_left

__all__ = ["Store", "said"]

#: Files that exist only after a challenge has begun.
STARTED = ("cases", "manifest", "sealed", "seal.json", "answers", "answers.json", "opened.json")
Kind = TypeVar("Kind", bound=BaseModel)


class Store:
    """The folder of one challenge."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, *parts: str) -> Path:
        return self.folder.joinpath(*parts)

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Lock the folder; raises `InputError` if another process holds the lock."""
        with said(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
            handle = os.open(self.path(".lock"), os.O_CREAT | os.O_RDWR, 0o644)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(handle)
            raise InputError(f"another challenge is at work in {self.folder}; give another --out.") from None
        try:
            with said(self.folder):
                yield
        finally:
            os.close(handle)

    def read(self, *parts: str) -> Any:
        """Content of a JSON file; None if it does not exist. Raises `InputError` for a damaged one."""
        path = self.path(*parts)
        if not path.is_file():
            return None
        try:
            return json.loads(path.read_text("utf-8"))
        except ValueError:
            raise InputError(
                f"{path} is damaged: it is no JSON; remove it and run the challenge again."
            ) from None

    def record(self, kind: type[Kind], *parts: str) -> Kind | None:
        """Content of a JSON file; None if there is none. Raises `InputError` if it is not of that kind."""
        if not self.path(*parts).is_file():
            return None
        try:
            return kind.model_validate(self.read(*parts))
        except ValidationError as error:
            first = error.errors()[0]
            key = ".".join(map(str, first["loc"])) or "all of it"
            raise InputError(
                f"{self.path(*parts)} was changed or damaged: {key}: {first['msg'].lower()}; begin a new "
                "challenge with another --out."
            ) from None

    def expected(self, kind: type[Kind], *parts: str) -> Kind:
        """The same for a file that must exist."""
        found = self.record(kind, *parts)
        if found is None:
            raise InputError(
                f"{self.path(*parts)} is missing, so this challenge proves nothing any more; begin a new one "
                "with another --out."
            )
        return found

    def write(self, content: Any, *parts: str) -> None:
        """Write a JSON file atomically."""
        write_atomically(self.path(*parts), json.dumps(content, indent=1, sort_keys=True) + "\n")

    def claim(self, identity: Mapping[str, Any], *, free: Collection[str] = ()) -> None:
        """Begin or resume this challenge; raises `InputError` if the folder contains another one.

        The values of `free` keys may differ from those at the beginning.
        """
        existing = self.read("challenge.json")
        if existing is None:
            if any(self.path(part).exists() for part in STARTED):
                raise InputError(f"{self.folder} holds cases but no challenge.json; give another --out.")
            self.write(dict(identity), "challenge.json")
            return
        self.record(Promise, "challenge.json")
        for key, value in identity.items():
            if key not in free and existing.get(key) != value:
                raise InputError(
                    f"{self.folder} holds another challenge (its {key} differs); give another --out, or the "
                    "--seed, --cases and version of the program that it was begun with."
                )

    def keep(self, kind: str, name: str, files: Mapping[str, bytes]) -> dict[str, str]:
        """Write `files` into the folder KIND/NAME, all or none; returns their fingerprints."""
        target = self.path(kind, name)
        former = [path.name for path in target.iterdir()] if target.is_dir() else []
        with replacing_set(target, former) as fresh:
            for file, content in files.items():
                (fresh / file).write_bytes(content)
                os.utime(fresh / file, (0, 0))
        os.utime(target, (0, 0))
        return {file: digest(content) for file, content in files.items()}

    def tidy(self) -> None:
        """Remove files that an interruption left unfinished."""
        for folder in (self.folder, *(path for path in self.folder.rglob("*") if path.is_dir())):
            remove_left(folder, WRITING)

    def files(self, kind: str, name: str, fingerprints: Mapping[str, str]) -> dict[str, bytes]:
        """The files of a folder. Raises `InputError` with the name of a missing or changed file."""
        found: dict[str, bytes] = {}
        for file, expected in fingerprints.items():
            path = self.path(kind, name, file)
            content = path.read_bytes() if path.is_file() else None
            if content is None or digest(content) != expected:
                what = "is missing" if content is None else "was changed after it was written"
                raise InputError(
                    f"{path} {what}: its fingerprint is not the recorded one, so this challenge proves "
                    "nothing any more; begin a new one with another --out."
                )
            found[file] = content
        return found


@contextmanager
def said(folder: Path) -> Iterator[None]:
    """Turn errors of the disk into `InputError`."""
    try:
        yield
    except OSError as error:
        raise InputError(
            f"cannot go on in {folder}: {error.strerror or error}. What is finished is kept: correct that "
            "and run the same command again."
        ) from None
