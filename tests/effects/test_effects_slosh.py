"""Slosh: analytic frequencies, momentum, and the same liquid as a mass on three sprung slides."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh

from reference_model.dynamics.inertial import ten_numbers
from reference_model.evaluation.model import RobotModel
from reference_model.passive.base_motion import BaseMotion
from reference_model.plant.truth import truth_of
from reference_model.simulation import simulate
from robot_model import (
    Actuator,
    Base,
    EffectUse,
    InputError,
    Joint,
    JointPD,
    Link,
    Recording,
    Reference,
    Robot,
)

PRECISE = {"rtol": 1e-11, "atol": 1e-13}
PLACE = (0.3, -0.2, 0.4)


def slosh(**parameters: float) -> EffectUse:
    given = {"mass": 6.0, "frequency": 0.8, "damping_ratio": 0.03, **dict(zip("xyz", PLACE)), **parameters}
    return EffectUse.model_validate({"effect": "slosh", "at": "base", **given})


def craft(**changes: object) -> Robot:
    """A free base with a driven arm that swings back to its reference."""
    given = {
        "name": "craft",
        "base": Base(
            kind="free", mass=40.0, inertia=(5.0, 6.0, 7.0, 0.2, -0.1, 0.3), center_of_mass=(0.1, 0.0, 0.05)
        ),
        "links": (Link(name="arm", mass=5.0, center_of_mass=(0.7, 0.1, 0.0), inertia=(0.1, 0.9, 0.9)),),
        "joints": (
            Joint(
                name="shoulder",
                parent="base",
                child="arm",
                origin=(0.4, 0.0, 0.2),
                axis=(0.0, 0.6, 0.8),
                initial_velocity=1.2,
                actuator=Actuator(),
            ),
        ),
        "controller": JointPD(kp=40.0, kd=12.0, sample_time=0.0),
        "reference": Reference(duration=5.0, sample_rate=50.0),
    }
    return Robot.model_validate({**given, **changes})


def test_the_base_keeps_its_mass_properties() -> None:
    truth = truth_of(craft().with_effects(slosh())).robot
    liquid, place = 6.0, np.array(PLACE)
    about = liquid * (place @ place * np.eye(3) - np.outer(place, place))
    point = [liquid, *(liquid * place), *(about[p] for p in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))]
    # Sums of the same numbers.
    np.testing.assert_allclose(ten_numbers(truth.base) + point, ten_numbers(craft().base), atol=1e-12)


@pytest.mark.parametrize("kind", ["fixed", "free"])
def test_the_frequency_is_that_of_a_two_body_oscillator(kind: str) -> None:
    """Held, f; with a base that floats f sqrt(M / (M - m)), the liquid at the centre of mass."""
    base = Base(kind=kind, mass=40.0, inertia=(5.0, 6.0, 7.0))
    robot = craft(base=base, links=(), joints=(), controller={"kind": "none"})
    truth = truth_of(robot.with_effects(slosh(x=0.0, y=0.0, z=0.0)))
    model = RobotModel(truth.robot)
    still = BaseMotion.at_rest((1.0, 0.0, 0.0, 0.0)) if kind == "free" else None
    mass = model.mass_matrix(np.zeros(0), base=still)[0]
    stiffness = np.zeros_like(mass)
    stiffness[-3:, -3:] = (2 * np.pi * 0.8) ** 2 * np.eye(3)
    found = np.sqrt(eigh(stiffness, mass, eigvals_only=True)[-3:]) / (2 * np.pi)
    expected = 0.8 * np.sqrt(40.0 / 34.0) if kind == "free" else 0.8
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def on_slides(robot: Robot) -> Robot:
    """The same liquid as a mass on three slides in a row with springs and dampers."""
    truth = truth_of(robot.with_effects(slosh())).robot
    links, joints, effects = [], [], []
    parent, stiffness = "base", 6.0 * (2 * np.pi * 0.8) ** 2
    for k, axis in enumerate("xyz"):
        links.append(Link(name=f"slide_{axis}", mass=6.0 if axis == "z" else 0.0))
        joints.append(
            Joint(
                name=f"along_{axis}",
                kind="prismatic",
                parent=parent,
                child=f"slide_{axis}",
                axis=tuple(np.eye(3)[k].tolist()),
                origin=PLACE if k == 0 else (0.0, 0.0, 0.0),
            )
        )
        parent = f"slide_{axis}"
        damping = 2 * 0.03 * stiffness / (2 * np.pi * 0.8)
        given = {"at": f"along_{axis}"}
        effects += [
            EffectUse.model_validate(
                {"effect": "cable_spring", **given, "stiffness": stiffness, "torque_at_zero": 0.0}
            ),
            EffectUse.model_validate({"effect": "viscous_friction", **given, "coefficient": damping}),
        ]
    update = {"base": truth.base, "links": (*robot.links, *links), "joints": (*robot.joints, *joints)}
    return robot.model_copy(update={**update, "effects": tuple(effects)})


def agree(one: Recording, other: Recording, atol: float) -> None:
    channels = [c for c in one.channels if c.startswith(("base.", "shoulder.", "robot."))]
    assert len(channels) > 20
    for channel in channels:
        if channel != "robot.energy":
            np.testing.assert_allclose(one[channel], other[channel], rtol=0, atol=atol, err_msg=channel)


def test_it_equals_a_mass_on_three_sprung_slides() -> None:
    effect = simulate(craft().with_effects(slosh()), sensors=False, **PRECISE)
    slides = simulate(on_slides(craft()), sensors=False, **PRECISE)
    agree(effect, slides, 1e-8)
    # the springs' energy is that of the effect's, and work of effects at joints is not in the energy
    assert np.abs(effect["slosh.tip_deflection.x"]).max() > 1e-3
    for axis in "xyz":
        moved = effect[f"slosh.tip_deflection.{axis}"]
        np.testing.assert_allclose(moved, slides[f"along_{axis}.position"], rtol=0, atol=1e-8)


def test_momentum_energy_and_work() -> None:
    recording = simulate(craft().with_effects(slosh()), sensors=False, work=True, **PRECISE)
    balance = recording["robot.energy"] - recording["robot.work"]
    np.testing.assert_allclose(balance, balance[0], rtol=0, atol=1e-8)
    for what in ("linear", "angular"):
        for axis in "xyz":
            assert np.ptp(recording[f"robot.{what}_momentum.{axis}"]) < 1e-9


def test_zero_mass_leaves_the_robot_unchanged() -> None:
    without = simulate(craft(), sensors=False)
    absent = simulate(craft().with_effects(slosh(mass=0.0)), sensors=False)
    assert set(absent.channels) == set(without.channels)
    for name in without.channels:
        np.testing.assert_array_equal(absent[name], without[name])


def test_two_tanks_and_a_link_of_that_name() -> None:
    truth = truth_of(craft().with_effects(slosh(mass=1.0), slosh(mass=2.0, x=-0.3))).robot
    assert [link.name for link in truth.links] == ["arm", "slosh", "slosh2"]


def test_more_liquid_than_base_is_refused() -> None:
    with pytest.raises(InputError, match=r"the base \(40 kg\) cannot lose 50 kg at"):
        simulate(craft().with_effects(slosh(mass=50.0)))


def test_the_recording_has_no_channel_of_the_liquid() -> None:
    """A robot without sensors records every channel of its description."""
    assert not [c for c in simulate(craft().with_effects(slosh())).channels if c.startswith("slosh")]
