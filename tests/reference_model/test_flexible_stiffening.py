"""Foreshortening of a bent beam, and the resulting stiffening of a spinning beam."""

from __future__ import annotations

import numpy as np
import pytest
from flexible_links import LENGTH, beam_link, bending_roots, cantilever
from scipy.optimize import brentq

from reference_model.flexible import FlexibleBody, flexible_body

#: Terms of the power series; at twelve times the unit speed their sum has long settled.
TERMS = 80


def end_moments(square: float, speed: float) -> float:
    """Zero at the squared frequencies of a uniform beam clamped to the axis about which it spins.

    Out of the plane w'''' - Omega^2/2 ((1 - x^2) w')' = mu^2 w, lengths in L, frequencies in
    sqrt(EI / (rho A L^4)). Solved by the power series of the two solutions that are clamped at x = 0; the
    determinant of their moments and shear forces at x = 1 is returned.
    """
    moments, shears = [], []
    for free in (2, 3):
        a = np.zeros(TERMS + 4)
        a[free] = 1.0
        for n in range(TERMS):
            load = speed**2 / 2 * ((n + 2) * (n + 1) * a[n + 2] - n * (n + 1) * a[n]) + square * a[n]
            a[n + 4] = load / ((n + 4) * (n + 3) * (n + 2) * (n + 1))
        n = np.arange(TERMS + 4)
        moments.append((n * (n - 1) * a).sum())
        shears.append((n * (n - 1) * (n - 2) * a).sum())
    return float(moments[0] * shears[1] - moments[1] * shears[0])


def exact(speed: float) -> float:
    """First frequency out of the plane; 3.516, 3.682, 4.137, 4.797 at speeds 0, 1, 2, 3."""
    low, high = 10.0, 13.0 + 1.3 * speed**2  # it is near 12.36 + 1.193 Omega^2, below at high speed
    return float(np.sqrt(brentq(end_moments, low, high, args=(speed,), xtol=1e-10)))


def stiff_body(elements: int = 64, modes: int = 16, **keys: object) -> FlexibleBody:
    return flexible_body(beam_link(elements=elements, modes=modes, stiffening=True, **keys))


def unit_speed(body: FlexibleBody) -> float:
    """sqrt(EI / (rho A L^4)) of the mesh as it is, so that only the modes' shapes are compared."""
    return float(body.frequencies[0] / bending_roots(cantilever(), 1)[0] ** 2)


def spinning(body: FlexibleBody, speed: float) -> tuple[float, float]:
    """First frequencies out of and in the plane of a rotation about z through the root [rad/s].

    The axial shift of a node of mass m at radius r costs Omega^2 m r of work; in the plane, the modes'
    own distance from the axis gives back Omega^2 m v^2.
    """
    assert body.foreshortening is not None
    gained = np.einsum("n,n,nst->st", body.node_masses, body.nodes[:, 0], body.foreshortening)
    across = body.translations[:, 1]
    lost = np.einsum("n,ns,nt->st", body.node_masses, across, across)
    out = body.stiffness + speed**2 * gained
    planes = [np.abs(body.translations[body.tip, axis]) > 0 for axis in (2, 1)]
    squares = [
        np.linalg.eigvalsh(matrix[np.ix_(plane, plane)])[0]
        for matrix, plane in zip((out, out - speed**2 * lost), planes)
    ]
    return float(np.sqrt(squares[0])), float(np.sqrt(squares[1]))


@pytest.mark.parametrize("speed", [0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 12.0])
def test_frequencies_of_a_spinning_beam(speed: float) -> None:
    """To 2e-4: eight modes in each plane and 64 lumped elements leave less than that."""
    body = stiff_body()
    unit, expected = unit_speed(body), exact(speed)
    out, within = spinning(body, speed * unit)
    assert out / unit == pytest.approx(expected, rel=2e-4)
    assert within / unit == pytest.approx(np.sqrt(expected**2 - speed**2), rel=4e-4)


def test_southwells_coefficients() -> None:
    """w^2 grows by 1.193 Omega^2 out of the plane and by 0.193 Omega^2 in it while Omega is small."""
    assert (exact(0.05) ** 2 - exact(0.0) ** 2) / 0.05**2 == pytest.approx(1.193, abs=1e-3)
    body = stiff_body()
    first = body.frequencies[0]
    speed = 0.01 * first
    out, within = spinning(body, speed)
    assert (out**2 - first**2) / speed**2 == pytest.approx(1.193, abs=2e-3)
    assert (within**2 - first**2) / speed**2 == pytest.approx(0.193, abs=2e-3)


def test_a_tip_force_shortens_the_beam() -> None:
    """P bends v = P (3 L x^2 - x^3) / (6 EI); the tip then moves back by the integral of v'^2 / 2,
    P^2 L^5 / (15 (EI)^2), which the cubic elements give exactly."""
    link = beam_link(elements=5, modes=30, stiffening=True)
    body = flexible_body(link)
    assert link.beam is not None
    assert body.foreshortening is not None
    stiff = link.beam.young * link.beam.section.figures[3]
    x = body.translations[body.tip].T @ np.array([0.0, 1.0, 0.0]) / body.frequencies**2
    assert x @ body.foreshortening[body.tip] @ x / 2 == pytest.approx(LENGTH**5 / (15 * stiff**2), rel=1e-8)
    half = LENGTH / 5 * 2  # at node 2: v' = (2 L x - x^2) / (2 EI)
    exact = (4 * LENGTH**2 * half**3 / 3 - LENGTH * half**4 + half**5 / 5) / (8 * stiff**2)
    assert x @ body.foreshortening[2] @ x / 2 == pytest.approx(exact, rel=1e-8)


def test_foreshortening_grows_from_the_root_and_is_symmetric() -> None:
    found = stiff_body(elements=6, modes=12).foreshortening
    assert found is not None
    assert not found[0].any()
    assert found == pytest.approx(np.swapaxes(found, 1, 2))
    assert np.linalg.eigvalsh(np.diff(found, axis=0)).min() > -1e-12 * np.abs(found).max()


def test_no_foreshortening_without_the_switch() -> None:
    body = flexible_body(beam_link())
    assert body.foreshortening is None
    assert body.axis is None
