"""Names are worth what they remove beside what is left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from missing_physics.diagnosis import Options, diagnose
from missing_physics.diagnosis.adequacy import HALF_BELIEVED, account_of, believed
from missing_physics.diagnosis.result import ChannelFit, Errors, Finding, Fit
from reference_model.simulation import simulate
from robot_model import load_robot


def fit_of(**rms: tuple[float, float]) -> Fit:
    """Held-out error before and after by joint, over a noise floor of 1."""
    channels = {
        f"{joint}.torque": ChannelFit("N m", Errors(0.0, before), Errors(0.0, after), noise_floor=1.0)
        for joint, (before, after) in rms.items()
    }
    return Fit(channels, 0.0)


def test_what_leaves_noise_is_believed_whole_however_small() -> None:
    fit = fit_of(joint1=(1.6, 1.1), joint2=(90.0, 80.0))
    assert account_of(fit, "joint1").belief == 1.0
    assert account_of(fit, "joint1.position").adequate


def test_belief_falls_with_what_is_left() -> None:
    belief = [account_of(fit_of(joint1=(50.0, left)), "joint1").belief for left in (1.4, 2, 5, 20, 45)]
    assert belief == sorted(belief, reverse=True)
    assert belief[0] == 1.0
    assert belief[-1] < 0.05
    # half where a HALF_BELIEVED-th of what was removed is left, by definition
    left = np.sqrt(1.5**2 + 100.0)
    before = np.sqrt(1.5**2 + 100.0 * (1 + HALF_BELIEVED))
    assert account_of(fit_of(joint1=(before, left)), "joint1").belief == pytest.approx(0.5)


def test_a_body_is_accounted_for_at_every_joint() -> None:
    fit = fit_of(joint1=(20.0, 1.0), joint2=(20.0, 19.0))
    assert account_of(fit, "joint1").adequate
    assert not account_of(fit, "joint2").adequate
    both = account_of(fit, "link2")
    assert both.removed == pytest.approx(20.0**2 - 1.5**2 + 20.0**2 - 19.0**2)


def test_a_gyro_is_accounted_for_by_itself() -> None:
    fit = fit_of(joint1=(90.0, 1.0))
    rate = ChannelFit("rad/s", Errors(0.0, 40.0), Errors(0.0, 39.0), noise_floor=1.0)
    fit = replace(fit, channels={**fit.channels, "base.angular_velocity.x": rate})
    assert not account_of(fit, "base.angular_velocity.x").adequate
    assert account_of(fit, "base").adequate


def test_an_event_is_over_before_held_out_data_begin() -> None:
    event = Finding("external_torque", "joint1", 0.99, {})
    spring = replace(event, effect="cable_spring")
    kept, lowered = believed([event, spring], fit_of(joint1=(20.0, 19.0)))
    assert kept.probability == 0.99
    assert lowered.probability < 0.1


def test_ripple_whose_phase_slips_is_not_called_ripple() -> None:
    """cos(k q + s t) is torque ripple for a while; its phase turns thrice during the recording."""
    robot = load_robot("single_axis")
    assert robot.reference is not None
    reference = robot.reference.model_copy(update={"duration": 16.0, "sample_rate": 500.0})
    robot = robot.model_copy(update={"reference": reference})
    made = simulate(robot, seed=1)
    position, time = made["joint1.position"], made.time
    slipping = 9.0 * np.cos(650.0 * position + 2 * np.pi * 3 * time / 16.0)
    torque = made["joint1.torque"] + slipping
    found = diagnose(
        robot, [made.with_channels({"joint1.torque": torque})], options=Options(experiments=False)
    ).diagnosis
    assert found.verdict == "unexplained"
    assert found.findings == ()
    assert "joint1" in {m.location for m in found.mismatch}
