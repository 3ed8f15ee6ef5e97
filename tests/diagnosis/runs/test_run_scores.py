"""A hidden mode of little damping: its numbers, and the errors that are told, are those of runs."""

from __future__ import annotations

import numpy as np
import pytest
from end_to_end_cases import otherwise, shortened

from missing_physics.diagnosis import Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.runs.scores import NOTE
from missing_physics.results.result import Result
from reference_model.simulation import simulate
from robot_model import EffectUse, Robot

pytestmark = pytest.mark.proof

PERIOD, DAMPING = 0.07, 0.006


@pytest.fixture(scope="module")
def runs() -> list[Robot]:
    """Robots that were run in the diagnosis."""
    return []


@pytest.fixture(scope="module")
def found(runs: list[Robot]) -> Result:
    nominal = otherwise(shortened("two_link_arm", duration=8.0, rate=250.0), 2.0)
    sampled = nominal.controller.model_copy(update={"sample_time": 0.002})
    nominal = nominal.model_copy(update={"controller": sampled})
    mode = EffectUse(effect="link_flexibility", at="link1", period=PERIOD, damping_ratio=DAMPING)
    bending = nominal.with_effects(mode)
    recordings = [simulate(bending, seed=1), simulate(otherwise(bending), seed=2)]
    with pytest.MonkeyPatch.context() as patch:
        run = Replay.found
        patch.setattr(
            Replay, "found", lambda replay, robot, *of: runs.append(robot) or run(replay, robot, *of)
        )
        return diagnose(nominal, recordings[:1], recordings[1:], options=Options(experiments=False))


def test_its_numbers_are_those_of_runs(found: Result) -> None:
    """Along the recorded motion, the noise of which drives the mode, its damping comes out far too large."""
    assert found.diagnosis.verdict == "explained"
    [finding] = found.diagnosis.findings
    assert (finding.effect, finding.location) == ("link_flexibility", "link1")
    for name, true in (("period", PERIOD), ("damping_ratio", DAMPING)):
        low, high = finding.parameters[name].ci95
        assert low < true < high
    assert finding.parameters["damping_ratio"].value == pytest.approx(DAMPING, rel=0.3)


def test_nothing_is_looked_for_beside_it(found: Result, runs: list[Robot]) -> None:
    """Its numbers are fitted before: a search for what else may be there takes hundreds of runs."""
    assert found.diagnosis.verdict == "explained"
    assert len(runs) < 60


def test_errors_are_those_of_runs(found: Result) -> None:
    fit = found.diagnosis.fit
    assert NOTE in found.diagnosis.notes
    for channel in fit.channels.values():
        # the right law leaves the noise, rounding included, to what some 2000 samples tell of it
        assert channel.after.train_rms == pytest.approx(channel.noise_floor, rel=0.06)
        assert channel.after.validation_rms == pytest.approx(channel.noise_floor, rel=0.06)
        assert channel.before.validation_rms > 1.5 * channel.noise_floor
    assert not any("remain against" in sentence for sentence in found.diagnosis.could_not_tell)
    assert not found.diagnosis.unnamed


def test_what_is_shown_are_runs_of_both_robots(found: Result) -> None:
    shown = {(s.role, s.channel): s for s in found.series}
    assert len(shown) == len(found.series) == 4
    for (role, name), series in shown.items():
        error = found.diagnosis.fit.channels[name]
        before, after = (
            float(np.sqrt(np.mean((series.measured - model) ** 2)))
            for model in (series.nominal, series.augmented)
        )
        told = [getattr(e, f"{role}_rms") for e in (error.before, error.after)]
        assert [before, after] == pytest.approx(told, rel=1e-9)
        assert series.held_out.all() == (role == "validation")
        assert series.velocity is not None
        assert series.velocity.shape == series.time.shape
