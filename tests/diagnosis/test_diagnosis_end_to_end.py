"""From a robot and a recording to an answer, on recordings of which the truth is known."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_diagnosis_result import SHAPE, check

from missing_physics.diagnosis import Diagnosis, Options, Result, diagnose
from missing_physics.recordings import load_mapping, load_recording
from reference_model.simulation import simulate
from robot_model import Actuator, EffectUse, InputError, Recording, Robot, load_robot


def shortened(name: str, *, duration: float, rate: float) -> Robot:
    robot = load_robot(name)
    assert robot.reference is not None
    reference = robot.reference.model_copy(update={"duration": duration, "sample_rate": rate})
    return robot.model_copy(update={"reference": reference})


ARM = shortened("two_link_arm", duration=20.0, rate=250.0)
AXIS = shortened("single_axis", duration=16.0, rate=500.0)


@dataclass(frozen=True)
class Case:
    """A hidden effect, what else the robot has and is known to have, and what shall be found of it.

    Attributes:
        told: parameters whose true values shall be inside their intervals.
        alike: what no torque tells from it, so that both shall be told.
        improvement: least fall of the held-out error that shows that it was modelled.
    """

    effect: str
    at: str
    parameters: Mapping[str, float]
    improvement: float
    known: tuple[EffectUse, ...] = ()
    told: tuple[str, ...] = field(default=())
    alike: str = ""

    @property
    def hidden(self) -> EffectUse:
        return EffectUse(effect=self.effect, at=self.at, **self.parameters)


DRY = EffectUse(effect="coulomb_friction", at="joint1", torque=2.0)
#: The least improvement is a third of what the true model reaches with seed 1, as the noise allows.
CASES = {
    "coulomb": Case("coulomb_friction", "joint1", {"torque": 3.0}, 0.8, told=("torque",)),
    "stribeck": Case(
        "stribeck_friction",
        "joint2",
        {"coulomb_torque": 2.0, "static_torque": 3.5, "stribeck_velocity": 0.1},
        0.8,
        told=("coulomb_torque", "static_torque", "stribeck_velocity"),
    ),
    "spring": Case(
        "cable_spring",
        "joint1",
        {"stiffness": 4.0, "torque_at_zero": 1.0},
        0.8,
        told=("stiffness", "torque_at_zero"),
    ),
    "ripple": Case(
        "torque_ripple",
        "joint2",
        {"cosine": 0.5, "sine": 0.3, "cosine_per_torque": 0.0, "sine_per_torque": 0.0, "order": 80.0},
        0.7,
        told=("cosine", "sine", "order"),
    ),
    "asymmetric": Case(
        "asymmetric_friction",
        "joint1",
        {"coulomb_difference": 0.5, "viscous_difference": 0.4},
        0.7,
        told=("coulomb_difference", "viscous_difference"),
    ),
    "lag": Case("actuator_lag", "joint1", {"time_constant": 0.005}, 0.4, told=("time_constant",)),
    "delay": Case("sensor_delay", "joint2.position", {"delay": 0.004}, 0.15, told=("delay",)),
    # not told: to first order a gain of 1.02 counts as 0.02/1.02, and wrong masses take a part of it
    "sensor gain": Case("sensor_gain", "joint2.position", {"gain_error": 0.02}, 0.15),
    "by position": Case(
        "position_dependent_friction",
        "joint1",
        {"cosine": 0.4, "sine": 0.2, "order": 5.0},
        0.5,
        known=(DRY,),
        told=("cosine", "sine", "order"),
    ),
    "by load": Case(
        "load_dependent_friction",
        "joint1",
        {"coefficient": 0.0, "gear_share": 0.04},
        0.8,
        known=(DRY,),
        told=("gear_share",),
    ),
    "payload": Case("payload", "link2", {"mass": 0.6, "x": 0.4, "y": 0.0, "z": 0.0}, 0.9),
    "torque gain": Case(
        "torque_gain", "joint1", {"gain_error": 0.05}, 0.8, alike="sensor_gain@joint1.torque"
    ),
    "torque sensor gain": Case(
        "sensor_gain", "joint1.torque", {"gain_error": 0.05}, 0.8, alike="torque_gain@joint1"
    ),
    "torque sensor delay": Case("sensor_delay", "joint1.torque", {"delay": 0.005}, 0.4, told=("delay",)),
    "torque sensor clock": Case("clock_drift", "joint2.torque", {"rate": 1e-3}, 0.2, told=("rate",)),
}
QUICK = Options(experiments=False)


def within(estimate: Any, true: float) -> bool:
    """Inside the interval, widened by half: of 20 honest intervals one misses, but none by so much."""
    low, high = estimate.ci95
    return bool(abs(true - (low + high) / 2) <= 0.75 * (high - low))


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_a_hidden_effect_is_named_placed_measured_and_proven(case: Case) -> None:
    nominal = ARM.with_effects(*case.known)
    made = simulate(nominal.with_effects(case.hidden), seed=1)
    result = diagnose(nominal, [made], options=QUICK)
    found = result.diagnosis
    [finding] = found.findings
    label = f"{case.effect}@{case.at}"
    assert {f"{finding.effect}@{finding.location}", *finding.ambiguous_with} == {label, case.alike} - {""}
    assert found.verdict == ("ambiguous" if case.alike else "explained")
    assert abs(finding.probability - (0.5 if case.alike else 1.0)) < 0.1
    for name in case.told:
        assert within(finding.parameters[name], case.parameters[name]), (name, finding.parameters[name])
    assert found.fit.validation_improvement > case.improvement
    for name, channel in found.fit.channels.items():
        if name.endswith(".torque"):
            # what is left is what the sensors' noise leaves; a few independent seconds know it to 20 %
            assert channel.after.validation_rms < 1.4 * channel.noise_floor
        elif not case.alike:
            # free runs: errors of the numbers add to the noise, so only that they follow closely is sure
            assert channel.after.validation_rms < max(0.2 * channel.before.validation_rms, 4e-5)
    joint = case.at.replace("link", "joint").split(".")[0]
    assert joint in {m.location for m in found.mismatch}
    check(json.loads(found.to_json()), SHAPE)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("robot", [ARM, AXIS], ids=["arm", "axis"])
def test_nothing_is_named_when_nothing_is_missing(robot: Robot, seed: int) -> None:
    found = diagnose(robot, [simulate(robot, seed=seed)]).diagnosis
    assert found.findings == ()
    assert found.verdict == "consistent"
    assert found.experiments == ()
    assert "agrees with" in found.summary


def test_an_event_is_found_although_no_other_stretch_foretells_it() -> None:
    hit = EffectUse(effect="external_torque", at="joint2", torque=3.0, start=6.2, duration=0.5)
    found = diagnose(ARM, [simulate(ARM.with_effects(hit), seed=1)], options=QUICK).diagnosis
    assert [(f.effect, f.location) for f in found.findings] == [("external_torque", "joint2")]
    values = found.findings[0].parameters
    # 80 samples at 0.08 N m know the torque to 1 %; the filter knows the instants to a sample of 4 ms
    assert values["torque"].value == pytest.approx(3.0, rel=0.02)
    assert values["start"].value == pytest.approx(6.2, abs=0.004)
    assert values["duration"].value == pytest.approx(0.5, abs=0.008)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_weak_event_of_a_quarter_second_is_found(seed: int) -> None:
    """When it begins and ends is told by single blocks, which no others foretell."""
    hit = EffectUse(effect="external_torque", at="joint1", torque=0.6, start=6.2, duration=0.26)
    found = diagnose(ARM, [simulate(ARM.with_effects(hit), seed=seed)], options=QUICK).diagnosis
    assert [(f.effect, f.location) for f in found.findings] == [("external_torque", "joint1")]
    # 65 samples at 0.08 N m know the torque to 2 %, in twice as much as chance leaves.
    assert found.findings[0].parameters["torque"].value == pytest.approx(0.6, rel=0.1)


def test_two_effects_at_once() -> None:
    truth = ARM.with_effects(CASES["coulomb"].hidden, CASES["ripple"].hidden)
    found = diagnose(ARM, [simulate(truth, seed=1)], options=QUICK).diagnosis
    assert {(f.effect, f.location) for f in found.findings} == {
        ("coulomb_friction", "joint1"),
        ("torque_ripple", "joint2"),
    }
    assert found.mismatch[0].share + found.mismatch[1].share == pytest.approx(1.0)


def tuned_away() -> tuple[Robot, Recording]:
    """The axis without Coulomb friction, its mass and damping refitted until the fit was best."""
    exact = simulate(AXIS, sensors=False)
    columns = np.column_stack([exact["joint1.acceleration"], exact["joint1.velocity"]])
    mass, damping = np.linalg.lstsq(columns, exact["joint1.torque"], rcond=None)[0]
    robot = AXIS.model_copy(
        update={
            "links": (AXIS.links[0].model_copy(update={"mass": float(mass)}),),
            "effects": (EffectUse(effect="viscous_friction", at="joint1", coefficient=float(damping)),),
        }
    )
    return robot, simulate(AXIS, seed=1)


def test_what_tuning_has_hidden_is_found() -> None:
    robot, made = tuned_away()
    assert robot.effects[0].parameters["coefficient"] > 300  # of 200: it has swallowed friction
    found = diagnose(robot, [made], options=QUICK).diagnosis
    assert [(f.effect, f.location) for f in found.findings] == [("coulomb_friction", "joint1")]
    assert within(found.findings[0].parameters["torque"], 20.0)
    changed = {p.name: p for p in found.nominal_parameters}
    assert changed["viscous_friction@joint1.coefficient"].estimate == pytest.approx(200.0, rel=0.05)
    assert changed["carriage.mass"].estimate == pytest.approx(95.0, rel=0.01)
    assert found.fit.validation_improvement > 0.5


def test_two_explanations_that_are_the_same_are_called_ambiguous(tmp_path: Path) -> None:
    """Gravity tilted in the plane of the arm turns everything as an offset of the first sensor does."""
    tilt = EffectUse(effect="gravity", at="base", x=0.3, y=0.0, z=0.0)
    result = diagnose(ARM, [simulate(ARM.with_effects(tilt), seed=1)])
    found = result.diagnosis
    assert found.verdict == "ambiguous"
    [finding] = found.findings
    both = {f"{finding.effect}@{finding.location}", *finding.ambiguous_with}
    assert both == {"gravity@base", "sensor_offset@joint1.position"}
    assert finding.probability < 0.9
    [experiment] = found.experiments
    assert set(experiment.separates) == {"gravity", "sensor_offset"}
    assert experiment.motion is not None
    path = tmp_path / experiment.motion
    path.write_text(result.experiment_motions[experiment.motion])
    motion = load_recording(path)
    assert set(motion) == {"joint1.reference_position", "joint2.reference_position"}
    for joint in ARM.joints:
        speed = np.gradient(motion[f"{joint.name}.reference_position"], motion.time)
        assert joint.velocity_limit is not None
        assert np.abs(speed).max() <= joint.velocity_limit
    assert "cannot be told apart" in found.summary


def test_an_offset_is_among_what_is_named_for_it() -> None:
    offset = EffectUse(effect="torque_offset", at="joint2", torque=0.8)
    found = diagnose(ARM, [simulate(ARM.with_effects(offset), seed=1)], options=QUICK).diagnosis
    [finding] = found.findings
    both = {f"{finding.effect}@{finding.location}", *finding.ambiguous_with}
    assert both >= {"torque_offset@joint2", "sensor_offset@joint2.torque"}


def test_a_payload_and_a_heavier_carriage_are_one_and_the_same_on_an_axis() -> None:
    load = EffectUse(effect="payload", at="carriage", mass=9.0, x=0.0, y=0.0, z=0.0)
    found = diagnose(AXIS, [simulate(AXIS.with_effects(load), seed=1)], options=QUICK).diagnosis
    [finding] = found.findings
    both = {f"{finding.effect}@{finding.location}", *finding.ambiguous_with}
    assert both >= {"payload@carriage", "inertia@carriage"}
    assert finding.probability <= 0.5 + 1e-6


def test_one_wrong_gain_is_not_told_as_many_wrong_numbers() -> None:
    """It scales mass, damping and friction alike; what else is missing hides that from each by itself."""
    known = AXIS.with_effects(EffectUse(effect="coulomb_friction", at="joint1", torque=20.0))
    gain = EffectUse(effect="torque_gain", at="joint1", gain_error=-0.016)
    uneven = {"coulomb_difference": 0.0, "viscous_difference": -30.0}
    other = EffectUse(effect="asymmetric_friction", at="joint1", **uneven)
    found = diagnose(known, [simulate(known.with_effects(gain, other), seed=1)], options=QUICK).diagnosis
    named = {f.effect: f for f in found.findings}
    assert "asymmetric_friction" in named
    assert {"viscous_friction", "coulomb_friction"}.isdisjoint(named)
    assert {"torque_gain", "sensor_gain"} & named.keys()


def chirp(time: np.ndarray, seed: int) -> np.ndarray:
    return np.sin(2 * np.pi * (0.3 * time + 0.08 * time**2) + seed)


def telegraph(time: np.ndarray, seed: int) -> np.ndarray:
    flips = np.sort(np.random.default_rng(seed).uniform(0, time[-1], 22))
    return (-1.0) ** np.searchsorted(flips, time)


@pytest.mark.parametrize("foreign", [chirp, telegraph])
@pytest.mark.parametrize("seed", [1, 2])
def test_something_foreign_is_located_and_left_unnamed(foreign: Any, seed: int) -> None:
    made = simulate(ARM, seed=seed)
    channel = "joint2.torque"
    disturbed = made.with_channels({channel: made[channel] + foreign(made.time, seed)})
    found = diagnose(ARM, [disturbed], options=QUICK).diagnosis
    assert found.verdict == "unexplained"
    assert found.findings == ()
    assert found.mismatch[0].location == "joint2"
    assert found.mismatch[0].share > 0.9
    assert found.mismatch[0].p_value < 1e-6
    assert "unnamed" in found.summary


def only(made: Recording, *quantities: str) -> Recording:
    kept = {k: v for k, v in made.channels.items() if k.split(".")[1] in quantities}
    return Recording(made.time, kept, made.source)


def held(made: Recording) -> Recording:
    """Joints that stand still, but for the sensors' noise."""
    return made.with_channels(
        {k: 5e-6 * np.random.default_rng(0).standard_normal(len(made)) for k in made if "position" in k}
    )


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda made: only(made, "position"), "joint1: its actuator torque is neither recorded nor"),
        (held, "joint1 does not move beyond its noise"),
        (lambda made: made.window(0.0, 0.6), "only .* independent samples are left"),
    ],
    ids=["no torque", "no motion", "too short"],
)
def test_a_recording_that_cannot_tell_is_said_to(spoil: Any, sentence: str) -> None:
    result = diagnose(ARM, [spoil(simulate(ARM, seed=1))])
    found = result.diagnosis
    assert found.verdict == "not_enough_data"
    assert found.findings == ()
    assert any(re.match(sentence, said) for said in found.could_not_tell)
    assert found.summary.startswith("The recording cannot support any statement")
    check(json.loads(found.to_json()), SHAPE)


