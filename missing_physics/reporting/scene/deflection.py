"""Flexible links as bent lines: for drawing only.

A link is drawn from the deflection of its tip, which simulations and recordings contain. Between root
and tip it has the shape to which a force at its tip bends a clamped Euler-Bernoulli beam,
w(s) = (3 s^2 - s^3) / 2 with s from 0 at the root to 1 at the tip, so higher modes are visible at the tip
only. All values are in m and in the link's frame.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from robot_model import InputError, Link, read_modal_file

__all__ = ["bent_line", "held_by", "line_of", "magnification", "tip_of"]

Array = NDArray[np.float64]

#: Points of a drawn line.
POINTS = 17
#: The largest drawn deflection as a fraction of the link's length: clearly visible, but recognisable.
SHOWN = 0.12


def tip_of(link: Link) -> Array:
    """The undeformed tip of a flexible link, shape (3,)."""
    if link.beam is not None:
        return np.asarray(link.beam.nodes[-1], dtype=float)
    if link.modal is not None:
        nodes = _nodes(link.modal.file)
        return np.asarray(nodes[-1 if link.modal.tip is None else link.modal.tip], dtype=float)
    raise InputError(f"link '{link.name}' is rigid; only flexible links have a tip that deflects.")


def line_of(link: Link) -> Array:
    """The undeformed link as points from its root to its tip, shape (POINTS, 3)."""
    return np.linspace(0.0, 1.0, POINTS)[:, None] * tip_of(link)


def bent_line(link: Link, deflection: Array) -> Array:
    """The link as a line at N deflections of its tip.

    Args:
        link: a flexible link.
        deflection: of the tip as drawn, shape (N, 3).

    Returns:
        Shape (N, POINTS, 3).
    """
    bent: Array = line_of(link) + _share(np.linspace(0.0, 1.0, POINTS))[:, None] * deflection[:, None, :]
    return bent


def held_by(link: Link, origin: Array, deflection: Array) -> tuple[Array, Array]:
    """Displacement and rotation of a point on the link.

    Args:
        link: a flexible link.
        origin: the undeformed place, shape (3,).
        deflection: of the tip, shape (N, 3).

    Returns:
        Displacement (N, 3) and rotation (N, 3, 3), the turn by the slope w'(s) of the line there.
    """
    tip = tip_of(link)
    length = float(np.linalg.norm(tip))
    s = np.clip(float(origin @ tip) / length**2, 0.0, 1.0)
    slope = (6 * s - 3 * s**2) / 2 / length
    turns = np.cross(tip / length, slope * deflection)
    return _share(s) * deflection, np.asarray(Rotation.from_rotvec(turns).as_matrix())


def magnification(links: tuple[Link, ...], deflections: tuple[Array, ...]) -> float:
    """Factor on all drawn deflections, 1, 2 or 5 times a power of ten, to make the largest clearly visible.

    Args:
        links: flexible links.
        deflections: of the tip of each, shape (N, 3); NaN where unknown.

    Returns:
        The largest such factor with which none is drawn beyond `SHOWN` of its link's length; at least 1,
        and 1 where nothing deflects.
    """
    shares = [
        float(np.nanmax(np.linalg.norm(moved, axis=1), initial=0.0)) / float(np.linalg.norm(tip_of(link)))
        for link, moved in zip(links, deflections)
    ]
    largest = max(shares, default=0.0)
    if not largest > 0.0:
        return 1.0
    wanted = SHOWN / largest
    power = 10.0 ** np.floor(np.log10(wanted))
    step = max(step for step in (1.0, 2.0, 5.0) if step * power <= wanted * (1 + 1e-12))
    return max(1.0, float(step * power))


def _share(s: Array | float) -> Array:
    """w(s) of a tip that moves by 1."""
    s = np.asarray(s, dtype=float)
    return (3 * s**2 - s**3) / 2


@lru_cache(maxsize=16)
def _nodes(file: str) -> Array:
    return read_modal_file(file).nodes
