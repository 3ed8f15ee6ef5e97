"""Flexible links, as data: a straight beam by its section, or the modes of an external FE model."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag, model_validator

from robot_model.input.fields import (
    Description,
    Flag,
    NonNegative,
    Number,
    Positive,
    Vector,
    one_or_several,
    triangle_fault,
)

__all__ = [
    "Beam",
    "GeneralSection",
    "ModalBody",
    "Rectangle",
    "Section",
    "SprungMass",
    "StrainGauge",
    "TipBody",
    "Tube",
]

#: More elements than any beam needs: frequencies of the first modes converge within ten.
MOST_ELEMENTS = 512

#: A direction whose largest component is below this counts as missing [-].
SHORTEST_DIRECTION = 1e-9

#: Cosine between a beam's axis and its section's y axis above which the two are no longer perpendicular.
SQUARE = 1e-6

Count = Annotated[int, Field(strict=True, ge=1, le=MOST_ELEMENTS)]
Fraction = Annotated[float, Field(strict=True, ge=0, lt=1)]
Index = Annotated[int, Field(strict=True, ge=0)]

# The discriminators keep an error to the form that was meant.
Fractions = Annotated[
    Annotated[Fraction, Tag("number")] | Annotated[tuple[Fraction, ...], Field(min_length=1), Tag("list")],
    Discriminator(one_or_several),
]
Indices = Annotated[
    Annotated[Index, Tag("number")] | Annotated[tuple[Index, ...], Field(min_length=1), Tag("list")],
    Discriminator(one_or_several),
]


class Tube(Description):
    """A round tube, or a round bar when `inner_diameter` is zero."""

    kind: Literal["tube"] = "tube"
    outer_diameter: Positive = Field(description="outer diameter [m]")
    inner_diameter: NonNegative = Field(default=0.0, description="inner diameter [m]")

    @model_validator(mode="after")
    def _hollow(self) -> Tube:
        if self.inner_diameter >= self.outer_diameter:
            raise ValueError(
                f"inner_diameter {self.inner_diameter:g} m must be below outer_diameter "
                f"{self.outer_diameter:g} m"
            )
        return self

    @property
    def figures(self) -> tuple[float, float, float, float]:
        """Area [m^2], torsion constant, second moments of area about the section's y and z axis [m^4]."""
        area = math.pi / 4 * (self.outer_diameter**2 - self.inner_diameter**2)
        moment = math.pi / 64 * (self.outer_diameter**4 - self.inner_diameter**4)
        return area, 2 * moment, moment, moment


class Rectangle(Description):
    """A solid rectangle."""

    kind: Literal["rectangle"] = "rectangle"
    width: Positive = Field(description="size along the section's y axis [m]")
    height: Positive = Field(description="size along the section's z axis [m]")

    @property
    def figures(self) -> tuple[float, float, float, float]:
        """Area [m^2], torsion constant, second moments of area about the section's y and z axis [m^4].

        The torsion constant is Roark's approximation, a b^3 (1/3 - 0.21 b/a (1 - b^4/(12 a^4))), a >= b.
        """
        long, short = max(self.width, self.height), min(self.width, self.height)
        ratio = short / long
        torsion = long * short**3 * (1 / 3 - 0.21 * ratio * (1 - ratio**4 / 12))
        area = self.width * self.height
        return area, torsion, self.width * self.height**3 / 12, self.height * self.width**3 / 12


class GeneralSection(Description):
    """Any section, by its properties; y and z are principal axes."""

    kind: Literal["general"] = "general"
    area: Positive = Field(description="area of the section [m^2]")
    torsion_constant: Positive = Field(description="torsion constant [m^4]")
    second_moment_y: Positive = Field(
        description="second moment of area about the section's y axis, for bending along z [m^4]"
    )
    second_moment_z: Positive = Field(
        description="second moment of area about the section's z axis, for bending along y [m^4]"
    )

    @property
    def figures(self) -> tuple[float, float, float, float]:
        """Area [m^2], torsion constant, second moments of area about the section's y and z axis [m^4]."""
        return self.area, self.torsion_constant, self.second_moment_y, self.second_moment_z


