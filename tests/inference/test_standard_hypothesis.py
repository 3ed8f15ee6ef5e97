"""The standard model by the likelihood: what a simulated arm has, within its own intervals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from missing_physics.inference.standard_hypothesis import StandardHypothesis, fit_standard_hypothesis
from missing_physics.standard import fit_standard
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording, load_robot

ARM = load_robot("two_link_arm").model_copy(update={"effects": ()})
TRUTH = {"viscous": 2.0, "coulomb": 1.5, "offset": 0.3}
#: Encoders far better than the torque sensors: what they let through of their noise shifts the timing.
SENSORS = tuple(
    s if s.channel.endswith("torque") else s.model_copy(update={"noise": 1e-7, "resolution": 0.0})
    for s in ARM.sensors
)
MACHINE = ARM.model_copy(update={"sensors": SENSORS}).with_effects(
    *(
        EffectUse(effect=effect, at=joint.name, **values)
        for joint in ARM.moving_joints
        for effect, values in (
            ("viscous_friction", {"coefficient": TRUTH["viscous"]}),
            ("coulomb_friction", {"torque": TRUTH["coulomb"]}),
            ("torque_offset", {"torque": -TRUTH["offset"]}),
        )
    )
)
#: Torque is recorded this much before it acts [samples].
EARLY = 0.8


@pytest.fixture(scope="module")
def found() -> StandardHypothesis:
    run = simulate(MACHINE, seed=0)
    channels = {
        f"{j.name}.{q}": run[f"{j.name}.{q}"] for j in ARM.moving_joints for q in ("position", "torque")
    }
    step = run.time[1] - run.time[0]
    inside = np.clip(run.time + EARLY * step, run.time[0], run.time[-1])
    early = {c: make_interp_spline(run.time, v, k=3)(inside) for c, v in channels.items() if "torque" in c}
    nominal = ARM.model_copy(update={"sensors": SENSORS})
    recording = Recording(run.time, {**channels, **early}, "simulated")
    return fit_standard_hypothesis(fit_standard(nominal, [recording]), [recording])


@pytest.mark.parametrize("kind", TRUTH)
@pytest.mark.parametrize("joint", [joint.name for joint in ARM.moving_joints])
def test_estimates_hold_the_truth_within_four_standard_deviations(
    found: StandardHypothesis, joint: str, kind: str
) -> None:
    value, deviation = found.joints[joint].estimates[kind]
    assert abs(value - TRUTH[kind]) < 4.0 * deviation
    assert deviation < 0.3 * TRUTH[kind]


def test_the_offset_between_torque_and_motion_is_found(found: StandardHypothesis) -> None:
    value, deviation = found.timing
    assert value / found.step == pytest.approx(EARLY, abs=0.15)  # and what the encoders' noise adds
    assert deviation < 0.1 * found.step


def test_what_is_left_has_unit_power(found: StandardHypothesis) -> None:
    for joint in found.joints.values():
        assert joint.chi_square == pytest.approx(1.0, abs=0.1)
