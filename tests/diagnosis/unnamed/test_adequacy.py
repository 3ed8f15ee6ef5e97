"""Names are worth what they remove beside what a curve without a law foretells."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from extra_torque import diagnosed, recorded
from numpy.typing import NDArray

from missing_physics.diagnosis.calibration import TRUST
from missing_physics.diagnosis.statistics.folds import jackknife
from missing_physics.diagnosis.unnamed.adequacy import (
    HALF_BELIEVED,
    LEAST_BELIEF,
    Account,
    Accounts,
    _other,
    _words,
    believed,
)
from missing_physics.diagnosis.unnamed.coordinates import Coordinate
from missing_physics.diagnosis.unnamed.curves import Leftover
from missing_physics.results.result import Finding

Array = NDArray[np.float64]


def test_belief_falls_with_what_a_curve_predicts() -> None:
    belief = [Account(100.0, foretold).belief for foretold in (0.0, 1.0, 10.0, 100.0, 1e4)]
    assert belief == sorted(belief, reverse=True)
    assert belief[0] == 1.0
    assert belief[-1] < 0.01
    assert Account(HALF_BELIEVED, 1.0).belief == 0.5
    assert Account(100.0, 0.0, adequate=False).belief == 0.0


def test_what_no_curve_predicts_costs_no_name_its_probability() -> None:
    assert Leftover(0, left=500.0).foretold() == 0.0
    weak, clear = (Leftover(0, left=500.0, share=share).foretold() for share in (0.1, 0.8))
    assert weak < 0.05 * clear


def test_an_event_is_asked_where_it_was_fitted() -> None:
    leftover = Leftover(0, left=1.0, share=0.0, fitted_share=0.9, fitted_left=10.0)
    assert leftover.foretold() == 0.0
    assert leftover.foretold(where_fitted=True) > 10.0


def test_one_plain_curve_beside_a_name_suggests_another_force() -> None:
    """However little it is, if it is sure and next to noise alone is left beside it."""
    small = Leftover(0, left=1.3, share=0.2, sure=True)
    assert Account(30.0, small.foretold(), other=_other(small, 30.0)).belief < LEAST_BELIEF
    assert Account(30.0, small.foretold()).belief > 0.9
    # not where noise may make it, nor in a world of many forces or of next to no noise, nor where the law
    # leaves hardly any of the force
    for other in (
        _other(Leftover(0, left=1.3, share=0.2), 30.0),
        _other(Leftover(0, left=13.0, share=0.2, sure=True), 30.0),
        _other(Leftover(0, left=1.0, share=0.99, sure=True), 30.0),
        _other(small, 3e4),
        _other(Leftover(0, left=1.3, share=0.2, sure=True, again=True), 30.0),
    ):
        assert Account(30.0, small.foretold(), other=other).belief > 0.8


def test_a_name_near_the_noise_keeps_the_odds_of_physics_that_nobody_knows() -> None:
    """Nothing to be seen beside a name says little where little would be seen."""
    weights = [Account(removed, 0.0, visible=0.2).weight for removed in (0.2, 2.0, 20.0, 200.0)]
    assert weights == sorted(weights)
    assert weights[0] < 0.9
    assert weights[-1] == 1.0


def test_what_wants_a_number_that_cannot_be_is_no_name() -> None:
    assert Account(100.0, 0.0, end="its order has to be beyond 53, where it cannot be").belief == 0.0


def test_alternatives_are_believed_no_more_than_the_finding() -> None:
    finding = Finding("cable_spring", "joint1", 0.9, {})
    [lowered] = believed([finding], Accounts({("cable_spring", "joint1"): Account(30.0, 10.0)}, {}))
    assert lowered.probability == pytest.approx(0.45)
    assert believed([finding], Accounts({}, {})) == (finding,)


@pytest.mark.parametrize(
    ("adequate", "words"), [(True, "a curve without a law over"), (False, "removes less than it leaves")]
)
def test_what_a_gyro_leaves_is_no_joint(adequate: bool, words: str) -> None:
    """Outputs of a free base's gyro follow those of the joints; a name at a joint answers for its joint's."""
    joint, base = SimpleNamespace(channel="joint1.torque", place="joint1"), SimpleNamespace(place="base")
    base.channel = "base.angular_velocity.z"
    problem = SimpleNamespace(joints=("joint1",), outputs=(joint, base))
    term = SimpleNamespace(at="joint1", key=("cable_spring", "joint1"))
    own = Leftover(0, left=9.0, share=0.5, coordinate=Coordinate(0, ("joint1.velocity",), (), directed=False))
    told = Accounts({term.key: Account(1.0, 9.0, adequate)}, {0: own, 1: Leftover(1, left=500.0)})
    assert words in _words(SimpleNamespace(problem=problem), told, term)  # type: ignore[arg-type]


def test_interval_holds_the_number_as_often_as_it_says() -> None:
    """Errors that stay alike for a third of a group: the jackknife over groups is not fooled by them."""
    rng = np.random.default_rng(10290)
    groups, length, memory, trials = 8, 60, 20, 400
    inside = 0
    for _ in range(trials):
        x = rng.standard_normal((groups, length))
        x = np.repeat(x[:, ::memory], memory, axis=1)
        error = np.repeat(rng.standard_normal((groups, length // memory)), memory, axis=1)
        y = 2.0 * x + error
        without = [
            [np.sum(np.delete(x * y, k, axis=0)) / np.sum(np.delete(x**2, k, axis=0))] for k in range(groups)
        ]
        whole = np.sum(x * y) / np.sum(x**2)
        inside += abs(whole - 2.0) < jackknife(np.array(without))[0]
    # 95 % of 400 is 380 +- 4.4; three of those, and the jackknife's own lean towards width.
    assert 0.91 <= inside / trials <= 0.99


def test_one_group_alone_tells_no_interval() -> None:
    assert np.isinf(jackknife(np.ones((1, 3)))).all()


@pytest.mark.proof
def test_ripple_whose_phase_slips_is_not_called_ripple() -> None:
    """cos(k q + s t) is torque ripple for a while; its phase turns thrice during the recording."""
    found = diagnosed(lambda t, q, v: 9.0 * np.cos(650.0 * q + 2 * np.pi * 3 * t / 16.0))
    assert found.verdict == "unexplained"
    assert found.findings == ()
    assert "joint1" in {m.location for m in found.mismatch}


@pytest.mark.proof
def test_drag_is_not_called_friction_and_its_curve_is_measured() -> None:
    """|v| v is in no catalogue; the curve over velocity is told in its place."""
    found = diagnosed(lambda t, q, v: 4000.0 * np.abs(v) * v)
    assert found.verdict == "unexplained"
    assert found.findings == ()
    [more] = found.unnamed
    assert more.depends_on == ("joint1.velocity",)
    assert more.share > 0.9
    knots = np.array(more.knots[0])
    forward, backward = (np.array(curve.torque) for curve in more.curves)
    assert [curve.carrier for curve in more.curves] == ["forward", "backward"]
    truth = 4000.0 * np.abs(knots) * knots
    for curve, told in zip(more.curves, (knots > 0, knots < 0)):
        low, high = np.array(curve.ci95).T
        assert np.isfinite(high - low)[told].all()
        assert np.all((low < curve.torque)[told] & (curve.torque < high)[told])
        assert not np.isfinite(low[~told][np.abs(knots[~told]) > 0.02]).any()  # never at rest, never that way
    # what is linear in velocity may have gone into the nominal robot's own friction
    for curve, side in ((forward, knots > 0.02), (backward, knots < -0.02)):
        shape = np.column_stack([knots[side], np.ones(side.sum())])
        bend = [x - shape @ np.linalg.lstsq(shape, x, rcond=None)[0] for x in (curve[side], truth[side])]
        assert np.corrcoef(*bend)[0, 1] > 0.9


@pytest.mark.proof
def test_a_right_name_alone_is_believed_whole() -> None:
    found = diagnosed(lambda t, q, v: 30.0 * np.tanh(v / 1e-3))
    assert [finding.effect for finding in found.findings] == ["coulomb_friction"]
    assert found.findings[0].probability > 0.99 * TRUST
    assert found.unnamed == ()
    assert found.verdict == "explained"


@pytest.mark.proof
def test_a_spring_keeps_its_name_where_the_motion_reaches_further() -> None:
    found = diagnosed(lambda t, q, v: 900.0 * q, reach=(0.6, 1.0))
    assert [finding.effect for finding in found.findings] == ["cable_spring"]
    assert found.findings[0].probability > 0.9


@pytest.mark.proof
def test_a_stop_that_the_fitted_motion_hardly_touches_keeps_its_name() -> None:
    """Its numbers are rough and the other recording goes far beyond: that is no other law."""
    reach = (0.6, 1.0)
    _, fitted, other = recorded(reach)
    top = float(fitted["joint1.position"].max())
    touched = fitted["joint1.position"] > top - 3e-4
    # one contact, in less than a fiftieth of the time; the other motion goes ten times as deep
    assert np.ptp(np.flatnonzero(touched)) == touched.sum() - 1 < 0.02 * len(fitted)
    assert float(other["joint1.position"].max()) > top + 3e-3
    found = diagnosed(lambda t, q, v: 1e5 * np.maximum(q - top + 3e-4, 0.0), reach=reach)
    stop = next(f for f in found.findings if f.effect == "end_stop")
    low, high = stop.parameters["stiffness"].ci95 or (0.0, 0.0)
    assert low < 1e5 < high
    assert stop.probability > 0.5
