"""An effect that was named first and then gave way: told, or put back where unseen data ask for it."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_cases import AXIS, bare, recorded
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson

from missing_physics.diagnosis import Diagnosis, Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.least_squares.explanation import View, explain
from missing_physics.diagnosis.naming.replaced import Contest, contests_of, settled, with_history
from missing_physics.diagnosis.preparation.proof import HeldOut, held_out_blocks
from missing_physics.diagnosis.preparation.setup import build_problem, inertial_basis, make_segments
from missing_physics.diagnosis.terms.term import Term
from missing_physics.results.result import Alternative, Finding
from reference_model.effects.catalogue import get_effect

Array = NDArray[np.float64]
ROBOT = bare("single_axis", noise=True)
COULOMB, VISCOUS, OFFSET, DIFFERENCE = 20.0, 200.0, 3.2, -40.0
QUICK = Options(experiments=False, simulation=False)


def named(extra: Array | float) -> Diagnosis:
    """Diagnosis of friction and `extra`, a function of the velocity."""

    def torque(t: Array, q: Array, v: Array, a: Array) -> Array:
        return COULOMB * np.sign(v) + VISCOUS * v + extra(v)  # type: ignore[operator]

    made = [recorded(ROBOT, AXIS, torque, duration=16.0, seed=seed, start=4.0 * seed) for seed in (1, 2)]
    return diagnose(ROBOT, made[:1], made[1:], options=QUICK).diagnosis


@pytest.mark.proof
def test_an_offset_is_named_as_an_offset() -> None:
    # On a sliding axis a tilted gravity is the same constant force, and so is a torque sensor's zero error:
    # of equals what acts at the joint leads, whatever rounding says.
    findings = named(lambda v: -OFFSET + 0 * v).findings  # type: ignore[arg-type]
    assert "asymmetric_friction" not in {f.effect for f in findings}
    [constant] = [f for f in findings if f.effect in ("torque_offset", "gravity", "sensor_offset")]
    assert constant.effect == "torque_offset"
    assert set(constant.ambiguous_with) >= {"gravity@base", "sensor_offset@joint1.torque"}
    assert abs(constant.parameters["torque"].value) == pytest.approx(OFFSET, rel=0.05)


def test_direction_dependent_friction_is_named_and_tells_what_it_replaced() -> None:
    diagnosis = named(lambda v: DIFFERENCE * np.abs(v))  # type: ignore[arg-type]
    found = {f.effect: f for f in diagnosis.findings}
    assert "torque_offset" not in found
    finding = found["asymmetric_friction"]
    assert finding.parameters["viscous_difference"].value == pytest.approx(DIFFERENCE, rel=0.1)
    if any("torque_offset@joint1" in stage.effects for stage in diagnosis.stages):
        rival = next(a for a in finding.alternatives if a.effect == "torque_offset")
        assert rival.probability < 0.05
        assert "named first" in rival.why_not
        assert "held-out error" in rival.why_not


@pytest.mark.proof
def test_one_effect_with_two_numbers_is_not_reported_as_two_effects() -> None:
    """The offset comes first; what comes later can say the same by a number that it did without."""
    diagnosis = named(lambda v: OFFSET * np.abs(np.tanh(v / 1e-3)) - DIFFERENCE * np.abs(v))  # type: ignore[arg-type]
    found = {f.effect: f for f in diagnosis.findings}
    assert not {"torque_offset", "gravity", "cable_spring"} & set(found)
    values = found["asymmetric_friction"].parameters
    assert values["coulomb_difference"].value == pytest.approx(OFFSET, rel=0.1)
    assert values["viscous_difference"].value == pytest.approx(-DIFFERENCE, rel=0.1)


class Shuttle:
    """To and fro at a constant speed [m/s], with soft turns."""

    speed, frequency, softness = 0.08, 0.25, 40.0

    def __call__(self, time: Array) -> tuple[Array, Array, Array]:
        fine = np.linspace(0.0, float(time[-1]), 20 * time.size)
        w, k = 2 * np.pi * self.frequency, self.softness
        travelled = cumulative_simpson(np.tanh(k * np.sin(w * fine)), x=fine, initial=0.0)
        turn = np.tanh(k * np.sin(w * time))
        rate = (1 - turn**2) * k * w * np.cos(w * time)
        return self.speed * np.interp(time, fine, travelled), self.speed * turn, self.speed * rate


def test_what_cannot_be_distinguished_stays_as_it_was_named_and_is_ambiguous() -> None:
    # At one speed an offset and friction that differs by direction are the same force, at 0.08 m/s 3.2 N.
    def torque(t: Array, q: Array, v: Array, a: Array) -> Array:
        return COULOMB * np.sign(v) + VISCOUS * v - OFFSET

    made = recorded(ROBOT, [Shuttle()], torque, duration=24.0, seed=1)  # type: ignore[list-item]
    segments = make_segments(ROBOT, [made])
    problem = build_problem(segments, inertial_basis(ROBOT, segments))
    held = held_out_blocks(problem)
    view = View(np.maximum(problem.noise_floor, 1e-3), ~held, prior=1.0)
    unseen = HeldOut(problem, held, view.scale)
    dry = Term(get_effect("coulomb_friction"), "joint1", {"torque": 1.0})
    offset = Term(get_effect("torque_offset"), "joint1", {"torque": 1.0})
    parameters = {"coulomb_difference": 0.0, "viscous_difference": 0.0}
    uneven = Term(get_effect("asymmetric_friction"), "joint1", parameters, unseen=("coulomb_difference",))
    first, last = (explain(problem, view, [dry, term]) for term in (offset, uneven))
    best, kept = settled(problem, view, last, [first, last], unseen, nuisance=True)
    assert [t.effect.id for t in best.found] == ["coulomb_friction", "torque_offset"]
    [contest] = kept
    assert contest.earlier_stays
    assert contest.p_value > 0.05
    [told] = with_history([Finding("torque_offset", "joint1", 1.0, {})], kept)
    assert told.ambiguous_with == ("asymmetric_friction@joint1",)
    assert told.probability == 0.5
    rival = Alternative("gravity", "base", 0.3, "cannot be told apart with these data")
    [told] = with_history([Finding("torque_offset", "joint1", 0.7, {}, alternatives=(rival,))], kept)
    chances = {a.effect: a.probability for a in told.alternatives} | {told.effect: told.probability}
    assert sum(chances.values()) == pytest.approx(1.0)
    assert chances["torque_offset"] == chances["asymmetric_friction"] == pytest.approx(0.5 / 1.3)
    assert contests_of(problem, view, best, [first, last], unseen, nuisance=True) == ()


def test_a_clear_winner_keeps_its_place() -> None:
    def torque(t: Array, q: Array, v: Array, a: Array) -> Array:
        return COULOMB * np.sign(v) + VISCOUS * v + DIFFERENCE * np.abs(v)

    made = recorded(ROBOT, AXIS, torque, duration=24.0, seed=1)
    segments = make_segments(ROBOT, [made])
    problem = build_problem(segments, inertial_basis(ROBOT, segments))
    held = held_out_blocks(problem)
    view = View(np.maximum(problem.noise_floor, 1e-3), ~held, prior=1.0)
    unseen = HeldOut(problem, held, view.scale)
    friction = [
        Term(get_effect("coulomb_friction"), "joint1", {"torque": 1.0}),
        Term(get_effect("viscous_friction"), "joint1", {"coefficient": 1.0}),
    ]
    offset = Term(get_effect("torque_offset"), "joint1", {"torque": 1.0})
    parameters = {"coulomb_difference": 0.0, "viscous_difference": 0.0}
    uneven = Term(get_effect("asymmetric_friction"), "joint1", parameters)
    first, last = (explain(problem, view, [*friction, term]) for term in (offset, uneven))
    best, kept = settled(problem, view, last, [first, last], unseen, nuisance=True)
    assert best is last
    assert kept == ()
    [contest] = contests_of(problem, view, best, [first, last], unseen, nuisance=True)
    assert isinstance(contest, Contest)
    assert contest.p_value < 0.05
    [told] = with_history([Finding("asymmetric_friction", "joint1", 1.0, {})], (contest,))
    assert told.alternatives[0].effect == "torque_offset"
    assert told.ambiguous_with == ()