def test_what_is_no_recording_of_this_robot_is_refused() -> None:
    with pytest.raises(InputError, match=r"neither joint1.position nor joint1.motor_position"):
        diagnose(ARM, [only(simulate(ARM, seed=1), "torque")])


@pytest.fixture(scope="module")
def coulomb() -> Recording:
    return simulate(ARM.with_effects(CASES["coulomb"].hidden), seed=1)


@pytest.fixture(scope="module")
def answer(coulomb: Recording) -> Result:
    return diagnose(ARM, [coulomb])


def test_the_same_input_and_seed_give_the_same_file(coulomb: Recording, answer: Result) -> None:
    again = diagnose(ARM, [coulomb])
    assert again.diagnosis.to_json() == answer.diagnosis.to_json()
    assert again.augmented_robot_toml == answer.augmented_robot_toml
    assert again.ladder == answer.ladder


def without_names(found: Diagnosis) -> dict[str, Any]:
    return {k: v for k, v in found.to_dict().items() if k not in ("recordings", "validation")}


def test_names_order_and_further_channels_tell_nothing(coulomb: Recording, answer: Result) -> None:
    """The diagnosis sees the robot and the arrays of motion and torque, whatever else stands there."""
    exact = simulate(ARM.with_effects(CASES["coulomb"].hidden), sensors=False)
    leaked = {"joint1.friction_torque": exact["joint1.friction_torque"], **coulomb.channels}
    blind = replace(
        coulomb, channels=dict(reversed(leaked.items())), source="viscous_friction, nothing missing"
    )
    assert without_names(diagnose(ARM, [blind]).diagnosis) == without_names(answer.diagnosis)


