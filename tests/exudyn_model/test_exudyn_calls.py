"""The interface of a run besides its recording: progress, early refusals, divergence."""

from __future__ import annotations

import numpy as np
import pytest
from exudyn_robots import cart, joint, pendulum

from exudyn_model import Formulation, check, local_tolerance, simulate
from exudyn_model.simulation import DEFAULT_STEP
from robot_model import EffectUse, InputError, JointPD, load_robot


@pytest.mark.parametrize("formulation", ["tree", "redundant"])
def test_progress_is_reported_at_every_instant_of_the_recording(formulation: Formulation) -> None:
    heard: list[float] = []
    found = simulate(pendulum(), sensors=False, formulation=formulation, progress=heard.append)
    assert heard == pytest.approx(found.time, abs=1e-9)


def test_check_and_simulate_refuse_the_same_robots() -> None:
    arm = load_robot("two_link_arm")
    planar = load_robot("flexible_space_robot_planar")
    elastic = arm.with_effects(EffectUse.model_validate({"effect": "warp_drive", "at": "joint1"}))
    still = arm.model_copy(update={"reference": None})
    for robot, formulation in ((elastic, "auto"), (still, "auto"), (planar, "tree")):
        with pytest.raises(InputError) as beforehand:
            check(robot, formulation=formulation)  # type: ignore[arg-type]
        with pytest.raises(InputError) as running:
            simulate(robot, formulation=formulation)  # type: ignore[arg-type]
        assert str(beforehand.value) == str(running.value)
    check(arm)
    check(planar)


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"integrator": "runge-kuta"}, "integrator = 'runge-kuta' is none of .*; did you mean 'runge-kutta'"),
        ({"formulation": "three"}, "formulation = 'three' is none of auto, .*; did you mean 'tree'"),
        ({"flexible": "beams"}, "flexible = 'beams' is none of modal, beam; did you mean 'beam'"),
    ],
)
def test_an_unknown_word_in_a_setting_is_refused(settings: dict[str, str], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        simulate(pendulum(), **settings)  # type: ignore[arg-type]


@pytest.mark.parametrize("formulation", ["tree", "redundant"])
def test_a_diverging_run_is_reported_with_its_time_and_last_state(formulation: Formulation) -> None:
    # A negative gain drives the slide beyond the speed at which a run is given up.
    hinge = joint("slide", kind="prismatic", child="body", axis=(1.0, 0.0, 0.0), initial_velocity=9.9e3)
    wild = cart(joints=(hinge,), controller=JointPD(kp=-1e6, kd=0.0))
    with pytest.raises(InputError, match=r"diverges after 0\.0\d+ s \(slide at .* moving .*\); lower"):
        simulate(wild, formulation=formulation)


def test_a_smaller_tolerance_reduces_the_steps() -> None:
    """A swing at steps of 5 ms, which error control cuts only where it is asked for more than they give."""
    swing = pendulum(joints=(joint("hinge", axis=(0.0, 1.0, 0.0), initial_position=0.5),))
    fine, loose, tight = (
        simulate(swing, sensors=False, step=step, tolerance=tolerance)["hinge.position"]
        for step, tolerance in ((2e-4, 1.0), (5e-3, 1.0), (5e-3, 1e-9))
    )
    assert np.abs(tight - fine).max() < 0.1 * np.abs(loose - fine).max()


def test_tolerance_scales_with_the_cube_of_the_step() -> None:
    arm = load_robot("two_link_arm")
    whole = local_tolerance(arm, DEFAULT_STEP)
    assert local_tolerance(arm, DEFAULT_STEP / 2) == pytest.approx(whole / 8)
    assert local_tolerance(arm, 2 * DEFAULT_STEP) == whole
