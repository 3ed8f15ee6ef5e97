"""Faults revealed by comparing the engines, each tested by a closed form or a balance."""

from __future__ import annotations

import numpy as np
import pytest
from exudyn_robots import cart, joint, pendulum
from flexible_robots import beam, mast

from exudyn_model import simulate
from robot_model import Actuator, Joint, JointPD, Link, Reference


def test_a_rotor_has_energy_but_no_momentum_in_space() -> None:
    rotor = Actuator(gear_ratio=50.0, rotor_inertia=2e-4)
    hinge = joint("hinge", axis=(0.0, 1.0, 0.0), initial_velocity=1.5, actuator=rotor)
    robot = pendulum(joints=(hinge,), gravity=(0.0, 0.0, 0.0))
    found = simulate(robot, sensors=False, formulation="redundant")
    spin = np.sqrt(found["robot.angular_momentum.y"][0] ** 2)
    assert spin == pytest.approx(0.1 * 1.5, rel=1e-9)  # of the rod about its own centre of mass
    whole = 0.1 + 2.0 * 0.25 + 50.0**2 * 2e-4
    assert found["robot.energy"][0] == pytest.approx(0.5 * whole * 1.5**2, rel=1e-9)


def test_a_heavy_bent_beam_conserves_energy_as_it_swings() -> None:
    # Gravity acts on the bent beam where it is: about an undeformed centre of mass it would do other work.
    swing = Joint(name="foot", parent="base", child="pole", axis=(0.0, 1.0, 0.0), initial_velocity=0.4)
    robot = mast(
        links=(Link(name="pole", beam=beam(modes=2)),),
        joints=(swing,),
        gravity=(0.0, 0.0, -3.0),
        reference=Reference(duration=0.15, sample_rate=100.0),
    )
    found = simulate(robot, sensors=False, step=2e-4)
    assert np.abs(found["pole.tip_deflection.z"]).max() > 5e-4
    energy = found["robot.energy"]
    # Of 1 J, of second order in the step; the moment of 3 kg moved by 0.8 mm does 1e-3 J of work.
    np.testing.assert_allclose(energy, energy[0], atol=1e-7)


def test_a_sampled_controller_holds_its_output_not_its_integral() -> None:
    # At rest off its goal the integral grows with time: at a tick t the torque is ki e t.
    far = joint("slide", kind="prismatic", child="body", axis=(1.0, 0.0, 0.0), initial_position=0.0)
    heavy = cart(
        joints=(far,),
        links=(Link(name="body", mass=1e9),),
        controller=JointPD(kp=0.0, ki=2.0, sample_time=0.1),
        reference=Reference.model_validate(
            {
                "duration": 0.5,
                "sample_rate": 20.0,
                "joints": [
                    {"joint": "slide", "kind": "table", "times": [0, 1, 2, 3], "positions": [1, 1, 1, 1]}
                ],
            }
        ),
    )
    found = simulate(heavy, sensors=False)
    held = np.floor(found.time / 0.1 + 1e-9) * 0.1
    between = np.arange(len(held)) % 2 == 1
    np.testing.assert_allclose(found["slide.torque"][between], 2.0 * held[between], rtol=1e-6)
