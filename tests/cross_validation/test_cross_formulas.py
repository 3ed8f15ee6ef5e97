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
#: Faults that only the last and largest robots show, after all others were built: these are proofs.
LATE = {
    "quaternion rates with the wrong sign",
    "sliding variable reached too fast",
    "network learns from the position error alone",
    "omega x v of the base's velocity in base axes left out",
    "masses that couple displacements with rotations left out",
    "voltage servo without the gear ratio",
    "a joint's frame does not turn with its bent link",
    "the full controller forgets the rates of bent links' modes",
    "a joint stays where the straight link has it",
    "shortening takes no part in Coriolis and centrifugal forces",
    "shortening by bending one per cent too large",
}


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


def test_late_faults_are_among_them() -> None:
    assert {fault.what for fault in FAULTS} >= LATE


@pytest.mark.parametrize(
    "fault",
    [pytest.param(f, id=f.what, marks=pytest.mark.proof if f.what in LATE else ()) for f in FAULTS],
)
def test_every_seeded_fault_is_seen(fault: Fault) -> None:
    """Most are seen by the first robot."""
    with seeded(fault):
        assert caught() is not None