Section = Annotated[Tube | Rectangle | GeneralSection, Field(discriminator="kind")]


class TipBody(Description):
    """A payload fixed to the far end of a beam; its mass takes part in the modes."""

    mass: NonNegative = Field(default=0.0, description="mass, at the beam's tip [kg]")
    inertia: tuple[NonNegative, NonNegative, NonNegative] = Field(
        default=(0.0, 0.0, 0.0),
        description="moments of inertia about the beam's axis and the section's y and z axis [kg m^2]",
    )

    @model_validator(mode="after")
    def _physical(self) -> TipBody:
        if fault := triangle_fault(*sorted(self.inertia)):
            raise ValueError(fault)
        return self


class StrainGauge(Description):
    """A gauge along the beam's axis, glued to its surface. Gauge N gives the channel LINK.strain.N.

    It measures the strain of bending and stretching: u' - normal . (v'', w'') * distance.
    """

    place: NonNegative = Field(description="distance from the beam's root [m]")
    normal: tuple[Number, Number] = Field(
        default=(1.0, 0.0), description="outward normal in the section's y and z axes; made a unit vector [-]"
    )
    distance: Positive = Field(description="distance of the gauge from the neutral axis [m]")

    @model_validator(mode="after")
    def _sound(self) -> StrainGauge:
        if max(map(abs, self.normal)) < SHORTEST_DIRECTION:
            raise ValueError(f"normal has zero length (it is {list(self.normal)})")
        return self


class Modes(Description):
    """Number and damping of a flexible body's modes."""

    modes: Count | None = Field(default=None, description="number of modes that are kept, lowest first")
    highest_frequency: Positive | None = Field(
        default=None, description="keep the modes up to this natural frequency, instead of `modes` [Hz]"
    )
    boundary: Literal["clamped", "free"] = Field(
        default="clamped",
        description="modes of the body clamped at its root, or of the free body",
    )
    damping_ratio: Fractions = Field(
        default=0.0, description="damping ratio of all modes, or of each that is kept [-]"
    )
    rayleigh: tuple[NonNegative, NonNegative] | None = Field(
        default=None,
        description="damping matrix a M + b K instead of `damping_ratio`: a [1/s] and b [s]",
    )

    @model_validator(mode="after")
    def _one_choice(self) -> Modes:
        if (self.modes is None) == (self.highest_frequency is None):
            raise ValueError("give either modes (their number) or highest_frequency (in Hz)")
        if self.rayleigh is not None and np.any(self.damping_ratio):
            raise ValueError("give either damping_ratio or rayleigh, not both")
        given = self.damping_ratio
        if isinstance(given, tuple) and self.modes is not None and len(given) != self.modes:
            raise ValueError(
                f"damping_ratio has {len(given)} entries but modes = {self.modes}; a single number is for all"
            )
        return self


