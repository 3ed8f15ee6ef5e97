"""Torque saturation, a passive joint, and friction near stops."""

from __future__ import annotations

import numpy as np
import pytest
from moved_arm import commanded, decaying
from recorded_arm import COULOMB, VISCOUS
from scipy.interpolate import make_interp_spline

from missing_physics.diagnosis import diagnose
from missing_physics.standard import fit_standard
from robot_model import EffectUse, Recording, Robot

VISCOUS_OF_PENDULUM, COULOMB_OF_PENDULUM = 0.02, 0.03


def with_friction(arm: Robot) -> Robot:
    viscous = EffectUse(effect="viscous_friction", at="joint", coefficient=VISCOUS)
    return arm.with_effects(viscous, EffectUse(effect="coulomb_friction", at="joint", torque=COULOMB))


@pytest.fixture(scope="module")
def pendulum(arm: Robot) -> Robot:
    """The arm about a level axis; its link hangs down at zero."""
    (joint,) = arm.joints
    level = joint.model_copy(update={"axis": (0.0, 1.0, 0.0), "rpy": (0.0, float(np.pi / 2), 0.0)})
    return arm.model_copy(update={"joints": (level,)})


def test_torque_saturation_is_named_from_a_recorded_command(arm: Robot) -> None:
    robot = with_friction(arm)
    diagnosis = diagnose(robot, [commanded(2.0, seed=1)], [commanded(2.0, seed=2)]).diagnosis
    assert [f.effect for f in diagnosis.findings] == ["torque_saturation"]
    limit = diagnosis.findings[0].parameters["limit"]
    assert limit.value == pytest.approx(2.0, rel=0.01)  # the corner is rounded over half a percent


def test_passive_pendulum_with_errors_in_its_file_is_diagnosed(pendulum: Robot) -> None:
    """Its centre of mass is 5 % nearer than the file says, its mass 3 % larger."""
    (link,) = pendulum.links
    stiffness = 9.81 * link.mass * link.center_of_mass[0]
    inertia = link.inertia[1] + link.mass * link.center_of_mass[0] ** 2
    friction = VISCOUS_OF_PENDULUM, COULOMB_OF_PENDULUM
    runs = [decaying(stiffness, inertia, start, *friction) for start in (1.2, 0.9)]
    off = {"center_of_mass": (1.05 * link.center_of_mass[0], 0.0, 0.0), "mass": 0.97 * link.mass}
    wrong = pendulum.model_copy(update={"links": (link.model_copy(update=off),)})
    diagnosis = diagnose(wrong, runs[:1], runs[1:]).diagnosis
    found = {f.effect: next(iter(f.parameters.values())) for f in diagnosis.findings}
    assert set(found) == {"viscous_friction", "coulomb_friction"}
    for one, true in zip((found["viscous_friction"], found["coulomb_friction"]), friction):
        assert one.value == pytest.approx(true, rel=0.1)  # as the masses of the file
        assert one.ci95[0] < true < one.ci95[1]
    assert diagnosis.verdict == "explained"


def test_drive_below_its_limit_gives_no_torque_saturation(arm: Robot) -> None:
    """The joint sticks as it turns back: neither that, nor a file that is right, is missing physics."""
    diagnosis = diagnose(with_friction(arm), [commanded(50.0, seed=1)], [commanded(50.0, seed=2)]).diagnosis
    assert diagnosis.verdict == "consistent"


def test_friction_of_a_passive_pendulum_is_named(pendulum: Robot) -> None:
    """Torque is zero throughout, so that it says nothing of masses: those are the file's."""
    (link,) = pendulum.links
    stiffness = 9.81 * link.mass * link.center_of_mass[0]
    inertia = link.inertia[1] + link.mass * link.center_of_mass[0] ** 2
    friction = VISCOUS_OF_PENDULUM, COULOMB_OF_PENDULUM
    runs = [decaying(stiffness, inertia, start, *friction) for start in (1.2, 0.9)]
    result = diagnose(pendulum, runs[:1], runs[1:])
    found = {f.effect: f for f in result.diagnosis.findings}
    assert set(found) == {"viscous_friction", "coulomb_friction"}
    # Two percent: the sign at a reversal, in a band that holds five times the fastest motion.
    assert found["viscous_friction"].parameters["coefficient"].value == pytest.approx(friction[0], rel=0.02)
    assert found["coulomb_friction"].parameters["torque"].value == pytest.approx(friction[1], rel=0.02)
    assert not result.diagnosis.timing


def test_friction_of_an_arm_that_sticks_at_reversals_is_named(arm: Robot) -> None:
    """Within two thousandths: what happens at rest enters nothing, where it spread by some percent."""
    found = fit_standard(arm, [commanded(50.0, seed=1)]).estimate
    assert found.value("joint.coulomb")[0] == pytest.approx(COULOMB, rel=2e-3)
    assert found.value("joint.viscous")[0] == pytest.approx(VISCOUS, rel=2e-3)


def test_result_does_not_depend_on_the_sampling_rate(arm: Robot) -> None:
    run = commanded(50.0, seed=1)
    dense = np.linspace(run.time[0], run.time[-1], 8 * (run.time.size - 1) + 1)
    channels = {name: make_interp_spline(run.time, run[name], k=3)(dense) for name in run}
    found, other = (fit_standard(arm, [r]).estimate for r in (run, Recording(dense, channels)))
    for name in ("joint.coulomb", "joint.viscous"):
        assert other.value(name)[0] == pytest.approx(found.value(name)[0], rel=2e-3)
