"""The search on recordings with known parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from recorded_arm import (
    COULOMB,
    VISCOUS,
    Hidden,
    asymmetric,
    drag,
    nothing,
    push,
    recorded,
    spring,
    wave,
    weak_spring,
)
from scipy.stats import multivariate_normal

from missing_physics.answer.guard import guarded
from missing_physics.hypotheses import TIMING, Candidate, Hypothesis, Term
from missing_physics.inference import fitted, search, weighed
from missing_physics.inference.fit import Precision, residuals, variance_of_sum
from missing_physics.inference.ledger import prior, stated
from missing_physics.inference.score import block_scores, independent_shares
from missing_physics.inference.screening import Screen
from missing_physics.inference.torques.data import TorqueData
from missing_physics.standard import fit_standard
from reference_model.effects.catalogue import get_effect
from robot_model import Recording, Robot

Array = NDArray[np.float64]


def data_of(arm: Robot, hidden: Hidden, *, late: float = 0.0, unseen: Hidden | None = None) -> TorqueData:
    fit, held_out = recorded(hidden, seed=1, late=late), recorded(unseen or hidden, seed=2, late=late)
    return TorqueData.of(fit_standard(arm, [fit]), [fit], [held_out])


def linear(effect: str) -> Term:
    entry = get_effect(effect)
    return Term.of(entry, "joint", {p.name: 0.0 for p in entry.parameters})


@pytest.mark.parametrize(
    ("hidden", "effect", "numbers"),
    [
        (spring, "cable_spring", {"stiffness": 1.5}),
        (asymmetric, "asymmetric_friction", {"viscous_difference": 0.15}),
        (drag, "quadratic_drag", {"coefficient": 0.4}),
        (wave, "torque_ripple", {"order": 7.0, "cosine": -0.3, "sine": 0.2}),
    ],
)
def test_hidden_effect_is_named_with_its_parameters(
    arm: Robot, hidden: Hidden, effect: str, numbers: dict[str, float]
) -> None:
    known = weighed(search(data_of(arm, hidden)))
    assert known.probability((effect, "joint")) > 0.9
    best = known.fits[0]
    (term,) = [t for t in best.hypothesis.terms if t.effect.id == effect]
    for name, value in numbers.items():
        spread = best.deviation(f"{effect}@joint.{name}")
        # Four standard deviations, and a part in a hundred: the band's filter and the sign at a reversal.
        assert term.parameters[name] == pytest.approx(value, abs=4.0 * spread + 0.01 * abs(value))


def test_no_effect_is_named_if_nothing_is_hidden(arm: Robot) -> None:
    known = weighed(search(data_of(arm, nothing)))
    assert known.fits[0].hypothesis.terms == ()
    empty = [not fit.hypothesis.terms for fit in known.fits]
    assert known.weights[empty].sum() > 0.9


@pytest.mark.parametrize("late", [4e-3, 40e-3])  # 0.8 and 8 samples
def test_delayed_torque_is_explained_by_timing_and_not_by_an_effect(arm: Robot, late: float) -> None:
    """A long delay too: the fastest motion turns by 9 degrees in it, of which a line misses 1 %."""
    best = weighed(search(data_of(arm, nothing, late=late))).fits[0]
    assert best.hypothesis.terms == ()
    assert best.parameter("timing") == pytest.approx(late, abs=4e-4)
    assert best.sigma[0] < 0.01  # the noise of a sample, in a band that holds a part of it


@pytest.mark.parametrize("start", [6.0, 9.0])  # inside of a fold, and across the border between two
def test_external_push_is_found_in_the_recording_that_contains_it(arm: Robot, start: float) -> None:
    known = weighed(search(data_of(arm, push(start), unseen=nothing)))
    assert known.probability(("external_torque", "joint")) > 0.9
    (term,) = [t for t in known.answer.hypothesis.terms if t.effect.id == "external_torque"]
    assert term.run == 0
    assert term.parameters["start"] == pytest.approx(start, abs=0.05)  # a row of the band is 0.1 s
    assert term.parameters["duration"] == pytest.approx(1.0, abs=0.05)


def test_held_out_prediction_of_a_fold_equals_a_fit_without_it(arm: Robot) -> None:
    """One Newton step is exact where everything is linear, up to the priors' curvature."""
    data = data_of(arm, spring)
    whole = fitted(data, Hypothesis((linear("cable_spring"),)))
    without = tuple(replace(b, fold=-1) if b.fold == 2 else b for b in data.blocks)
    again = fitted(replace(data, blocks=without), whole.hypothesis)
    left_out = data.fold == 2
    assert whole.errors[left_out] == pytest.approx(again.errors[left_out], rel=0.02)


