"""Inertial numbers of real bodies that do what the data ask of combinations of them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from missing_physics.bodies import realisable
from missing_physics.diagnosis.preparation.setup import InertialBasis
from missing_physics.diagnosis.terms.real_bodies import nearest_real, unreal
from missing_physics.diagnosis.terms.term import BODY_NUMBERS, Term
from missing_physics.diagnosis.written.augment import with_combinations, with_inertial
from reference_model.dynamics.inertial import ten_numbers
from reference_model.effects.catalogue import get_effect
from reference_model.evaluation.model import RobotModel
from robot_model import Robot, load_robot

Array = NDArray[np.float64]

NAMES = (*(f"{body}.{number}" for body in ("one", "two") for number in BODY_NUMBERS), "j.reflected_inertia")
SCALE = np.array([5.0, *[1.0] * 3, *[0.5] * 6] * 2 + [0.1])
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
ARM = load_robot("two_link_arm")


def numbers_of(chance: np.random.Generator) -> Array:
    """Ten numbers of a body of eight random points."""
    masses = chance.uniform(0.2, 1.0, 8)
    places = chance.normal(0.0, 0.2, (8, 3)) + chance.normal(0.0, 0.2, 3)
    about = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, places))
    return np.array([masses.sum(), *(masses @ places), *(about[pair] for pair in PAIRS)])


def least_of(numbers: Array) -> float:
    """Least eigenvalue of the pseudo-inertia."""
    xx, yy, zz, xy, xz, yz = numbers[4:]
    about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    whole = np.zeros((4, 4))
    whole[:3, :3] = 0.5 * np.trace(about) * np.eye(3) - about
    whole[:3, 3] = whole[3, :3] = numbers[1:4]
    whole[3, 3] = numbers[0]
    return float(np.linalg.eigvalsh(whole)[0])


@given(seed=st.integers(0, 2**32 - 1), seen=st.integers(1, 12))
@settings(max_examples=40)
def test_combinations_of_real_bodies_are_found_again_with_real_bodies(seed: int, seen: int) -> None:
    chance = np.random.default_rng(seed)
    described, true = (
        np.concatenate([numbers_of(chance), numbers_of(chance), chance.uniform(0.0, 0.2, 1)]) for _ in "ab"
    )
    vectors = np.linalg.qr(chance.normal(size=(len(NAMES), seen)))[0]
    wanted = vectors.T @ ((true - described) / SCALE)
    doubt = np.diag(np.full(seen, 1e-3**2))
    change = nearest_real(NAMES, described, vectors * SCALE[:, None], SCALE, wanted, doubt)
    assert change is not None
    # the weak wish to stay close to what is described moves them by part of a standard deviation
    assert np.abs(vectors.T @ (change / SCALE) - wanted).max() < 3e-3
    found = described + change
    assert least_of(found[:10]) > 0
    assert least_of(found[10:20]) > 0
    assert found[20] >= 0


def test_what_no_real_bodies_do_is_not_found() -> None:
    chance = np.random.default_rng(5)
    described = np.concatenate([numbers_of(chance), numbers_of(chance), [0.1]])
    directions = np.zeros((len(NAMES), 1))
    directions[0] = SCALE[0]
    doubt = np.array([[1e-4]])
    missing = np.array([-1.5 * described[0] / SCALE[0]])  # a negative mass
    assert nearest_real(NAMES, described, directions, SCALE, missing, doubt) is None
    assert nearest_real(NAMES, described, directions, SCALE, -missing, doubt) is not None
    for nowhere in (np.nan, np.inf):  # where a fit went astray
        assert nearest_real(NAMES, described, directions, SCALE, np.array([nowhere]), doubt) is None
    # with one number of a body known nothing is done
    some = [k for k, name in enumerate(NAMES) if name != "two.mass"]
    names = [NAMES[k] for k in some]
    assert nearest_real(names, described[some], directions[some], SCALE[some], -missing, doubt) is None


def test_a_step_that_cannot_be_taken_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """Next to the edge of real bodies a step may come out as no number."""
    chance = np.random.default_rng(5)
    described = np.concatenate([numbers_of(chance), numbers_of(chance), [0.1]])
    directions = np.zeros((len(NAMES), 1))
    directions[0] = SCALE[0]
    monkeypatch.setattr(realisable, "_step", lambda *given: (np.full(len(NAMES), np.nan), 1.0))
    assert nearest_real(NAMES, described, directions, SCALE, np.array([0.5]), np.array([[1e-4]])) is None


def test_a_robot_gets_real_bodies_and_needs_the_torques_that_were_found() -> None:
    """Less of both links, told by base parameters alone: taken from the first moments, no body is real."""
    model = RobotModel(ARM)
    chance = np.random.default_rng(8)
    motion = [chance.normal(size=(40, 2)) for _ in range(3)]
    free = [k for k, name in enumerate(model.inertial_names) if not name.startswith("gravity")]
    names = tuple(model.inertial_names[k] for k in free)
    scale = np.maximum(np.abs(model.inertial[free]), 0.1)
    rows = model.regressor(*motion)[:, :, free].reshape(-1, len(free)) * scale
    _, sizes, vectors = np.linalg.svd(rows, full_matrices=False)
    seen = vectors[sizes > 1e-9 * sizes[0]].T
    basis = InertialBasis(names, np.array(free), seen * scale[:, None], scale)
    less = model.inertial[free].copy()
    less[: 2 * len(BODY_NUMBERS)] *= 0.3
    values = seen.T @ ((less - model.inertial[free]) / scale)
    _, remark = with_inertial(ARM, names, basis.directions @ values)
    assert "not those of real bodies" in remark
    doubt = np.diag((1e-4 * np.abs(values) + 1e-6) ** 2)
    found, remark = with_combinations(ARM, basis, values, doubt)
    assert not remark
    needed = RobotModel(found).inverse_dynamics(*motion)
    whole = model.inertial.copy()
    whole[free] = less
    true = model.inverse_dynamics(*motion, inertial=whole)
    np.testing.assert_allclose(needed, true, atol=2e-3 * np.abs(true).max())
    _, remark = with_combinations(ARM, basis, 10 * values, doubt)
    assert "not those of real bodies" in remark


@pytest.mark.parametrize(
    ("told", "known"),
    [
        ({"first_moment_x": 0.3, "first_moment_z": 9.0, "inertia_yy": -0.02}, True),
        ({"first_moment_x": 0.3, "first_moment_z": 0.2, "inertia_yy": 0.05}, False),
        ({"mass": -20.0}, True),
        ({"inertia_zz": -0.05, "first_moment_x": -0.2}, False),
        ({"inertia_zz": -5.0}, True),
    ],
)
def test_a_body_may_not_have_any_mass_properties(told: dict[str, float], known: bool) -> None:
    assert unreal(ARM, inertia_of("link1", told)) is known


def test_a_load_that_is_written_as_mass_properties_is_real() -> None:
    mass, place = 2.0, np.array([0.6, 0.0, 0.1])
    about = mass * (place @ place * np.eye(3) - np.outer(place, place))
    told = {"mass": mass} | {f"first_moment_{axis}": mass * float(x) for axis, x in zip("xyz", place)}
    told |= {f"inertia_{'xyz'[i]}{'xyz'[j]}": float(about[i, j]) for i, j in PAIRS}
    assert not unreal(ARM, inertia_of("link2", told))
    payload = Term(get_effect("payload"), "link2", {"mass": -50.0, "x": 0.0, "y": 0.0, "z": 0.0})
    assert not unreal(ARM, payload)  # of other effects nothing is said


def inertia_of(link: str, told: dict[str, float], robot: Robot = ARM) -> Term:
    effect = get_effect("inertia")
    unseen = tuple(p.name for p in effect.parameters if p.name not in told)
    values = {p.name: told.get(p.name, 0.0) for p in effect.parameters}
    assert robot.link(link).mass == ten_numbers(robot.link(link))[0]
    return Term(effect, link, values, unseen=unseen)
