"""Beams against the closed forms of Euler and Bernoulli."""

from __future__ import annotations

import numpy as np
import pytest
from flexible_links import LENGTH, beam_link, bending_roots, cantilever, free_free, squares_of

from reference_model.flexible import FlexibleBody, flexible_body
from robot_model import Beam, GeneralSection, InputError, Rectangle, StrainGauge, TipBody, load_robot

FLAT = Rectangle(width=0.02, height=0.01)


def body_of(*args: object, **keys: object) -> tuple[FlexibleBody, Beam]:
    link = beam_link(*args, **keys)  # type: ignore[arg-type]
    assert link.beam is not None
    return flexible_body(link), link.beam


@pytest.mark.parametrize(
    ("elements", "first", "second"),
    [(4, 0.8598, 11.56), (8, 0.8628, 11.88), (12, 0.8633, 11.95), (24, 0.8637, 11.98), (48, 0.8638, 11.99)],
)
def test_the_shipped_robot(elements: int, first: float, second: float) -> None:
    """Frequencies computed by a program written before this one, to their printed digits."""
    link = load_robot("flexible_space_robot").link("link2")
    assert link.beam is not None
    link = link.model_copy(update={"beam": link.beam.model_copy(update={"elements": elements})})
    hertz = flexible_body(link).frequencies / (2 * np.pi)
    assert hertz[:2] == pytest.approx([first] * 2, abs=5e-5)
    assert hertz[2:] == pytest.approx([second] * 2, abs=5e-3)


@pytest.mark.parametrize("ratio", [0.0, 0.5, 2.0, 50.0])
def test_cantilever_with_a_mass_at_its_tip(ratio: float) -> None:
    """Lumping is of second order: with 96 elements three frequencies are right to (k h)^2 / 4 < 3e-3."""
    exact = squares_of(body_of()[1], bending_roots(cantilever(ratio), 3))
    errors = []
    mass = ratio * body_of()[1].mass
    for elements in (48, 96):
        body, _ = body_of(elements=elements, tip=TipBody(mass=mass))
        errors.append(np.abs(body.frequencies[::2][:3] ** 2 / exact - 1))
    assert errors[1].max() < 3e-3
    assert errors[0] / errors[1] == pytest.approx([4.0] * 3, rel=0.05)


def test_a_heavy_tip_on_a_light_beam() -> None:
    """Rayleigh's rule, sqrt(3 EI / ((m + 33/140 m_beam) L^3)), is right to 0.1 % for such a beam."""
    mass = 10 * body_of()[1].mass
    body, beam = body_of(elements=48, tip=TipBody(mass=mass))
    stiff = 3 * beam.young * beam.section.figures[3] / LENGTH**3
    assert body.frequencies[0] == pytest.approx(np.sqrt(stiff / (mass + 33 / 140 * beam.mass)), rel=1e-3)


def test_free_beam() -> None:
    exact = squares_of(body_of()[1], bending_roots(free_free, 3))
    errors = [
        np.abs(body_of(elements=n, boundary="free")[0].frequencies[::2] ** 2 / exact - 1) for n in (48, 96)
    ]
    assert errors[1].max() < 5e-3
    assert errors[0] / errors[1] == pytest.approx([4.0] * 3, rel=0.05)


def chain(number: int, elements: int, speed: float) -> float:
    """Frequency of a chain of equal springs and masses, half a mass at its free end: exact as it stands."""
    return 2 * elements / LENGTH * speed * np.sin((2 * number - 1) * np.pi / (4 * elements))


def test_stretching_and_torsion() -> None:
    elements = 10
    body, beam = body_of(FLAT, elements=elements, modes=6 * elements)
    _, torsion, second_y, second_z = FLAT.figures
    twist = np.sqrt(beam.shear * torsion / (beam.density * (second_y + second_z)))
    for speed, row in ((np.sqrt(beam.young / beam.density), 0), (twist, 3)):
        motion = np.concatenate([body.translations, body.rotations], axis=1)[:, row]
        found = body.frequencies[np.abs(motion[body.tip]) > 0]
        exact = [chain(k, elements, speed) for k in range(1, elements + 1)]
        assert found == pytest.approx(exact, rel=1e-9)


def test_tip_inertia_slows_torsion() -> None:
    """A heavy disc at the tip of a light bar: w^2 = G J_t / (L J_disc)."""
    body, beam = body_of(FLAT, elements=4, modes=24, tip=TipBody(mass=0.0, inertia=(5.0, 5.0, 5.0)))
    twisting = np.abs(body.rotations[body.tip, 0]) > 0
    stiff = beam.shear * FLAT.figures[1] / LENGTH
    assert body.frequencies[twisting][0] ** 2 == pytest.approx(stiff / 5.0, rel=1e-4)


@pytest.mark.parametrize("axis", [1, 2])
def test_static_deflection_is_the_sum_over_all_modes(axis: int) -> None:
    """P L^3 / (3 EI), which cubic elements give exactly for loads at nodes."""
    body, beam = body_of(FLAT, elements=24, modes=144)
    shares = body.translations[body.tip, axis] ** 2 / body.frequencies**2
    exact = LENGTH**3 / (3 * beam.young * beam.section.figures[4 - axis])
    assert shares.sum() == pytest.approx(exact, rel=1e-9)
    # The n-th mode of a cantilever contributes 12 / (k_n L)^4: 97.1 % from the first, 2.5 % from the second.
    bending = np.sort(shares)[::-1] / exact
    assert bending[:2] == pytest.approx(12 / bending_roots(cantilever(), 2) ** 4, rel=0.01)


