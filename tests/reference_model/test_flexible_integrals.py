"""The constant integrals against the sums over nodes that define them, and against a rigid bar."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from functools import partial

import numpy as np
import pytest
from flexible_links import LENGTH, beam_link

from reference_model.flexible import FlexibleBody, flexible_body
from reference_model.flexible.attached import attached
from robot_model import Link, Rectangle, StrainGauge, TipBody, Tube

#: Sums of some dozens of products in another order: a few hundred roundings.
ROUNDING = 1e-12


def bodies() -> list[Link]:
    tip = TipBody(mass=1.5, inertia=(0.01, 0.02, 0.015))
    skewed = {"direction": (1.0, 2.0, -2.0), "section_y": (2.0, 1.0, 2.0)}
    flat = Rectangle(width=0.02, height=0.01)
    return [
        beam_link(elements=5, modes=9, tip=tip),
        beam_link(flat, elements=7, modes=8, tip=tip, **skewed),
        beam_link(flat, elements=6, modes=7, boundary="free", tip=tip, **skewed),
    ]


def tilde(a: np.ndarray) -> np.ndarray:
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def points_of(body: FlexibleBody) -> Iterator[tuple[float, np.ndarray, np.ndarray]]:
    """Mass, place and mode shapes of points that make up every node with its inertia and turn with it.

    Two at +-a along each principal axis of an inertia J: their second moments m a a^T are tr(J)/2 - J.
    """
    rows = zip(body.node_masses, body.node_inertias, body.nodes, body.translations, body.rotations)
    for m, J, r, phi, psi in rows:
        moments, axes = np.linalg.eigh(np.trace(J) / 2 * np.eye(3) - J)
        arms = axes * np.sqrt(np.maximum(moments, 0) / 2)
        yield m - 6, r, phi
        for a in np.hstack([arms, -arms]).T:
            yield 1.0, r + a, phi - tilde(a) @ psi


def node_sums(body: FlexibleBody) -> dict[str, np.ndarray]:
    """Model.md 2.5 word by word, of bodies all made of points: none has a rotary inertia of its own."""
    s = body.count
    nodes = [(m, 0.0, r, phi, 0.0) for m, r, phi in points_of(body)]
    return {
        "mass": sum(m for m, *_ in nodes),
        "first_moment": sum(m * r for m, _, r, _, _ in nodes),
        "inertia": sum(-m * tilde(r) @ tilde(r) for m, _, r, _, _ in nodes),
        "S0": sum(m * phi for m, _, _, phi, _ in nodes),
        "S1": sum(m * tilde(r) @ phi for m, _, r, phi, _ in nodes),
        "P": np.zeros((3, s)),
        "E": np.array([sum(m * tilde(r) @ tilde(phi[:, j]) for m, _, r, phi, _ in nodes) for j in range(s)]),
        "D": np.array([sum(m * tilde(phi[:, j]) @ phi for m, _, _, phi, _ in nodes) for j in range(s)]),
        "F": np.array(
            [
                [sum(m * tilde(phi[:, j]) @ tilde(phi[:, k]) for m, _, _, phi, _ in nodes) for k in range(s)]
                for j in range(s)
            ]
        ),
        "h": np.array(
            [
                [sum(m * np.cross(phi[:, k], phi[:, j]) for m, _, _, phi, _ in nodes) for j in range(s)]
                for k in range(s)
            ]
        ),
        "modal_mass": sum(m * phi.T @ phi for m, _, _, phi, _ in nodes),
    }


def scale_of(body: FlexibleBody, name: str, expected: np.ndarray) -> float:
    """What rounding is beside; sums that cancel to nothing in [sqrt(kg) m] are beside the inertia's root."""
    largest = float(np.sqrt(np.abs(body.inertia).max())) if name in ("S0", "S1", "P") else 1e-3
    return max(float(np.abs(expected).max()), largest)


@pytest.mark.parametrize("link", bodies(), ids=["tube", "skewed", "free"])
def test_integrals_are_the_node_sums(link: Link) -> None:
    body = flexible_body(link)
    for name, expected in node_sums(body).items():
        found = getattr(body, name)
        assert np.abs(found - expected).max() <= ROUNDING * scale_of(body, name, expected), name


