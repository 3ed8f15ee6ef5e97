"""Hidden effects are named, located, estimated and validated on data that were not fitted."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from documented_keys import SHAPE, check
from end_to_end_cases import ARM, AXIS, CASES, QUICK, Case, within

from missing_physics.diagnosis import diagnose
from missing_physics.recordings import load_mapping, load_recording
from reference_model.simulation import simulate
from robot_model import Actuator, EffectUse, Recording, Robot

#: Of several that are found in the same way, all but one.
LONGER = {
    *("asymmetric", "delay", "by position", "by load", "ripple"),
    *("coulomb", "torque gain", "torque sensor delay", "torque sensor clock"),
}


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=name, marks=[pytest.mark.proof] if name in LONGER else [])
        for name, case in CASES.items()
    ],
)
def test_hidden_effect_is_named_located_estimated_and_validated(case: Case) -> None:
    nominal = ARM.with_effects(*case.known)
    made = simulate(nominal.with_effects(case.hidden), seed=1)
    result = diagnose(nominal, [made], options=QUICK)
    found = result.diagnosis
    [finding] = found.findings
    rivals = {r if "@" in r else f"{r}@{finding.location}" for r in finding.ambiguous_with}
    assert {f"{finding.effect}@{finding.location}", *rivals} == {f"{case.effect}@{case.at}", *case.twins}
    assert found.verdict == ("ambiguous" if case.twins else "explained")
    assert finding.probability > (0.2 if case.twins else 0.75)  # at most 0.89 is ever stated
    for name in case.identified:
        assert within(finding.parameters[name], case.parameters[name]), (name, finding.parameters[name])
    assert found.fit.validation_improvement > case.improvement
    for name, channel in found.fit.channels.items():
        if name.endswith(".torque"):
            # what is left is what the sensors' noise leaves; a few independent seconds know it to 20 %
            assert channel.after.validation_rms < 1.4 * channel.noise_floor
        else:
            # between encoders: errors of the numbers add to the noise, so only a clear fall is sure
            assert channel.after.validation_rms < max(0.2 * channel.before.validation_rms, 4e-5)
    joint = case.at.replace("link", "joint").split(".")[0]
    assert joint in {m.location for m in found.mismatch}
    check(json.loads(found.to_json()), SHAPE)


@pytest.mark.proof
def test_implausible_encoder_gain_is_not_named() -> None:
    gain = EffectUse(effect="sensor_gain", at="joint2.position", **{"gain_error": 0.02})
    found = diagnose(ARM, [simulate(ARM.with_effects(gain), seed=1)], options=QUICK).diagnosis
    assert "sensor_gain" not in {f.effect for f in found.findings}
    assert "sensor_gain@joint2.position" not in {r for f in found.findings for r in f.ambiguous_with}


def test_event_in_a_single_fold_is_found() -> None:
    hit = EffectUse(effect="external_torque", at="joint2", torque=3.0, start=9.2, duration=0.5)
    found = diagnose(ARM, [simulate(ARM.with_effects(hit), seed=1)], options=QUICK).diagnosis
    assert [(f.effect, f.location) for f in found.findings] == [("external_torque", "joint2")]
    values = found.findings[0].parameters
    # 80 samples at 0.08 N m know the torque to 1 %; the filter knows the start to a sample of 4 ms; the end
    # falls on a reversal of the joint, where rows do not count: to a row of 12 ms
    assert values["torque"].value == pytest.approx(3.0, rel=0.02)
    assert values["start"].value == pytest.approx(9.2, abs=0.004)
    assert values["duration"].value == pytest.approx(0.5, abs=0.012)
    assert within(values["duration"], 0.5)


@pytest.mark.proof
def test_two_simultaneous_effects_are_named() -> None:
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


@pytest.mark.proof
def test_effect_hidden_by_tuned_parameters_is_found() -> None:
    robot, made = tuned_away()
    assert robot.effects[0].parameters["coefficient"] > 300  # of 200: it has swallowed friction
    found = diagnose(robot, [made], options=QUICK).diagnosis
    assert [(f.effect, f.location) for f in found.findings] == [("coulomb_friction", "joint1")]
    assert within(found.findings[0].parameters["torque"], 20.0)
    changed = {p.name: p for p in found.nominal_parameters}
    assert changed["joint1.viscous"].estimate == pytest.approx(200.0, rel=0.05)
    assert found.fit.validation_improvement > 0.5


def test_effect_is_named_from_a_recorded_voltage(tmp_path: Path) -> None:
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
