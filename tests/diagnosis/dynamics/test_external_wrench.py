"""An external force on a free base is located at the base by its gyro, and not at a joint."""

from __future__ import annotations

from types import MappingProxyType

import casadi as ca
import pytest
from floating_cases import flyer

from missing_physics.diagnosis import Options, diagnose
from reference_model.effects import catalogue as entries
from reference_model.effects.base import Parameter, Values
from reference_model.effects.body_force import BodySignals, ForceEffect
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording, Robot

OPTIONS = Options(experiments=False)


class Thruster(ForceEffect):
    """Pushes the base along and about its z axis from `start` to `stop`; no catalogue knows it."""

    id = "test_thruster"
    title = "Thruster"
    place = "base"
    parameters = (
        Parameter("force", "N", "along z", -1e3, 1e3, 1.0, absent=0.0, linear=True),
        Parameter("moment", "N m", "about z", -1e3, 1e3, 1.0, absent=0.0, linear=True),
        Parameter("start", "s", "when it begins", 0.0, 1e3, 1.0),
        Parameter("stop", "s", "when it ends", 0.0, 1e3, 1.0),
    )
    equation = "F = force z, M = moment z from start to stop"
    source = "test"
    signature = "the base's momentum changes"
    experiment = "none"

    def wrench(self, s: BodySignals, p: Values, z: ca.SX) -> ca.SX:
        on = 0.5 * (ca.tanh((s.time - p["start"]) / 0.05) - ca.tanh((s.time - p["stop"]) / 0.05))
        return ca.vertcat(0, 0, p["force"] * on, 0, 0, p["moment"] * on)


def pushed(robot: Robot, monkeypatch: pytest.MonkeyPatch, seed: int, **numbers: float) -> Recording:
    """A simulated recording with the thruster; the diagnosis does not get to know of it."""
    use = EffectUse.model_validate({"effect": Thruster.id, "at": "base", "force": 0.0, **numbers})
    known = MappingProxyType({**entries.catalogue(), Thruster.id: Thruster()})
    with monkeypatch.context() as patch:
        patch.setattr(entries, "catalogue", lambda: known)
        return simulate(robot.with_effects(use), seed=seed)


@pytest.mark.proof
@pytest.mark.parametrize("seed", [3, 4])
def test_joint_friction_does_not_change_the_momentum(seed: int) -> None:
    truth = flyer()
    nominal = truth.model_copy(update={"effects": ()})
    found = diagnose(nominal, [simulate(truth, seed=seed)], options=OPTIONS).diagnosis
    assert {m.location for m in found.mismatch} == {"joint1", "joint2"}
    assert {(f.effect, f.location) for f in found.findings} == {
        ("viscous_friction", "joint1"),
        ("viscous_friction", "joint2"),
    }


@pytest.mark.parametrize(
    "numbers",
    [
        pytest.param({"force": 3.0, "moment": 1.0, "start": 10.0, "stop": 13.0}, marks=pytest.mark.proof),
        pytest.param({"moment": 0.3, "start": 0.0, "stop": 100.0}, marks=pytest.mark.proof),
    ],
    ids=["burst", "steady"],
)
def test_external_force_is_reported_at_the_base(
    numbers: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = flyer()
    found = diagnose(robot, [pushed(robot, monkeypatch, 3, **numbers)], options=OPTIONS).diagnosis
    # A moment that never ends is that of a wheel's motor: no motion of the robot separates the two.
    steady = numbers["start"] == 0.0
    assert found.verdict in (("unexplained", "ambiguous") if steady else ("unexplained",))
    first = found.mismatch[0]
    assert first.location == "base"
    assert first.p_value < 1e-3  # by several times the error of any model of all its rates
    assert sum(m.share for m in found.mismatch if m.location == "base") > 0.9
    assert found.fit.channels["base.angular_velocity.x"].unit == "rad/s"
    joints = [f for f in found.findings if f.location.split(".")[0] in ("joint1", "joint2")]
    assert all(f.probability <= 0.9 for f in joints)
