"""Formulas of both engines at the same states; `make test` checks the claims of the evidence page."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.cross_validation.faults.catalogue import FAULTS
from benchmarks.cross_validation.faults.seeding import Fault, caught, seeded
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
#: Similar to another robot of the quick tests and as slow to build: long tests only.
ALIKE = {"imported_lattice_free_free", "imported_frame_clamped_free", "imported_lattice_clamped_free"}
#: Faults detected only by the last and largest robots, or next to another fault of the same formula: long
#: tests only.
LATE = {
    "modal stiffness from frequencies in Hz",
    "gravity turns a bent link about its unbent centre of mass, as in Exudyn's own load",
    "rotary inertia of nodes kept constant in the link's axes",
    "forces of coupled motors reach the joints as their motion does",
    "rotors of coupled motors as if each moved one joint",
    "forces of coupled motors on the joints by the matrix of the other way",
    "products of inertia xz and yz exchanged",
    "gyroscopic moments of the bodies left out",
    "frequencies of a sine in rad/s for Hz",
    "LuGre's bristle rate with v z / g, without the bars of |v|",
    "parallel-axis term of the inertia left out",
    "dry friction changes sign over ten times the speed",
    "span of two bearings halved",
    "gains in N m per degree",
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


@pytest.mark.parametrize(
    "subject",
    [
        pytest.param(s, id=s.name, marks=pytest.mark.proof if s.name.split(";")[0] in ALIKE else ())
        for s in equation_subjects()
    ],
)
def test_engines_agree_on_equations_of_motion(subject: Subject) -> None:
    for item in agreements(replace(subject, states=FEW), seed=2):
        assert item.holds, item


@pytest.mark.proof
@pytest.mark.parametrize("subject", [*control_subjects(), *friction_subjects()], ids=lambda s: s.name)
def test_engines_agree_on_every_controller_and_law(subject: Subject) -> None:
    for item in agreements(subject, seed=4):
        assert item.holds, item


def test_without_a_fault_all_checks_pass() -> None:
    """Control, friction and loads of the quick robots, and a short motion."""
    assert caught() is None


def test_the_catalogue_contains_late_faults() -> None:
    assert {fault.what for fault in FAULTS} >= LATE


@pytest.mark.parametrize(
    "fault",
    [pytest.param(f, id=f.what, marks=pytest.mark.proof if f.what in LATE else ()) for f in FAULTS],
)
def test_every_seeded_fault_is_detected(fault: Fault) -> None:
    """Most are detected by the first robot."""
    with seeded(fault):
        assert caught() is not None
