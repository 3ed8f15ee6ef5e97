"""Formulas of both engines at the same states; what a page of evidence shows, `make test` keeps true."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.cross_validation.faults.catalogue import FAULTS
from benchmarks.cross_validation.faults.seeding import Fault, caught, quick_subjects, seeded
from benchmarks.cross_validation.statics import (
    Subject,
    agreements,
    control_subjects,
    equation_subjects,
    friction_subjects,
)

pytestmark = pytest.mark.cross_validation

#: States of a subject in the quick tests.
FEW = 2


@pytest.mark.parametrize("subject", list(equation_subjects()), ids=lambda subject: subject.name)
def test_equations_of_motion_are_the_same(subject: Subject) -> None:
    for item in agreements(replace(subject, states=FEW), seed=2):
        assert item.holds, item


@pytest.mark.parametrize("subject", list(quick_subjects()), ids=lambda subject: subject.name)
def test_control_friction_and_loads_are_the_same(subject: Subject) -> None:
    for item in agreements(subject, seed=3):
        assert item.holds, item


@pytest.mark.proof
@pytest.mark.parametrize("subject", [*control_subjects(), *friction_subjects()], ids=lambda s: s.name)
def test_every_controller_and_law_is_the_same(subject: Subject) -> None:
    for item in agreements(subject, seed=4):
        assert item.holds, item


def test_without_a_fault_everything_holds() -> None:
    assert caught() is None


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.what)
def test_every_seeded_fault_is_seen(fault: Fault) -> None:
    """Some tenths of a second to three seconds each: most are seen by the first robot."""
    with seeded(fault):
        assert caught() is not None
