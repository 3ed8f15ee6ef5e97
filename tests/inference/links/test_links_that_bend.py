"""Hypotheses about a space robot with a flexible link, from positions and torques."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from missing_physics.diagnosis import Options, Result, diagnose
from missing_physics.hypotheses import BODIES, Hypothesis, Term
from missing_physics.inference import fitted
from missing_physics.inference.torques.columns import added_to_bodies
from missing_physics.inference.torques.data import TorqueData
from missing_physics.standard import fit_standard
from reference_model.effects.base import BodyEffect
from reference_model.effects.catalogue import get_effect
from reference_model.passive.prescribed import prescribed
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording, Robot, load_robot

LENGTH = 8.0
#: Hidden friction [N m].
COULOMB = 8.0


@lru_cache
def space_robot() -> Robot:
    """A free base, a rigid link, and a beam with a load at its tip; viscous friction at both joints."""
    uses = (
        EffectUse(effect="viscous_friction", at=joint, coefficient=20.0) for joint in ("joint1", "joint2")
    )
    return load_robot("flexible_space_robot_planar").model_copy(update={"effects": tuple(uses)})


@lru_cache
def recorded(hidden: EffectUse | None, seed: int) -> Recording:
    """The robot with a hidden effect on two sines a joint, with the noise of its sensors."""
    robot = space_robot() if hidden is None else space_robot().with_effects(hidden)
    generator = np.random.default_rng(seed)
    joints = [
        {
            "joint": joint,
            "kind": "multisine",
            "amplitudes": generator.uniform(0.02, 0.06, 2).tolist(),
            "frequencies": generator.uniform(0.1, 0.4, 2).tolist(),
            "ramp": 2.0,
        }
        for joint in ("joint1", "joint2")
    ]
    data = robot.model_dump(mode="python")
    data["reference"] = {"duration": LENGTH, "sample_rate": 100.0, "joints": joints}
    made = simulate(Robot.model_validate(data), seed=seed)
    kept = [f"joint{k}.{quantity}" for k in (1, 2) for quantity in ("position", "torque")]
    return Recording(made.time, {channel: made[channel] for channel in kept}, f"recording {seed}")


def diagnosed(hidden: EffectUse | None) -> Result:
    fitted, held_out = (recorded(hidden, seed) for seed in (1, 2))
    return diagnose(space_robot(), [fitted], [held_out], options=Options(experiments=False))


def test_flexible_robot_with_a_correct_file_is_consistent() -> None:
    result = diagnosed(None)
    assert result.diagnosis.verdict == "consistent"
    assert not result.diagnosis.findings


def test_friction_at_a_joint_of_a_flexible_robot_is_named_with_its_size() -> None:
    found = diagnosed(EffectUse(effect="coulomb_friction", at="joint1", torque=COULOMB)).diagnosis
    assert [(f.effect, f.location) for f in found.findings] == [("coulomb_friction", "joint1")]
    # torques of some 20 N m are known to 3 parts in 1000 of their rms
    assert found.findings[0].parameters["torque"].value == pytest.approx(COULOMB, rel=0.02)


def test_a_load_at_the_tip_of_a_beam_adds_to_the_mass_there() -> None:
    standard = fit_standard(space_robot(), [recorded(None, 1)])
    data = TorqueData.of(standard, [recorded(None, 1)])
    effect = get_effect("payload")
    assert isinstance(effect, BodyEffect)
    term = Term.of(effect, "link2", {"mass": 3.0, "x": 6.0, "y": 0.0, "z": 0.0})
    places, added, _ = added_to_bodies(term, effect, data.runs[0].model)
    names = [data.runs[0].model.inertial_names[place] for place in places]
    assert added[names.index("link2.tip_mass")] == pytest.approx(3.0)
    loaded = data.with_bodies(data.start, [term])
    tip = data.layout.names.index("link2.tip_mass")
    assert loaded[tip] - data.start[tip] == pytest.approx(3.0)
    assert not data.is_near(loaded, data.start)
    assert data.about(loaded).is_near(loaded, data.about(loaded).about_numbers)


@lru_cache
def shaken(hidden: EffectUse | None, seed: int) -> Recording:
    """The robot on a slow sine a joint and a fast one near the link's frequency of 2.3 Hz."""
    robot = space_robot() if hidden is None else space_robot().with_effects(hidden)
    joints = [
        {
            "joint": joint,
            "kind": "multisine",
            "amplitudes": [0.04, 0.002],
            "frequencies": [slow, 2.0],
            "ramp": 1.0,
        }
        for joint, slow in zip(("joint1", "joint2"), (0.15 + 0.05 * seed, 0.3))
    ]
    data = robot.model_dump(mode="python")
    data["reference"] = {"duration": LENGTH, "sample_rate": 100.0, "joints": joints}
    made = simulate(Robot.model_validate(data), seed=seed)
    kept = [f"joint{k}.{quantity}" for k in (1, 2) for quantity in ("position", "torque")]
    return Recording(made.time, {channel: made[channel] for channel in kept}, f"recording {seed}")