class Beam(Modes):
    """A straight Euler-Bernoulli beam that begins at the link's frame, by lumped-mass finite elements.

    A joint on it must sit at one of its nodes, which are evenly spaced along it. The link's own `mass`,
    `center_of_mass` and `inertia` are a rigid hub at the root, in addition to the beam.
    """

    length: Positive = Field(description="length [m]")
    direction: Vector = Field(
        default=(1.0, 0.0, 0.0), description="from root to tip in the link's frame; made a unit vector [-]"
    )
    section_y: Vector = Field(
        default=(0.0, 1.0, 0.0),
        description="the section's y axis in the link's frame, perpendicular to `direction` [-]",
    )
    section: Section = Field(description="the cross-section")
    young: Positive = Field(description="Young's modulus [Pa]")
    shear: Positive = Field(description="shear modulus [Pa]")
    density: Positive = Field(description="density [kg/m^3]")
    elements: Count = Field(default=12, description="number of finite elements")
    tip: TipBody = Field(default=TipBody(), description="payload at the tip")
    stiffening: Flag = Field(
        default=False, description="geometric stiffening: account for the foreshortening that bending causes"
    )
    gauges: tuple[StrainGauge, ...] = Field(default=(), description="strain gauges")

    @model_validator(mode="after")
    def _sound(self) -> Beam:
        for key in ("direction", "section_y"):
            if max(map(abs, getattr(self, key))) < SHORTEST_DIRECTION:
                raise ValueError(f"{key} has zero length (it is {list(getattr(self, key))})")
        x, y = _unit(self.direction), _unit(self.section_y)
        if abs(float(x @ y)) > SQUARE:
            raise ValueError(
                f"section_y {list(self.section_y)} is not perpendicular to direction {list(self.direction)}"
            )
        free = 6 * (self.elements if self.boundary == "clamped" else self.elements + 1)
        rigid = 0 if self.boundary == "clamped" else 6
        if self.modes is not None and self.modes > free - rigid:
            raise ValueError(
                f"modes = {self.modes}, but {self.elements} elements have {free - rigid} of them"
            )
        for gauge in self.gauges:
            if gauge.place > self.length:
                raise ValueError(f"gauges: place {gauge.place:g} m lies beyond length {self.length:g} m")
        return self

    @property
    def axes(self) -> NDArray[np.float64]:
        """Unit vectors of the beam's axis and the section's y and z axis in the link's frame, as columns."""
        x, y = _unit(self.direction), _unit(self.section_y)
        y = _unit(tuple(y - (x @ y) * x))
        return np.column_stack([x, y, np.cross(x, y)])

    @property
    def nodes(self) -> NDArray[np.float64]:
        """Positions of the nodes in the link's frame, root first [m], shape (elements + 1, 3)."""
        return np.linspace(0.0, self.length, self.elements + 1)[:, None] * self.axes[:, 0]

    @property
    def mass(self) -> float:
        """Mass of the beam without tip and hub [kg]."""
        return self.density * self.section.figures[0] * self.length


class ModalBody(Modes):
    """A flexible body from an external finite element model: an NPZ file of mass and stiffness matrices.

    The file holds `nodes` [m], shape (N, 3), in the link's frame, and `mass` and `stiffness` of the free
    body, square of 6 N rows (three displacements, then three rotations of each node) or 3 N rows
    (displacements only), in SI units; either dense, or sparse as `mass_data`, `mass_indices`, `mass_indptr`
    (compressed rows) and likewise for `stiffness`. With clamped modes the nodes of `root` are fixed to the
    link's frame; nodes without rotations hold a body only if three or more that are not in line are named.
    The link's own `mass`, `center_of_mass` and `inertia` are an additional rigid hub.
    """

    file: str = Field(min_length=1, description="NPZ file, relative to the robot file")
    root: Indices = Field(
        default=0,
        description="index of the node where the joint holds the body, or a list of them; the first is the "
        "joint's",
    )
    tip: Index | None = Field(
        default=None, description="index of the node of `tip_deflection`; default is the last"
    )

    @property
    def roots(self) -> tuple[int, ...]:
        """Indices of all nodes at the root."""
        return self.root if isinstance(self.root, tuple) else (self.root,)


class SprungMass(Description):
    """A point mass on springs at the origin of the link's frame, equal in all directions: a sloshing liquid.

    The link's own `mass`, `center_of_mass` and `inertia` are an additional rigid hub. The channel
    LINK.tip_deflection holds the displacements in the link's axes.
    """

    mass: Positive = Field(description="mass on the springs [kg]")
    frequency: Positive = Field(description="natural frequency while the link is held [Hz]")
    damping_ratio: NonNegative = Field(default=0.0, description="damping ratio [-]")


def _unit(vector: tuple[float, ...]) -> NDArray[np.float64]:
    array = np.asarray(vector, dtype=float)
    array = array / np.max(np.abs(array))  # so that squares of huge components do not overflow
    return array / np.linalg.norm(array)
