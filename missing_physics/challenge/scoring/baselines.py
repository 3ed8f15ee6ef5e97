"""Simpler methods on the same recordings, which are also given the exact motion.

* The largest correlation of the torque residual with a single regressor at a single joint.
* Sparse regression (sequentially thresholded least squares; Brunton, Proctor, Kutz, PNAS 113 (2016)) with
  PySINDy on the same regressors of every joint.
* The nominal robot with all inertial parameters and friction refitted, which names no effect.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from missing_physics.challenge.scoring.result import ModelScore
from missing_physics.challenge.torques.along import ArmAlong
from robot_model import Recording

__all__ = ["REGRESSORS", "baselines", "torque_error"]

Array = NDArray[np.float64]
Shape = Callable[[Array, Array, Array, Array], Array]

#: Regressors as functions of position, velocity, acceleration and modelled torque of a joint, by effect.
#: The torque is the nominal robot's, since the recorded one would be a trivial regressor of itself.
REGRESSORS: Mapping[str, Shape] = MappingProxyType(
    {
        "coulomb_friction": lambda q, v, a, u: np.sign(v),
        "viscous_friction": lambda q, v, a, u: v,
        "asymmetric_friction": lambda q, v, a, u: np.abs(v),
        "cable_spring": lambda q, v, a, u: q - q.mean(),
        "torque_offset": lambda q, v, a, u: np.ones_like(q),
        "torque_gain": lambda q, v, a, u: u,
        "load_dependent_friction": lambda q, v, a, u: np.abs(u) * np.sign(v),
        "inertia": lambda q, v, a, u: a,
        "stribeck_friction": lambda q, v, a, u: np.sign(v) * np.exp(-((v / (0.05 * np.abs(v).max())) ** 2)),
        "quadratic drag": lambda q, v, a, u: v * np.abs(v),
        "cubic spring": lambda q, v, a, u: (q - q.mean()) ** 3,
    }
)
#: Threshold of the sparse regression, for regressors and residual of unit size.
THRESHOLD = 0.1
#: Relative tolerance of singular values in a refit.
RANK = 1e-8


def baselines(
    train: ArmAlong, held_out: ArmAlong, recorded: Recording, other: Recording
) -> dict[str, ModelScore]:
    """Every baseline: fitted to `recorded` torque along `train`, scored on `other` along `held_out`."""
    targets = _residual(train, recorded), _residual(held_out, other)
    libraries = _library(train), _library(held_out)
    return {
        "correlation": _correlation(targets, libraries, held_out),
        "sparse regression": _sparse(targets, libraries, held_out),
        "nominal refitted": _refitted(targets, train, held_out),
    }


def torque_error(along: ArmAlong, left: Array) -> float:
    """rms of a torque residual relative to the sensors' noise, over the joints whose torque is measured."""
    rows = measured_joints(along)
    noise = np.array([_noise(along, k) for k in rows])
    return float(np.sqrt(np.mean((left[:, rows] / noise) ** 2)))


def measured_joints(along: ArmAlong) -> list[int]:
    """Indices of the joints whose torque is measured."""
    return [k for k, joint in enumerate(along.joints) if along.robot.sensor(f"{joint}.torque")]


def _noise(along: ArmAlong, k: int) -> float:
    sensor = along.robot.sensor(f"{along.joints[k]}.torque")
    assert sensor is not None
    return max(float(np.sqrt(sensor.noise**2 + sensor.resolution**2 / 12)), 1e-12)


def _residual(along: ArmAlong, recording: Recording) -> Array:
    """Recorded minus nominal torque; zero if it is not measured."""
    found = np.zeros_like(along.torque)
    for k in measured_joints(along):
        found[:, k] = recording[f"{along.joints[k]}.torque"] - along.nominal()[:, k]
    return found


def _library(along: ArmAlong) -> Array:
    """All regressors of all joints, shape (N, n, len(REGRESSORS))."""
    q, v, a = along.state
    torque = along.nominal()
    columns = [
        [shape(q[:, k], v[:, k], a[:, k], torque[:, k]) for shape in REGRESSORS.values()]
        for k in range(len(along.joints))
    ]
    return np.array(columns).transpose(2, 0, 1)


Pair = tuple[Array, Array]


def _correlation(targets: Pair, libraries: Pair, held_out: ArmAlong) -> ModelScore:
    best = (0.0, 0, 0)
    for k in measured_joints(held_out):
        noise = _noise(held_out, k)
        for c in range(len(REGRESSORS)):
            column, target = libraries[0][:, k, c], targets[0][:, k]
            explained = abs(float(column @ target)) / max(float(np.linalg.norm(column)), 1e-300) / noise
            best = max(best, (explained, k, c))
    _, k, c = best
    column, target = libraries[0][:, k, c], targets[0][:, k]
    left = targets[1].copy()
    left[:, k] -= libraries[1][:, k, c] * float(column @ target) / max(float(column @ column), 1e-300)
    return ModelScore((f"{list(REGRESSORS)[c]}@{held_out.joints[k]}",), torque_error(held_out, left))


def _sparse(targets: Pair, libraries: Pair, held_out: ArmAlong) -> ModelScore:
    try:
        from pysindy import STLSQ
    except ImportError:
        return ModelScore((), None, "PySINDy is not installed; it comes with the extra `peers`")
    left, named = targets[1].copy(), []
    for k in measured_joints(held_out):
        size = np.linalg.norm(libraries[0][:, k], axis=0) / np.sqrt(len(targets[0]))
        seen = size > 1e-12
        scale = max(float(np.sqrt(np.mean(targets[0][:, k] ** 2))), 1e-300)
        fit = STLSQ(threshold=THRESHOLD, alpha=1e-6)
        fit.fit(libraries[0][:, k][:, seen] / size[seen], targets[0][:, k : k + 1] / scale)
        weights = np.zeros(len(REGRESSORS))
        weights[seen] = np.ravel(fit.coef_) * scale / size[seen]
        left[:, k] -= libraries[1][:, k] @ weights
        if scale > 1.5 * _noise(held_out, k):  # otherwise it would name noise
            named += [f"{name}@{held_out.joints[k]}" for name, w in zip(REGRESSORS, weights) if w != 0]
    return ModelScore(tuple(named), torque_error(held_out, left))


def _refitted(targets: Pair, train: ArmAlong, held_out: ArmAlong) -> ModelScore:
    free = [k for k, name in enumerate(train.model.inertial_names) if not name.startswith("gravity")]
    rows = measured_joints(train)
    noise = np.array([_noise(train, k) for k in rows])

    def matrix(along: ArmAlong) -> Array:
        columns = [along.regressor[:, :, k] for k in free] + [along.part(use) for use in along.robot.effects]
        return np.stack(columns, axis=2)

    scaled = (matrix(train)[:, rows] / noise[:, None]).reshape(-1, len(free) + len(train.robot.effects))
    size = np.maximum(np.linalg.norm(scaled, axis=0), 1e-300)
    found = np.linalg.lstsq(scaled / size, (targets[0][:, rows] / noise).ravel(), rcond=RANK)[0] / size
    return ModelScore((), torque_error(held_out, targets[1] - matrix(held_out) @ found))