def damped(change: float) -> EffectUse:
    return EffectUse(effect="modal_damping", at="link2", damping_ratio=change)


@lru_cache
def about_the_file(hidden: EffectUse) -> TorqueData:
    data = TorqueData.of(fit_standard(space_robot(), [shaken(hidden, 1)]), [shaken(hidden, 1)])
    return data.about(data.file_values)


def along(data: TorqueData, use: EffectUse) -> np.ndarray:
    """Torques in the band that an effect adds by the reference model, whitened as the rows."""
    run, bare = data.runs[0], space_robot().model_copy(update={"effects": ()})
    state = run.motion.time, run.motion.position, run.motion.velocity, run.motion.acceleration
    made, still = prescribed(bare.with_effects(use), *state), prescribed(bare, *state)
    joints = ("joint1", "joint2")
    full = np.column_stack([made[f"{joint}.torque"] - still[f"{joint}.torque"] for joint in joints])
    return run.rows.nuisance.removed(run.reduce(full))


@pytest.mark.parametrize(
    ("use", "tolerance"),
    [
        (damped(0.01), 1e-6),  # the same equations, integrated in other steps
        # Coriolis forces of what the stiffening changes are left out.
        (EffectUse(effect="centrifugal_stiffening", at="link2", strength=0.5), 0.05),
        # So are those of what wheels change of the base's rates.
        (EffectUse(effect="reaction_wheel", at="base", momentum_x=3.0, momentum_y=-4.0, torque_z=0.1), 0.05),
    ],
)
def test_columns_of_a_link_or_base_equal_the_reference_model(use: EffectUse, tolerance: float) -> None:
    data = about_the_file(damped(0.005))
    values = {k: v for k, v in use.model_dump().items() if k not in ("effect", "at")}
    term = Term.of(get_effect(use.effect), use.at, values)
    found, true = data.columns(term, 0)[:, :, 0], along(data, use)
    assert np.linalg.norm(found - true) < tolerance * np.linalg.norm(true)


def test_faster_decay_of_a_link_is_fitted_as_a_change_of_damping() -> None:
    """Fitted about the damping of the file, then about what was found."""
    change = 0.005  # the file has 0.002 and 0.005
    data = about_the_file(damped(change))
    start = Term.of(get_effect("modal_damping"), "link2", {"damping_ratio": 0.01})
    known = Hypothesis((start,)).taking_from_file(*data.layout.names, BODIES)
    for _ in range(2):
        fit = fitted(data, known)
        known = fit.hypothesis
        data = data.about(data.with_bodies(fit.parameters, known.terms))
    value = known.terms[0].parameters["damping_ratio"]
    assert value == pytest.approx(change, abs=2.0 * fit.deviation("modal_damping@link2.damping_ratio"))
    assert value == pytest.approx(change, rel=0.03)


def test_link_damping_listed_in_the_file_is_not_a_finding() -> None:
    use = damped(0.005)
    robot = space_robot().with_effects(use)
    data = TorqueData.of(fit_standard(robot, [shaken(use, 1)]), [shaken(use, 1)])
    left = np.sqrt(np.mean((data.target(0) - data.nominal(0)) ** 2, axis=0))
    unaware = about_the_file(use)
    before = np.sqrt(np.mean((unaware.target(0) - unaware.nominal(0)) ** 2, axis=0))
    assert np.all(left < 0.2 * before)
    assert np.all(left < 3.0 * np.hypot(data.noise, data.error))


@pytest.mark.proof
@pytest.mark.parametrize("change", [0.02, -0.0015])
def test_wrong_link_damping_is_named(change: float) -> None:
    """The file's modes have damping ratios of 0.002 and 0.005."""
    hidden = damped(change)
    found = diagnose(
        space_robot(), [shaken(hidden, 1)], [shaken(hidden, 2)], options=Options(experiments=False)
    ).diagnosis
    assert [(f.effect, f.location) for f in found.findings] == [("modal_damping", "link2")]
    estimate = found.findings[0].parameters["damping_ratio"]
    low, high = estimate.ci95
    assert low < change < high
    assert high - low < 0.35 * abs(change)  # the delay of the torque is estimated, too
