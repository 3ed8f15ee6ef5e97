"""The compiled integration of added coordinates, and the one that works without a C compiler."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from missing_physics.evaluation.vibration.newmark import newmark, pushed
from reference_model.codegen.compiled import SWITCH

Array = NDArray[np.float64]
INSTANTS, SYSTEMS, JOINTS, COLUMNS, STEP = 400, 3, 4, 5, 2e-3


def positive(generator: np.random.Generator, count: int) -> Array:
    root = generator.normal(size=(count, count))
    return np.asarray(root @ root.T + count * np.eye(count))


def along(generator: np.random.Generator, own: Array) -> Array:
    """Matrices of the coordinates that change by a tenth, with those of the joints below."""
    change = 1.0 + 0.1 * np.sin(np.linspace(0.0, 6.0, INSTANTS))[:, None, None]
    others = generator.normal(size=(INSTANTS, JOINTS, len(own)))
    return np.concatenate([change * own, others], axis=1)


@pytest.mark.parametrize("count", [1, 3, 6])
def test_compiled_integration_gives_the_same_torques_as_numpy(
    count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    generator = np.random.default_rng(count)
    heavy = [positive(generator, count) for _ in range(SYSTEMS)]
    springs = [(1e3 * positive(generator, count), positive(generator, count)) for _ in range(SYSTEMS)]
    mass = [along(generator, own) for own in heavy]
    rate, place = ([along(generator, generator.normal(size=(count, count))) for _ in heavy] for _ in "12")
    force = [generator.normal(size=(INSTANTS, count)) for _ in heavy]
    start = generator.normal(size=(2, SYSTEMS, count, COLUMNS))
    implicit = newmark(np.stack(heavy), np.stack([own for own, _ in springs]), STEP)
    given = mass, rate, place, force, springs, start, STEP, implicit
    compiled = pushed(*given)
    monkeypatch.setenv(SWITCH, "off")
    plain = pushed(*given)
    assert compiled.shape == (INSTANTS, JOINTS, SYSTEMS, COLUMNS)
    # rounding grows with the number of steps only, as the systems are damped
    np.testing.assert_allclose(compiled, plain, rtol=0.0, atol=1e-11 * np.abs(plain).max())


def test_force_acts_on_the_first_column_only() -> None:
    """A coordinate of mass one without spring, pushed by one: its acceleration is one, and zero elsewhere."""
    ones, zeros = np.ones((INSTANTS, 2, 1)), np.zeros((INSTANTS, 2, 1))
    found = pushed(
        [ones],
        [zeros],
        [zeros],
        [np.ones((INSTANTS, 1))],
        [(np.zeros((1, 1)), np.zeros((1, 1)))],
        np.zeros((2, 1, 1, 2)),
        STEP,
        np.full((1, 1, 1), 0.25),
    )
    np.testing.assert_allclose(found[:, 0, 0], np.tile([1.0, 0.0], (INSTANTS, 1)), rtol=1e-12, atol=1e-12)
