"""Schemas of the JSON files of a challenge; a file that violates its schema is reported with name and key."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

from missing_physics.challenge.cases.truth import Truth

__all__ = ["Answer", "Answers", "Made", "Opened", "Promise", "Scoring", "Sealed"]


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True)


class Promise(_Record):
    """challenge.json: fingerprints of the truth and of the program, written first."""

    truth_sha256: str
    program: str


class Made(_Record):
    """manifest/NAME.json: fingerprints of a case's files, or why it could not be generated."""

    status: Literal["done", "refused", "failed"]
    message: str = ""
    files: dict[str, str] = {}


class Sealed(_Record):
    """seal.json: fingerprints of all cases, and of each sealing of the truth."""

    cases_sha256: str
    sealed: tuple[str, ...] = ()


class Answer(_Record):
    """answers/NAME/answer.json: how a diagnosis ended, and the fingerprints of its files."""

    status: Literal["done", "refused", "failed"]
    message: str
    attempts: int
    seconds: float
    isolation: str
    files: dict[str, str]


class Answers(_Record):
    """answers.json: fingerprint of every answer."""

    answers: dict[str, str]


class Opened(_Record):
    """opened.json: the sealed truth and its key, published."""

    key: str
    sealed: str
    seed: int
    answers_sha256: str
    truth: Truth


class Scoring(_Record):
    """scoring.json: the program that scored, and the fingerprint of every score."""

    program: str
    scores: dict[str, str] = {}
