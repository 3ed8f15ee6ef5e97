"""A load on a link, a link with wrong mass properties, and a robot file with errors everywhere."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from missing_physics.answer.bodies import _BodyLikelihood, _point_mass
from missing_physics.diagnosis import Diagnosis, Options, diagnose
from reference_model.simulation import simulate
from robot_model import EffectUse, Link, Robot

LOAD = EffectUse(effect="payload", at="link2", mass=0.6, x=0.4, y=0.0, z=0.0)


def off(robot: Robot, factors: Mapping[str, float]) -> Robot:
    """The robot with links that are heavier by these factors, centres and shapes kept."""

    def changed(link: Link) -> Link:
        factor = factors.get(link.name, 1.0)
        inertia = tuple(factor * part for part in link.inertia)
        return link.model_copy(update={"mass": factor * link.mass, "inertia": inertia})

    return robot.model_copy(update={"links": tuple(changed(link) for link in robot.links)})


def diagnosed(file: Robot, machine: Robot, seed: int = 1) -> Diagnosis:
    return diagnose(file, [simulate(machine, seed=seed)], options=Options(experiments=False)).diagnosis


def test_a_load_is_named_with_its_mass_and_place(arm: Robot) -> None:
    found = diagnosed(arm, arm.with_effects(LOAD))
    [finding] = found.findings
    assert (finding.effect, finding.location) == ("payload", "link2")
    assert finding.probability > 0.5
    for name in ("mass", "x"):
        low, high = finding.parameters[name].ci95
        assert low < LOAD.parameters[name] < high
        assert high - low < 0.1 * LOAD.parameters[name]
    assert found.verdict == "explained"


def test_missing_rotor_inertias_are_not_named_as_a_load(arm: Robot) -> None:
    """As in every URDF: the first joint's rotor turns about the axis of the first link."""
    bare = tuple(
        joint.model_copy(update={"actuator": joint.actuator.model_copy(update={"rotor_inertia": 0.0})})
        for joint in arm.joints
        if joint.actuator is not None
    )
    found = diagnosed(arm.model_copy(update={"joints": bare}), arm.with_effects(LOAD))
    named = {(f.effect, f.location) for f in found.findings}
    assert ("payload", "link2") in named
    assert not {at for effect, at in named if effect in ("payload", "inertia")} - {"link2"}


def test_tilted_mounting_is_named(arm: Robot) -> None:
    """Six degrees in the plane in which it moves, where an offset of the first encoder does the same."""
    tilt = np.radians(6.0)
    turned = (9.81 * np.sin(tilt), 0.0, -9.81 * np.cos(tilt))
    found = diagnosed(arm, arm.model_copy(update={"gravity": tuple(map(float, turned))}))
    [finding] = found.findings
    names = {finding.effect, *(rival.split("@")[0] for rival in finding.ambiguous_with)}
    assert "gravity" in names
    assert names <= {"gravity", "sensor_offset"}


@pytest.mark.parametrize("seed", [1, 2])
def test_errors_of_all_masses_are_not_named_as_a_load(arm: Robot, seed: int) -> None:
    random = np.random.default_rng(seed)
    file = off(arm, {link.name: float(np.exp(0.06 * random.standard_normal())) for link in arm.links})
    found = diagnosed(file, arm, seed)
    assert not {f.effect for f in found.findings} & {"payload", "inertia"}


def test_single_link_with_wrong_inertia_is_named(arm: Robot) -> None:
    """Twice as heavy: no point mass changes mass, first moment and inertia in one proportion."""
    found = diagnosed(off(arm, {"link2": 0.5}), arm)
    labels = {(f.effect, f.location): f for f in found.findings}
    assert set(labels) <= {("inertia", "link2"), ("payload", "link2")}
    [finding] = labels.values()
    assert "inertia" in (finding.effect, *finding.ambiguous_with)


def test_a_point_mass_has_the_moments_of_its_definition() -> None:
    load = np.array([0.7, 0.3, -0.2, 0.5])
    ten, jacobian = _point_mass(load)
    mass, place = load[0], load[1:]
    inertia = mass * (place @ place * np.eye(3) - np.outer(place, place))
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    assert ten[0] == mass
    assert ten[1:4] == pytest.approx(mass * place)
    assert ten[4:] == pytest.approx([inertia[pair] for pair in pairs])
    step = 1e-6  # derivatives by a difference err by a step times a second derivative below one
    for k in range(4):
        moved = load + step * np.eye(4)[k]
        assert jacobian[:, k] == pytest.approx((_point_mass(moved)[0] - ten) / step, abs=1e-5)


@pytest.mark.parametrize(("accuracy", "wrong"), [(0.1, ()), (0.3, ()), (0.1, (0,))])
def test_evidence_equals_the_integral_over_the_inertial_parameters(
    accuracy: float, wrong: tuple[int, ...]
) -> None:
    """In two of the ten dimensions of one body, against a sum over a grid, exact for Gaussians."""
    random = np.random.default_rng(0)
    precision, slope = np.zeros((10, 10)), np.zeros(10)
    part = random.standard_normal((2, 2))
    precision[:2, :2], slope[:2] = 40.0 * part @ part.T, random.standard_normal(2) * 5.0
    values, vectors = np.linalg.eigh(precision)
    known = _BodyLikelihood(np.eye(10)[None], vectors, np.maximum(values, 0.0), vectors.T @ slope)
    width = 1.0 if wrong else accuracy
    grid = np.linspace(-6.0 * width, 6.0 * width, 801)
    z = np.stack(np.meshgrid(grid, grid, indexing="ij"), axis=-1)
    energy = z @ slope[:2] - 0.5 * np.einsum("...i,ij,...j", z, precision[:2, :2], z)
    prior = np.exp(-0.5 * (z**2).sum(axis=-1) / width**2) / (2.0 * np.pi * width**2)
    total = np.sum(np.exp(energy) * prior) * (grid[1] - grid[0]) ** 2
    assert known.evidence(accuracy, wrong) == pytest.approx(np.log(total), abs=1e-6)