@pytest.mark.parametrize("link", bodies(), ids=["tube", "skewed", "free"])
def test_a_body_attached_to_a_node_rotates_with_it(link: Link) -> None:
    inertia = np.array([[0.03, 0.004, 0.0], [0.004, 0.02, -0.003], [0.0, -0.003, 0.025]])
    body = attached(flexible_body(link), 3, 0.8, np.zeros(3), inertia)
    for name, expected in node_sums(body).items():
        found = getattr(body, name)
        assert np.abs(found - expected).max() <= ROUNDING * scale_of(body, name, expected), name


@pytest.mark.parametrize("link", bodies(), ids=["tube", "skewed", "free"])
def test_a_cached_body_is_read_only(link: Link) -> None:
    body = flexible_body(link)
    arrays = [getattr(body, field.name) for field in dataclasses.fields(body)]
    assert not [a for a in arrays if isinstance(a, np.ndarray) and a.flags.writeable]
    assert flexible_body(link) is body


def test_mass_properties_are_those_of_a_bar_with_tip_and_hub() -> None:
    tip = TipBody(mass=2.0, inertia=(0.01, 0.02, 0.03))
    hub = {"mass": 3.0, "center_of_mass": (0.1, 0.0, -0.2), "inertia": (0.5, 0.6, 0.7)}
    thick = partial(beam_link, Tube(outer_diameter=0.01), tip=tip, elements=60, modes=2)
    body, alone = flexible_body(thick(**hub)), flexible_body(thick())
    bar = 7800.0 * np.pi / 4 * 0.01**2 * LENGTH
    assert body.mass == pytest.approx(bar + 5.0, rel=1e-12)
    assert body.first_moment == pytest.approx([bar * LENGTH / 2 + 2.0 * LENGTH + 0.3, 0, -0.6], abs=1e-9)
    arm = tilde(np.array(hub["center_of_mass"]))
    assert body.inertia - alone.inertia == pytest.approx(np.diag(hub["inertia"]) - 3.0 * arm @ arm, abs=1e-12)
    # Lumping at 60 elements adds (h/L)^2 / 4 = 7e-5 of m L^2.
    across = bar * LENGTH**2 / 3 + 2.0 * LENGTH**2 + bar * 0.01**2 / 16
    assert alone.inertia == pytest.approx(
        np.diag([bar * 0.01**2 / 8 + 0.01, across + 0.02, across + 0.03]), rel=1e-4, abs=1e-9
    )


def test_a_hub_does_not_take_part_in_clamped_modes() -> None:
    body = flexible_body(beam_link(mass=3.0, inertia=(0.5, 0.6, 0.7)))
    alone = flexible_body(beam_link())
    for name in ("frequencies", "S0", "S1", "E", "F", "D", "P", "h", "translations"):
        assert np.array_equal(getattr(body, name), getattr(alone, name))


def test_modes_vanish_at_a_clamped_root() -> None:
    body = flexible_body(beam_link())
    assert not body.translations[body.root].any()
    assert not body.rotations[body.root].any()


def test_mean_axis_conditions_of_free_modes() -> None:
    """No momentum and no angular momentum in any mode: S0 = 0 and S1 = 0 but for rounding."""
    for section in (Rectangle(width=0.02, height=0.01),):
        body = flexible_body(beam_link(section, boundary="free", modes=12, tip=TipBody(mass=0.7)))
        assert np.abs(body.S0).max() < 1e-9 * np.sqrt(body.mass)
        assert np.abs(body.S1).max() < 1e-9 * np.sqrt(body.inertia[1, 1])
        assert body.frequencies.min() > 1.0
        assert np.abs(body.translations[body.root]).max() > 0.01


def test_repeated_runs_give_the_same_signs_and_the_first_of_a_pair_bends_along_y() -> None:
    link = beam_link(gauges=(StrainGauge(place=0.0, distance=0.005),))
    first = flexible_body(link)
    again = flexible_body(link.model_copy(update={"name": "other"}))
    assert again is not first
    assert np.array_equal(first.translations, again.translations)
    moves = first.translations[first.tip]
    assert moves[1, 0] > 0
    assert moves[2, 0] == 0
    assert moves[1, 1] == 0
    assert moves[2, 1] > 0