def test_the_time_origin_tells_nothing(coulomb: Recording, answer: Result) -> None:
    later = replace(coulomb, time=coulomb.time + 64.0)
    found, before = diagnose(ARM, [later]).diagnosis, answer.diagnosis
    assert found.verdict == before.verdict
    assert [(f.effect, f.location) for f in found.findings] == [
        (f.effect, f.location) for f in before.findings
    ]
    for one, other in zip(found.findings, before.findings):
        for name, estimate in one.parameters.items():
            # sample times after 64 s carry 1e-14 of rounding, of steps of 4 ms
            assert estimate.value == pytest.approx(other.parameters[name].value, rel=1e-6)
            assert estimate.ci95 == pytest.approx(other.parameters[name].ci95, rel=1e-5)


def test_series_ladder_and_notes_say_what_was_done(answer: Result) -> None:
    found = answer.diagnosis
    wanted = {f"joint{k}.{quantity}" for k in (1, 2) for quantity in ("torque", "position")}
    assert {s.channel for s in answer.series} == set(found.fit.channels) == wanted
    for series in answer.series:
        if series.channel.endswith("position"):
            continue
        sizes = {a.size for a in (series.time, series.measured, series.nominal, series.augmented)}
        assert sizes == {series.held_out.size}
        assert 0.15 < series.held_out.mean() < 0.35  # one stretch in four
        before, after = (np.std(series.measured - y) for y in (series.nominal, series.augmented))
        assert after < 1.05 * before
    kept = [rung for rung in answer.ladder if rung.kept]
    assert [(r.effect, r.location) for r in kept] == [("coulomb_friction", "joint1")]
    assert any("one stretch in four" in note for note in found.notes)
    assert found.stages[-1].effects == ("coulomb_friction@joint1",)


