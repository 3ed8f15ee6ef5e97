"""Physically consistent mass properties, as the set in which pseudo-inertias are positive definite.

J = [1/2 tr(I) 1 - I, m c; (m c)^T, m] of the ten parameters of a body about its frame's origin is positive
definite exactly for bodies of positive density (Wensing, Kim, Slotine, "Linear matrix inequalities for
physically consistent inertial parameter identification", IEEE Robotics and Automation Letters 3 (2018)).
Its distance from nominal properties J0 is measured by the log-determinant divergence
D = tr(J0^-1 J) - log det(J0^-1 J) - 4, whose second derivative at J0 is the metric of Lee, Wensing and Park
("Geometric robot dynamic identification", IEEE Transactions on Robotics 36 (2020)): the square of a relative
change, whatever the units. It grows without bound towards the edge of the consistent set.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["COUNT", "divergence", "pseudo_inertia", "sizes", "solid"]

Array = NDArray[np.float64]

#: Parameters of a body: mass, first moment x y z, inertia about the origin xx yy zz xy xz yz.
COUNT = 10
#: Smallest radius of gyration of a body described as a point or a line, as a part of its length: that of a
#: rod with a radius of a twentieth of its length.
THINNEST = 0.05


def _basis() -> Array:
    """Derivative of the pseudo-inertia by each of the ten parameters, shape (10, 4, 4)."""
    found = np.zeros((COUNT, 4, 4))
    found[0, 3, 3] = 1.0
    for axis in range(3):
        found[1 + axis, axis, 3] = found[1 + axis, 3, axis] = 1.0
        found[4 + axis, :3, :3] = 0.5 * np.eye(3)
        found[4 + axis, axis, axis] -= 1.0
    for number, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
        found[7 + number, i, j] = found[7 + number, j, i] = -1.0
    return found


BASIS = _basis()


def pseudo_inertia(ten: Array) -> Array:
    """J of the ten parameters of bodies, (..., 10); shape (..., 4, 4)."""
    return np.asarray(np.tensordot(ten, BASIS, axes=1))


def solid(ten: Array, length: float) -> Array:
    """The nearest ten parameters of a body with extent in every direction.

    Args:
        ten: of a body with mass, possibly a point, a line or a plate, shape (10,).
        length: of the body [m].
    """
    second = pseudo_inertia(ten)
    mass, moment = ten[0], ten[1:4]
    central = second[:3, :3] - np.outer(moment, moment) / mass
    sizes, axes = np.linalg.eigh(central)
    thick = axes @ np.diag(np.maximum(sizes, mass * (THINNEST * length) ** 2)) @ axes.T
    spread = thick + np.outer(moment, moment) / mass
    inertia = np.trace(spread) * np.eye(3) - spread
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return np.array([mass, *moment, *(inertia[pair] for pair in pairs)])


def sizes(ten: Array) -> Array:
    """Scale of each of the ten parameters of a solid body, shape (10,)."""
    mass, inertia = ten[0], float(ten[4:7].max())
    return np.array([mass, *[np.sqrt(mass * inertia)] * 3, *[inertia] * 6])


def divergence(ten: Array, nominal: Array) -> tuple[Array, Array, Array]:
    """D of pairs of bodies, its gradient and its second derivative by `ten`.

    Args:
        ten, nominal: parameters of the bodies, shape (..., 10).

    Returns:
        Shapes (...), (..., 10), (..., 10, 10). Infinite and zero where `ten` is no real body.
    """
    matrix = pseudo_inertia(ten)
    inverse = np.linalg.inv(pseudo_inertia(nominal))
    both = inverse @ matrix
    sign, log = np.linalg.slogdet(both)
    real = (sign > 0) & (np.linalg.eigvalsh(matrix)[..., 0] > 0.0)
    own = np.linalg.inv(np.where(real[..., None, None], matrix, np.eye(4)))
    gradient = np.einsum("kij,...ji->...k", BASIS, inverse - own)
    moved = own[..., None, :, :] @ BASIS
    turned = moved.swapaxes(-1, -2)
    flat = (*ten.shape, 16)
    second = moved.reshape(flat) @ turned.reshape(flat).swapaxes(-1, -2)
    apart = np.trace(both, axis1=-2, axis2=-1) - log - 4.0
    return (
        np.where(real, apart, np.inf),
        np.where(real[..., None], gradient, 0.0),
        np.where(real[..., None, None], second, 0.0),
    )