def test_errors_are_those_of_the_stated_parameters_also_at_a_bound(arm: Robot) -> None:
    """Dry friction would have to be negative at speed, which no friction is."""

    def driving(time: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        return -(COULOMB + 0.3) * np.sign(velocity) * (1.0 - np.exp(-((velocity / 0.4) ** 2)))

    data = data_of(arm, driving)
    start = {"coulomb_torque": COULOMB, "static_torque": COULOMB + 0.1, "stribeck_velocity": 0.4}
    law = Term.of(get_effect("stribeck_friction"), "joint", start)
    fit = fitted(data, Candidate(law, (("joint.coulomb", 0.0),)).added_to(Hypothesis()))
    [found] = fit.hypothesis.terms
    assert found.parameters["coulomb_torque"] == 0.0
    assert found.parameters["static_torque"] > 0.1
    left = residuals(data, fit, 1)
    stated = fit.errors[~data.fitted_blocks]
    again = [np.sum(left[block.rows] ** 2, axis=0) for block in data.blocks if block.run == 1]
    np.testing.assert_allclose(stated, again, rtol=1e-6)  # the law is linear in what the last step moved


def test_parameter_that_the_rows_do_not_determine_has_no_narrow_interval(arm: Robot) -> None:
    """Stribeck friction so slow that no row shows it: its speed may be any below them."""
    data = data_of(arm, nothing)
    start = {"coulomb_torque": COULOMB, "static_torque": 1.5 * COULOMB, "stribeck_velocity": 1e-4}
    law = Term.of(get_effect("stribeck_friction"), "joint", start)
    fit = fitted(data, Candidate(law, (("joint.coulomb", 0.0),)).added_to(Hypothesis()))
    assert fit.deviation("stribeck_friction@joint.stribeck_velocity") > 100.0 * start["stribeck_velocity"]
    assert fit.deviation("stribeck_friction@joint.coulomb_torque") < 0.1 * COULOMB


def test_uncertainty_of_a_shape_parameter_is_at_most_its_range(arm: Robot) -> None:
    """A push of zero torque could have any duration that the recording has room for."""
    start, longest = {"torque": 0.0, "start": 6.0, "duration": 0.02}, 1.0
    term = Term.of(get_effect("external_torque"), "joint", start, run=0, limits={"duration": (1e-4, longest)})
    fit = fitted(data_of(arm, nothing), Hypothesis((term,)))
    assert fit.deviation("external_torque@joint.duration") <= longest


def test_shape_parameters_of_other_joints_stay_fixed_until_the_fit_is_completed(arm: Robot) -> None:
    data, ripple = data_of(arm, wave), get_effect("torque_ripple")
    term = Term.of(ripple, "joint", {**{p.name: 0.0 for p in ripple.parameters}, "order": 6.8})
    partial = fitted(data, Hypothesis((term,)), place="another joint")
    assert partial.partial
    assert partial.hypothesis.terms[0].parameters["order"] == 6.8
    assert partial.hypothesis.terms[0].parameters["cosine"] != 0.0
    whole = fitted(data, partial.hypothesis, partial)
    assert not whole.partial
    assert whole.hypothesis.terms[0].parameters["order"] == pytest.approx(7.0, abs=0.02)
    alone = fitted(data, Hypothesis((term,)))
    assert np.allclose(whole.errors, alone.errors, rtol=1e-3)  # where Gauss-Newton ends


def test_ripple_is_penalised_for_the_number_of_possible_orders(arm: Robot) -> None:
    """As many as cycles at the end of the band pass over the travel."""
    data, ripple = data_of(arm, wave), get_effect("torque_ripple")
    term = Term.of(ripple, "joint", {**{p.name: 0.0 for p in ripple.parameters}, "order": 7.0})
    in_time = Hypothesis().taking_from_file(TIMING, f"joint.{TIMING}")
    with_wave, with_spring = (
        fitted(data, replace(in_time, terms=(own,))) for own in (term, linear("cable_spring"))
    )
    motion = data.runs[0].motion
    cycles = motion.cutoff * np.ptp(motion.position) / np.median(np.abs(motion.velocity))
    paid = prior(data, with_spring, np.ones(1)) - prior(data, with_wave, np.ones(1))
    assert paid == pytest.approx(np.log(cycles))


def test_predicted_gain_of_a_screened_term_equals_that_of_the_fit(arm: Robot) -> None:
    """Where the effect is small beside what is left: the screen keeps other numbers at the whole fit's."""
    data = data_of(arm, weak_spring)
    standard = fitted(data, Hypothesis())
    shares = np.ones(1)
    promised = Screen(data, standard, shares).gain(Candidate(linear("cable_spring")))
    after = fitted(data, Hypothesis((linear("cable_spring"),)), standard)
    brought = np.sum([block_scores(data, after, shares), -block_scores(data, standard, shares)])
    assert promised > 5.0
    assert promised == pytest.approx(0.5 * brought, rel=0.5)  # of two recordings one is screened


def test_estimates_do_not_depend_on_the_unit_of_torque(arm: Robot) -> None:
    """A robot a thousand times as strong and heavy has the same effect a thousand times as large."""
    found = []
    for factor in (1.0, 1000.0):
        link = arm.links[0]
        heavy = link.model_copy(
            update={"mass": factor * link.mass, "inertia": tuple(factor * i for i in link.inertia)}
        )
        robot = arm.model_copy(
            update={
                "links": (heavy,),
                "sensors": tuple(
                    s.model_copy(update={"noise": s.noise * factor}) if "torque" in s.channel else s
                    for s in arm.sensors
                ),
            }
        )
        runs = []
        for seed in (1, 2):
            run = recorded(spring, seed=seed)
            channels = {**run.channels, "joint.torque": factor * run["joint.torque"]}
            runs.append(Recording(run.time, channels, source=run.source))
        data = TorqueData.of(fit_standard(robot, runs[:1]), runs[:1], runs[1:])
        fit = fitted(data, Hypothesis((linear("cable_spring"),)))
        found.append(fit.hypothesis.terms[0].parameters["stiffness"] / factor)
        assert fit.parameter("joint.coulomb") / factor == pytest.approx(COULOMB, rel=0.05)
    assert found[0] == pytest.approx(found[1], rel=1e-3)


def test_effective_sample_size_of_a_first_order_process_is_correct(arm: Robot) -> None:
    """An AR(1) process of correlation r has (1 - r) / (1 + r) independent samples each."""
    data = data_of(arm, nothing)
    fit, rows = fitted(data, Hypothesis()), data.runs[0].rows
    random, r = np.random.default_rng(3), 0.6
    found = []
    for _ in range(40):
        left = np.zeros(rows.time.size)
        for t in range(1, left.size):
            left[t] = r * left[t - 1] + random.normal()
        design = data.designs[0] @ fit.parameters
        whole = replace(rows, counted=np.ones_like(rows.counted))
        run = replace(data.runs[0], rows=whole, torque=design + left[:, None])
        found.append(independent_shares(replace(data, runs=(run, data.runs[1])), fit)[0])
    # Forty series of some hundred samples: the mean scatters by a tenth, and is biased upwards by as much.
    assert np.mean(found) == pytest.approx((1.0 - r) / (1.0 + r), rel=0.25)


def test_file_parameters_are_those_of_the_fit_including_the_event(arm: Robot) -> None:
    """A file holds no push that happened once; its friction is not what makes up for one either."""
    data = data_of(arm, push(9.0), unseen=nothing)
    found = search(data)
    best = weighed(found).answer
    assert {term.effect.id for term in best.hypothesis.terms} == {"external_torque"}
    file = guarded(found.data, best, found.standard).file
    assert file.parameter("joint.viscous") == pytest.approx(best.parameter("joint.viscous"), rel=1e-9)
    assert file.parameter("joint.coulomb") == pytest.approx(COULOMB, abs=0.01)


def test_a_stop_reached_once_is_named_and_not_a_push(arm: Robot) -> None:
    """Both explain it; a push could have begun at any time and lasted any time, a stop has a place only."""
    highest = float(recorded(nothing, seed=1)["joint.position"].max())

    def stopped(time: Array, position: Array, velocity: Array) -> Array:
        return 40.0 * np.maximum(position - 0.97 * highest, 0.0)

    known = weighed(search(data_of(arm, stopped, unseen=nothing)))
    assert known.probability(("end_stop", "joint")) > 0.5
    assert known.probability(("external_torque", "joint")) < 0.5


def test_price_of_a_parameter_is_the_evidence_that_its_prior_loses() -> None:
    """For one linear parameter with a Gaussian prior the evidence is a Gaussian with a known covariance."""
    random = np.random.default_rng(3)
    column, sigma, width, share = random.normal(size=40), 0.7, 2.5, 0.4
    rows = random.normal(size=40)
    information = share * column @ column / sigma**2
    estimate = share * column @ rows / sigma**2 / (information + width**-2)
    after = share * np.sum((rows - estimate * column) ** 2) / sigma**2 + (estimate / width) ** 2
    before = share * np.sum(rows**2) / sigma**2
    precision = Precision(np.array([[column @ column / sigma**2 * width**2]]), np.array([1.0]))
    gained = 0.5 * (before - after) - precision.price(np.array([share]))
    noise = sigma**2 / share * np.eye(40)
    exact = [
        multivariate_normal(np.zeros(40), noise + spread * np.outer(column, column)).logpdf(rows)
        for spread in (width**2, 0.0)
    ]
    assert gained == pytest.approx(exact[0] - exact[1], abs=1e-9)


def test_hypotheses_that_state_the_same_count_once(arm: Robot) -> None:
    """A rotor that no file states and the delay of all torques may be estimated or not, at no price."""
    found = search(data_of(arm, spring))
    known = weighed(found)
    said = [
        (frozenset(term.key for term in fit.hypothesis.terms), stated(found.data, fit.hypothesis))
        for fit in known.fits
        if all(term.run is None and not term.along for term in fit.hypothesis.terms)
    ]
    assert len(set(said)) == len(said) < len(found.fits)


def test_rotor_inertia_missing_in_the_file_is_not_penalised(arm: Robot) -> None:
    data = data_of(arm, nothing)
    free = fitted(data, Hypothesis())
    held = fitted(data, Hypothesis().taking_from_file("joint.reflected_inertia"))
    assert prior(data, free, np.ones(1)) == pytest.approx(prior(data, held, np.ones(1)))


@pytest.mark.parametrize(("kept", "tolerance"), [(0.0, 0.05), (0.5, 0.3)])
def test_variance_of_a_sum_of_correlated_blocks_is_estimated(kept: float, tolerance: float) -> None:
    """Blocks of three recordings, of each of which a fraction passes on to the next one."""
    random = np.random.default_rng(5)
    blocks = random.standard_normal((3, 40, 4000))
    for b in range(1, 40):
        blocks[:, b] = kept * blocks[:, b - 1] + np.sqrt(1.0 - kept**2) * blocks[:, b]
    flat, runs = blocks.reshape(120, -1), np.repeat(np.arange(3), 40).tolist()
    true, found = np.var(flat.sum(axis=0)), np.mean(variance_of_sum(flat, runs))
    assert found == pytest.approx(true, rel=tolerance)
    assert found <= 1.05 * true


def test_friction_of_zero_is_as_uncertain_as_any_other(arm: Robot) -> None:
    """The torque that drives the joint a little would have to be negative viscous friction."""

    def driving(time: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        return -(VISCOUS + 0.002) * velocity

    at_bound, inside = (fitted(data_of(arm, hidden), Hypothesis()) for hidden in (driving, nothing))
    assert at_bound.parameter("joint.viscous") < 1e-3
    assert at_bound.deviation("joint.viscous") > 0.5 * inside.deviation("joint.viscous")
