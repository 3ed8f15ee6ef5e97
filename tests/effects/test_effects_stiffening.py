"""Stiffening of a spinning beam by the effect: Southwell's slope in a simulation, and the described beam."""

from __future__ import annotations

import numpy as np
import pytest

from reference_model.plant.truth import truth_of
from reference_model.simulation import simulate
from robot_model import Beam, EffectUse, InputError, Joint, Link, Reference, Robot, Tube, load_robot


def stiffening(strength: float, at: str = "blade") -> EffectUse:
    return EffectUse.model_validate({"effect": "centrifugal_stiffening", "at": at, "strength": strength})


def rotor(speed: float, *, gravity: float = 1e-3, stiff: bool = False) -> Robot:
    """A blade on a heavy hub that spins at `speed` [rad/s]; a weak field across it makes it ring."""
    beam = Beam(
        length=2.0,
        section=Tube(outer_diameter=0.02, inner_diameter=0.018),
        young=70e9,
        shear=27e9,
        density=2700.0,
        elements=12,
        modes=4,
        stiffening=stiff,
    )
    return Robot(
        name="rotor",
        gravity=(0.0, 0.0, -gravity),
        links=(Link(name="blade", mass=1.0, inertia=(1e6, 1e6, 1e6), beam=beam),),
        joints=(Joint(name="hub", parent="base", child="blade", initial_velocity=speed),),
        reference=Reference(duration=2.0, sample_rate=200.0),
    )


def frequency(robot: Robot) -> float:
    """First frequency out of the plane of rotation [rad/s]."""
    recording = simulate(robot, sensors=False, rtol=1e-10, atol=1e-14)
    names = [f"blade.modal_coordinate.{k}" for k in range(1, 5)]
    x = max((recording[name] for name in names), key=lambda column: float(np.ptp(column)))
    # Two modes of the plane of z ring; the first has 98 % of the amplitude. Their poles by least squares.
    rows = np.column_stack([x[3:-1], x[2:-2], x[1:-3], x[:-4], np.ones(len(x) - 4)])
    weights = np.linalg.lstsq(rows, x[4:], rcond=None)[0][:4]
    poles = np.abs(np.log(np.roots([1.0, *-weights]).astype(complex)) * 200.0)
    return float(poles.min())


@pytest.mark.parametrize("strength", [0.4, 1.0])
def test_the_square_of_the_frequency_rises_by_southwells_slope(strength: float) -> None:
    still, speed = frequency(rotor(0.0)), 4.0
    spinning = frequency(rotor(speed).with_effects(stiffening(strength)))
    without = frequency(rotor(speed))
    # 1.193 Omega^2 of a uniform clamped beam out of the plane (Southwell), at a tenth of the frequency; two
    # modes and twelve lumped elements leave 0.5 % of it, and fits of frequencies as much.
    assert (spinning**2 - still**2) / speed**2 == pytest.approx(1.193 * strength, abs=0.02)
    assert (without**2 - still**2) / speed**2 == pytest.approx(0.0, abs=0.01)


def test_at_strength_one_it_equals_a_stiffening_beam() -> None:
    effect = simulate(rotor(5.0, gravity=1.0).with_effects(stiffening(1.0)), sensors=False)
    described = simulate(rotor(5.0, gravity=1.0, stiff=True), sensors=False)
    for name in described.channels:
        np.testing.assert_array_equal(effect[name], described[name])


def test_without_strength_nothing_changes() -> None:
    absent = simulate(rotor(5.0, gravity=1.0).with_effects(stiffening(0.0)), sensors=False)
    without = simulate(rotor(5.0, gravity=1.0), sensors=False)
    for name in without.channels:
        np.testing.assert_array_equal(absent[name], without[name])


def test_half_the_strength_conserves_energy() -> None:
    robot = rotor(8.0, gravity=2.0).with_effects(stiffening(0.5))
    recording = simulate(robot, sensors=False, work=True, rtol=1e-11, atol=1e-13)
    balance = recording["robot.energy"] - recording["robot.work"]
    # Beside the hub's energy of 3e7 J.
    np.testing.assert_allclose(balance / balance[0], 1.0, rtol=0, atol=1e-10)


def test_link_flexibility_and_stiffening_combine_in_any_order() -> None:
    bends = EffectUse.model_validate({"effect": "link_flexibility", "at": "link2", "period": 0.2})
    robot = load_robot("two_link_arm").with_effects(stiffening(1.0, "link2"), bends)
    body = truth_of(robot).tree.bodies[2].flexible
    assert body is not None
    assert body.foreshortening is not None


@pytest.mark.parametrize(
    ("robot", "use", "sentence"),
    [
        (load_robot("two_link_arm"), stiffening(1.0, "link2"), "is not a beam"),
        (rotor(1.0, stiff=True), stiffening(1.0), "already has stiffening"),
    ],
)
def test_links_that_cannot_stiffen_are_refused(robot: Robot, use: EffectUse, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        simulate(robot.with_effects(use))
