"""Vibration of links that no encoder observes, as correlated noise that is removed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["UNKNOWN", "Vibration"]

Array = NDArray[np.float64]

#: Vibrations smaller than this fraction of the largest one are ignored [-].
VISIBLE = 1e-4
#: Prior standard deviation of the initial vibration, in units of the noise of a complete recording [-].
UNKNOWN = 1e4


@dataclass(frozen=True)
class Vibration:
    """Vibration of links in one recording, not observed by encoders, as correlated noise; n channels.

    Links may vibrate from the start, and encoder noise, differentiated twice, excites them further. With
    white noise of covariance 1/W and columns N of vibrations with prior variances, the covariance of the
    series is 1/W + N N^T, and everything compared is whitened by its inverse root.

    Attributes:
        root: square root of the weights, shape (K, n); zero where nothing is compared.
        basis: orthonormal directions of the weighted columns, shape (K n, R).
        taken: fraction of each direction that is removed, shape (R,).
    """

    root: Array
    basis: Array
    taken: Array

    @classmethod
    def of(cls, columns: Array, weight: Array, spread: Array | None = None) -> Vibration:
        """The vibration from columns and weights.

        Args:
            columns: shape (K, n, V).
            weight: inverse variance of the white noise, (K, n); zero where nothing is compared.
            spread: standard deviation of each column's amplitude, (V,); infinite when None.
        """
        root = np.sqrt(weight)
        flat = (columns * root[:, :, None]).reshape(root.size, -1)
        size = np.sqrt((flat**2).sum(axis=0))
        visible = size > VISIBLE * size.max(initial=0.0)
        if not visible.any():
            return cls(root, np.zeros((root.size, 0)), np.zeros(0))
        wide = np.full(visible.sum(), np.inf) if spread is None else spread[visible]
        scale = np.minimum(wide, UNKNOWN / size[visible])
        left, values, _ = np.linalg.svd(flat[:, visible] * scale, full_matrices=False)
        return cls(root, left, 1.0 - 1.0 / np.sqrt(1.0 + values**2))

    @property
    def left(self) -> Array:
        """Fraction of the variance of white noise that whitening leaves in each row, shape (K, n)."""
        lost = self.basis**2 @ (1.0 - (1.0 - self.taken) ** 2)
        return np.asarray(1.0 - lost.reshape(self.root.shape))

    def removed(self, values: Array) -> Array:
        """Whitened series of the channels, (K, n, ...)."""
        if not self.taken.size:
            return values
        weights = self.root.reshape(*self.root.shape, *[1] * (values.ndim - 2))
        flat = (values * weights).reshape(self.root.size, -1)
        gone = self.basis @ (self.taken[:, None] * (self.basis.T @ flat))
        inverse = np.divide(1.0, weights, out=np.zeros_like(weights), where=weights > 0.0)
        return np.asarray(values - gone.reshape(values.shape) * inverse)