def test_static_stretch() -> None:
    body, beam = body_of(FLAT, elements=6, modes=36)
    stretch = (body.translations[body.tip, 0] ** 2 / body.frequencies**2).sum()
    assert stretch == pytest.approx(LENGTH / (beam.young * beam.section.figures[0]), rel=1e-9)


@pytest.mark.parametrize("place", [0.0, 0.31, 1.0, LENGTH])
def test_strain_of_a_load_at_the_tip(place: float) -> None:
    """Bending moment P (L - x): strain -d (normal . P) (L - x) / EI; stretching F / EA."""
    gauges = tuple(
        StrainGauge(place=place, normal=normal, distance=0.007)
        for normal in ((2.0, 0.0), (0.0, -1.0), (1.0, 1.0))
    )
    body, beam = body_of(FLAT, elements=8, modes=48, gauges=gauges)
    load = np.array([300.0, 5.0, -3.0])
    found = body.strain @ (body.translations[body.tip].T @ load / body.frequencies**2)
    area, _, second_y, second_z = FLAT.figures
    for gauge, strain in zip(gauges, found):
        y, z = np.array(gauge.normal) / np.linalg.norm(gauge.normal)
        bending = y * load[1] / second_z + z * load[2] / second_y
        exact = load[0] / area - 0.007 * bending * (LENGTH - place)
        assert strain == pytest.approx(exact / beam.young, rel=1e-8, abs=1e-12)


def test_a_rectangle_equals_the_general_section_with_its_properties() -> None:
    area, torsion, second_y, second_z = FLAT.figures
    general = GeneralSection(
        area=area, torsion_constant=torsion, second_moment_y=second_y, second_moment_z=second_z
    )
    one, other = body_of(FLAT)[0], body_of(general)[0]
    assert np.array_equal(one.translations, other.translations)
    # Roark's table for a 2 to 1 rectangle: 0.229 a b^3, to its printed digits.
    assert torsion / (0.02 * 0.01**3) == pytest.approx(0.229, abs=5e-4)
    assert area == pytest.approx(2e-4)
    # Width along y makes bending along y, about z, the stiff one.
    assert second_z / second_y == pytest.approx(4.0)


def test_a_skewed_beam_is_the_straight_one_turned() -> None:
    keys = {
        "modes": 12,
        "elements": 6,
        "tip": TipBody(mass=1.0, inertia=(0.1, 0.2, 0.25)),
        "stiffening": True,
    }
    skewed = {"direction": (1.0, 2.0, -2.0), "section_y": (2.0, 1.0, 2.0)}
    one, (other, beam) = body_of(FLAT, **keys)[0], body_of(FLAT, **keys, **skewed)
    turn = beam.axes
    # A mode's sign goes by its largest component, which turning changes.
    signs = np.sign(np.einsum("nas,ab,nbs->s", other.translations, turn, one.translations))
    signs[signs == 0] = np.sign(np.einsum("nas,ab,nbs->s", other.rotations, turn, one.rotations))[signs == 0]
    assert np.linalg.det(turn) == pytest.approx(1.0)
    assert np.abs(other.S1 - turn @ one.S1 * signs).max() < 1e-12
    assert np.abs(other.P - turn @ one.P * signs).max() < 1e-12
    for name in ("E", "F"):
        scale = signs if name == "E" else np.outer(signs, signs)
        expected = turn @ getattr(one, name) @ turn.T * scale[..., None, None]
        assert getattr(other, name) == pytest.approx(expected, abs=1e-12)
    assert other.axis == pytest.approx(turn[:, 0])
    assert other.foreshortening == pytest.approx(one.foreshortening * np.outer(signs, signs), abs=1e-12)
    assert other.nodes == pytest.approx(one.nodes @ turn.T)


def test_damping() -> None:
    body = body_of(damping_ratio=0.01)[0]
    assert body.damping == pytest.approx(np.diag(0.02 * body.frequencies))
    ratios = (0.01, 0.02, 0.0, 0.03, 0.04, 0.05)
    assert np.diag(body_of(damping_ratio=ratios)[0].damping) == pytest.approx(
        2 * np.array(ratios) * body.frequencies
    )
    rayleigh = body_of(rayleigh=(0.3, 1e-4))[0]
    assert np.diag(rayleigh.damping) == pytest.approx(0.3 + 1e-4 * body.frequencies**2)


def test_modes_up_to_a_frequency() -> None:
    all_six = body_of()[0].frequencies / (2 * np.pi)
    between = float(all_six[3] + all_six[4]) / 2
    kept = body_of(modes=None, highest_frequency=between)[0]
    assert kept.frequencies / (2 * np.pi) == pytest.approx(all_six[:4])


def test_no_mode_up_to_a_frequency() -> None:
    with pytest.raises(
        InputError, match=r"'link1': it has no mode up to highest_frequency = 0.001 Hz; raise"
    ):
        body_of(modes=None, highest_frequency=1e-3)


def test_damping_ratios_must_match_the_kept_modes() -> None:
    with pytest.raises(InputError, match="damping_ratio has 5 entries, but 2 modes are kept"):
        body_of(modes=None, highest_frequency=1.0, damping_ratio=(0.1,) * 5)


def test_every_mode_that_a_mesh_has() -> None:
    assert body_of(elements=2, modes=12)[0].count == 12
    free = body_of(elements=2, modes=12, boundary="free")[0]
    assert free.count == 12
    assert np.abs(free.S0).max() < 1e-9


def test_a_place_on_a_beam() -> None:
    body = body_of(elements=4)[0]
    assert body.node_at((1.5, 0.0, 0.0)) == 3
    with pytest.raises(InputError, match=r"\[1.4, 0.0, 0.0\] is no node .* nearest is node 3 at \[1.5"):
        body.node_at((1.4, 0.0, 0.0))
