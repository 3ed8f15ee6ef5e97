"""What is missing from base and flexible links, named by runs in closed loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from floating_cases import flyer
from scipy import stats

from missing_physics.diagnosis import Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.passive.runs import named_in_runs
from missing_physics.diagnosis.passive.search import plain_starts
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.runs.fit import RunFit, errors_of, fit_in_runs
from missing_physics.diagnosis.terms.term import Term
from missing_physics.results.result import Diagnosis
from reference_model.effects.catalogue import get_effect
from reference_model.simulation import simulate
from robot_model import Cycloid, EffectUse, Recording, Reference, Robot, load_robot, robot_from_toml

PLANAR = load_robot("flexible_space_robot_planar").model_copy(update={"effects": ()})
#: Slews of both joints [rad] in the fitted and in the held-out recording.
WAYS = (1.5, 0.5), (-0.5, -1.5)


def slewing(one: float, other: float, seconds: float = 4.0) -> Robot:
    joints = tuple(
        Cycloid(joint=f"joint{k + 1}", displacement=way, start=0.3, duration=seconds - 1.0)
        for k, way in enumerate((one, other))
    )
    reference = Reference(duration=seconds, sample_rate=200.0, joints=joints)
    return PLANAR.model_copy(update={"reference": reference})


def use(effect: str, at: str, **values: float) -> EffectUse:
    return EffectUse.model_validate({"effect": effect, "at": at, **values})


def recorded(*uses: EffectUse) -> list[Recording]:
    return [simulate(slewing(*ways).with_effects(*uses), seed=12400 + k) for k, ways in enumerate(WAYS)]


@pytest.mark.proof
@pytest.mark.parametrize(
    "hidden",
    [
        use("centrifugal_stiffening", "link2", strength=1.0),
        use("modal_damping", "link2", damping_ratio=0.004),
        use("reaction_wheel", "base", momentum_z=3.0, torque_z=0.05),
        use("payload", "link2", mass=4.0, x=6.0),
    ],
    ids=lambda hidden: hidden.effect,
)
def test_what_alone_brings_runs_down_to_the_noise_is_named_with_its_numbers(hidden: EffectUse) -> None:
    described = slewing(*WAYS[0])
    recordings = recorded(hidden)
    replay = Replay.of(described, recordings[:1], recordings[1:])
    assert replay is not None
    named, ladder = named_in_runs(replay, tuple(plain_starts(described)), lambda phrase: None)
    assert named is not None
    assert named.term.key == (hidden.effect, hidden.at)
    assert [rung.effect for rung in ladder if rung.kept] == [hidden.effect]
    assert named.gain > 0.5
    for name in named.term.free:
        low, high = named.intervals[name]
        middle, half = (low + high) / 2, (high - low) / 2
        # three standard deviations: seeds are not chosen
        assert abs(hidden.parameters.get(name, 0.0) - middle) <= 1.5 * half, name
    if hidden.effect == "reaction_wheel":  # the base turns about z only
        assert "momentum_z" not in named.term.free


@pytest.mark.proof
def test_what_acts_at_a_joint_is_none_of_it() -> None:
    described = slewing(*WAYS[0])
    recordings = recorded(use("coulomb_friction", "joint2", torque=0.5))
    replay = Replay.of(described, recordings[:1], recordings[1:])
    assert replay is not None
    named, ladder = named_in_runs(replay, tuple(plain_starts(described)), lambda phrase: None)
    assert named is None
    assert ladder
    assert not any(rung.kept for rung in ladder)


def test_nothing_is_run_where_nothing_differs_or_nothing_is_held_out() -> None:
    described = slewing(*WAYS[0])
    said: list[str] = []
    starts = tuple(plain_starts(described))
    nothing, missing = recorded(), recorded(use("modal_damping", "link2", damping_ratio=0.01))
    for replay in (Replay.of(described, nothing[:1], nothing[1:]), Replay.of(described, missing)):
        assert replay is not None
        assert named_in_runs(replay, starts, said.append) == (None, [])
    assert not said


def test_beams_that_the_file_stiffens_and_links_that_are_known_are_not_asked() -> None:
    robot = slewing(*WAYS[0])
    assert {t.key for t in plain_starts(robot)} == {
        ("centrifugal_stiffening", "link2"),
        ("modal_damping", "link2"),
        ("payload", "link2"),
        ("reaction_wheel", "base"),
    }
    link = robot.link("link2")
    assert link.beam is not None
    stiff = link.model_copy(update={"beam": link.beam.model_copy(update={"stiffening": True})})
    links = tuple(stiff if other.name == "link2" else other for other in robot.links)
    changed = robot.model_copy(update={"links": links})
    assert "centrifugal_stiffening" not in {t.effect.id for t in plain_starts(changed)}
    known = robot.model_copy(update={"known": ("link2",)})
    assert {t.key for t in plain_starts(known)} == {("reaction_wheel", "base")}


@pytest.mark.proof
def test_a_diagnosis_says_so_and_its_robot_does_what_was_recorded() -> None:
    hidden = use("centrifugal_stiffening", "link2", strength=1.0)
    recordings = recorded(hidden)
    described = slewing(*WAYS[0])
    result = diagnose(described, recordings[:1], recordings[1:], options=Options(experiments=False))
    (named,) = result.diagnosis.findings
    assert (named.effect, named.location) == (hidden.effect, hidden.at)
    assert result.diagnosis.verdict == "explained"
    assert result.diagnosis.fit.validation_improvement > 0.5
    replay = Replay.of(described, recordings[:1], recordings[1:])
    assert replay is not None
    energies = replay.energies(robot_from_toml(result.augmented_robot_toml), 1)
    assert energies is not None
    # The number errs by a hundredth, of an effect of some fifty times the noise's energy.
    assert energies.max() < 1.5


def lines(slope: float, offset: float, *, fails: bool = False, common: float = 0.0) -> Any:
    """A replay of two channels that are lines in the stiffness of a spring, with a noise of one.

    `common` is an error of both in each of ten blocks of time.
    """
    chance = np.random.default_rng(5)
    noise, time = chance.normal(size=(2, 400)), np.linspace(0.0, 1.0, 400)
    noise += common * np.repeat(chance.normal(size=10), 40)

    def errors(robot: Any, which: int, *, keep: bool = True) -> dict[str, np.ndarray] | None:
        left = noise + (offset - slope * robot) * time
        return None if fails else {"joint1.position": left[0], "joint1.torque": left[1]}

    asked = SimpleNamespace(recording=time)
    return SimpleNamespace(
        fitted=1, made=0, asked=(asked,), channels=("joint1.position", "joint1.torque"), errors=errors
    )


def spring(**more: Any) -> Term:
    numbers = {"stiffness": 1.0, "torque_at_zero": 0.0}
    return Term(get_effect("cable_spring"), "joint1", numbers, unseen=("torque_at_zero",), **more)


def stiffness(terms: Sequence[Term]) -> Robot:
    return cast(Robot, terms[0].parameters["stiffness"])


def fitted(replay: Any, start: Term) -> RunFit:
    without = errors_of(replay, cast(Robot, 0.0))
    assert without is not None
    fit = fit_in_runs(replay, [start], stiffness, without)
    assert fit is not None
    return fit


def test_steps_reach_the_number_that_leaves_the_noise() -> None:
    fit = fitted(lines(2.0, 100.0), spring())
    assert abs(fit.terms[0].parameters["stiffness"] - 50.0) < 3 * fit.spread[0]
    # of white noise; or of ten blocks, whose deviation errs by a quarter, and of which 15 % are added
    assert 1.0 <= fit.spread[0] / (np.sqrt(3 / 800) / 2) < 2.0


def test_numbers_of_very_different_sizes_are_found_together() -> None:
    """A delay of milliseconds beside a stiffness of 1e4: columns of 1e5 and of 1e-4."""
    time, noise = np.linspace(0.0, 1.0, 400), np.random.default_rng(6).normal(size=(2, 400))

    def errors(robot: Any, which: int, *, keep: bool = True) -> dict[str, np.ndarray]:
        delay, stiff = robot
        left = noise + 1e5 * (3e-3 - delay) * time + 1e-3 * (5e4 - stiff) * (1 - time)
        return {"joint1.position": left[0], "joint1.torque": left[1]}

    asked = SimpleNamespace(recording=time)
    replay: Any = SimpleNamespace(
        fitted=1, made=0, asked=(asked,), channels=("joint1.position", "joint1.torque"), errors=errors
    )
    late = Term(get_effect("sensor_delay"), "joint1.position", {"delay": 1e-3})
    stiff = replace(spring(), parameters={"stiffness": 1e4, "torque_at_zero": 0.0})

    def with_them(terms: Sequence[Term]) -> Robot:
        return cast(Robot, (terms[0].parameters["delay"], terms[1].parameters["stiffness"]))

    without = errors_of(replay, cast(Robot, (0.0, 0.0)))
    assert without is not None
    fit = fit_in_runs(replay, [late, stiff], with_them, without)
    assert fit is not None
    assert np.all(np.abs(fit.values - [3e-3, 5e4]) < 4 * fit.spread)
    assert np.all(fit.spread < [1e-5, 1e3])


def test_what_both_channels_err_by_at_once_widens_the_interval() -> None:
    """Ten blocks of the same error in both: as much as ten numbers tell, not twenty."""
    fit = fitted(lines(2.0, 100.0, common=5.0), spring())
    time = np.linspace(0.0, 1.0, 400)
    weights = time.reshape(10, 40).sum(axis=1)
    true = 5.0 * np.linalg.norm(weights) / (time @ time) / 2.0
    energy = (time**2).reshape(10, 40).sum(axis=1)
    few = stats.t.ppf(0.975, energy.sum() ** 2 / (energy @ energy) - 1.0) / 1.96
    assert fit.spread[0] == pytest.approx(few * true, rel=0.5)  # a scatter of ten is known to a quarter


def test_numbers_that_runs_do_not_tell_are_said_to_be_untold() -> None:
    for replay, start in (
        (lines(1e-9, 100.0), spring()),  # it does nothing
        (lines(2.0, 100.0), spring(narrowed={"stiffness": (1.0, 1.0)})),  # it cannot move
    ):
        fit = fitted(replay, start)
        assert not fit.told[0]
        assert np.isinf(fit.spread[0])
        assert fit.terms[0].parameters["stiffness"] == 1.0


def test_what_cannot_be_run_has_no_fit() -> None:
    without = errors_of(lines(2.0, 100.0), cast(Robot, 0.0))
    assert without is not None
    assert fit_in_runs(lines(2.0, 100.0, fails=True), [spring()], stiffness, without) is None
    assert fit_in_runs(lines(2.0, 100.0), [spring()], lambda terms: None, without) is None


def seen_by_joints(robot: Robot) -> Robot:
    """With sensors of joints only."""
    joints = tuple(s for s in robot.sensors if s.channel.startswith("joint"))
    return robot.model_copy(update={"sensors": joints})


def diagnosed(described: Sequence[Robot], hidden: EffectUse, *, joints_only: bool = True) -> Diagnosis:
    """Of a fitted and a held-out recording of robots that lack an effect."""
    robots = [seen_by_joints(robot) if joints_only else robot for robot in described]
    made = [simulate(r.with_effects(hidden), seed=12500 + k) for k, r in enumerate(robots)]
    if joints_only:
        seen = [{c: v for c, v in run.channels.items() if c.startswith("joint")} for run in made]
        made = [Recording(run.time, channels) for run, channels in zip(made, seen)]
    one, other = made
    return diagnose(robots[0], [one], [other], options=Options(experiments=False)).diagnosis


@pytest.mark.parametrize(
    "hidden",
    [
        use("payload", "link2", mass=4.0, x=6.0),
        use("modal_damping", "link2", damping_ratio=0.02),
        use("reaction_wheel", "base", momentum_z=6.0, torque_z=0.1),
    ],
    ids=lambda hidden: hidden.effect,
)
@pytest.mark.proof
def test_encoders_and_torques_alone_tell_of_base_and_links_in_runs(hidden: EffectUse) -> None:
    told = diagnosed([slewing(*ways) for ways in WAYS], hidden)
    (named,) = told.findings
    assert (told.verdict, named.effect, named.location) == ("explained", hidden.effect, hidden.at)
    for name, estimate in named.parameters.items():
        low, high = estimate.ci95
        # three standard deviations: seeds are not chosen
        assert abs(hidden.parameters.get(name, 0.0) - (low + high) / 2) <= 0.75 * (high - low), name


@pytest.mark.proof
def test_a_wheel_in_a_base_of_a_robot_of_rigid_links_is_recognised_by_runs() -> None:
    robot = flyer(duration=8.0)
    assert robot.reference is not None
    ways = tuple(robot.reference.joints[::-1])
    swapped = tuple(way.model_copy(update={"joint": f"joint{k + 1}"}) for k, way in enumerate(ways))
    other = robot.model_copy(update={"reference": robot.reference.model_copy(update={"joints": swapped})})
    hidden = use("reaction_wheel", "base", momentum_x=8.0, momentum_y=-6.0, torque_z=0.5)
    told = diagnosed([robot, other], hidden, joints_only=False)
    (named,) = told.findings
    assert (told.verdict, named.effect, named.location) == ("explained", hidden.effect, "base")
    low, high = named.parameters["momentum_x"].ci95
    assert low - (high - low) <= 8.0 <= high + (high - low)