def test_a_validation_recording_is_scored_and_never_fitted(coulomb: Recording) -> None:
    other = simulate(ARM.with_effects(CASES["coulomb"].hidden), seed=2)
    told: list[str] = []
    result = diagnose(ARM, [coulomb], [other], options=QUICK, progress=told.append)
    found = result.diagnosis
    assert found.validation == (other.source,)
    assert {s.role for s in result.series} == {"train", "validation"}
    assert all(s.held_out.all() == (s.role == "validation") for s in result.series)
    assert found.fit.validation_improvement > 0.8
    assert not any("one stretch in four" in note for note in found.notes)
    assert any("coulomb_friction@joint1" in phrase for phrase in told)


def test_an_axis_of_which_only_the_voltage_is_recorded(tmp_path: Path) -> None:
    """A file in volts and millimetres through a mapping; the torque comes from the winding."""
    gear, constant, resistance = 400.0, 0.05, 0.8
    motor = Actuator(gear_ratio=gear, torque_constant=constant, resistance=resistance)
    joint = AXIS.joints[0].model_copy(update={"actuator": motor})
    viscous = tuple(use for use in AXIS.effects if use.effect == "viscous_friction")
    robot = AXIS.model_copy(update={"joints": (joint,), "effects": viscous})
    exact = simulate(robot.with_effects(*(u for u in AXIS.effects if u not in viscous)), sensors=False)
    chance = np.random.default_rng(1)
    voltage = (
        exact["joint1.torque"] * resistance / (gear * constant) + gear * constant * exact["joint1.velocity"]
    )
    columns = np.column_stack(
        [
            exact.time,
            1e3 * exact["joint1.position"] + 1e-3 * chance.standard_normal(len(exact)),
            voltage + 1e-2 * chance.standard_normal(len(exact)),
        ]
    )
    np.savetxt(tmp_path / "log.csv", columns, delimiter=",", header="t,x_mm,u", comments="", fmt="%.12g")
    (tmp_path / "map.toml").write_text(
        'prismatic = ["joint1"]\n[time]\nsource = "t"\n'
        '[channels."joint1.position"]\nsource = "x_mm"\nscale = 1e-3\n'
        '[channels."joint1.voltage"]\nsource = "u"\n'
    )
    made = load_recording(tmp_path / "log.csv", mapping=load_mapping(tmp_path / "map.toml"))
    found = diagnose(robot, [made], options=QUICK).diagnosis
    assert [(f.effect, f.location) for f in found.findings] == [("coulomb_friction", "joint1")]
    assert within(found.findings[0].parameters["torque"], 20.0)
