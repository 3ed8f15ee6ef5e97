"""Answer of each tool to a case: terms with values, and predicted torque along held-out motions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from benchmarks.evidence import final_values
from benchmarks.peers.cases import Case, Motion
from missing_physics.challenge.scoring.baselines import REGRESSORS
from missing_physics.diagnosis import Options, diagnose
from robot_model import EffectUse, robot_from_toml

__all__ = ["Answer", "diagnosis", "idim", "nominal", "refitted", "sparse"]

Array = NDArray[np.float64]

#: Singular values below this fraction of the largest count as zero.
RANK = 1e-6
#: A parameter is determined individually if the kept directions contain this fraction of it.
DETERMINED = 0.98
#: Thresholds of the sparse regression, for columns and target of unit norm, chosen by the last quarter of the
#: fitted recordings; and its ridge.
THRESHOLDS = (0.02, 0.05, 0.1, 0.2, 0.4)
CHECKED = 0.25
RIDGE = 1e-6
#: Terms of the usual friction model, each the contribution of an effect with a parameter of one.
FRICTION = {
    "viscous_friction": "coefficient",
    "coulomb_friction": "torque",
    "torque_offset": "torque",
}


@dataclass(frozen=True)
class Answer:
    """One tool on one case.

    Attributes:
        found: `effect@place.parameter`, or its own name of a term, to value and half width of its 95 %
            interval (None where it states none).
        predicted: torque along each held-out motion, shape (N, n); empty where there is no answer.
        note: remarks.
    """

    found: Mapping[str, tuple[float, float | None]] = field(default_factory=dict)
    predicted: Sequence[Array] = ()
    note: str = ""


def nominal(case: Case) -> Answer:
    """The unchanged robot file."""
    return Answer(predicted=[m.along.nominal() for m in case.held_out_motions])


def refitted(case: Case) -> Answer:
    """Inertial parameters of the nominal robot, and its effects, by least squares."""
    labels = [f"{use.effect}@{use.at}" for use in case.nominal.effects]
    return _linear(case, labels, lambda m: [m.along.part(use) for use in case.nominal.effects])


def idim(case: Case) -> Answer:
    """Inertial parameters with viscous and Coulomb friction and an offset in every joint, by least squares.

    Inverse dynamic identification (Gautier; Janot et al.), as in robot identification tools.
    """
    uses = [
        EffectUse(effect=effect, at=joint.name, **{parameter: 1.0})
        for joint in case.nominal.moving_joints
        for effect, parameter in FRICTION.items()
    ]
    labels = [f"{use.effect}@{use.at}.{FRICTION[use.effect]}" for use in uses]
    return _linear(case, labels, lambda m: [m.along.part(use) for use in uses])


def _linear(case: Case, labels: Sequence[str], parts: Callable[[Motion], list[Array]]) -> Answer:
    """Least squares of the torque, each joint scaled by its own, on inertial parameters and `parts`."""
    names = case.motions[0].along.model.inertial_names
    free = [k for k, name in enumerate(names) if not _kept(case, name)]

    def matrix(motion: Motion) -> Array:
        columns = [motion.along.regressor[:, :, k] for k in free] + parts(motion)
        return np.stack(columns, axis=2)

    def fixed(motion: Motion) -> Array:
        """The torque of the parameters that are not fitted."""
        fitted = motion.along.regressor[:, :, free] @ motion.along.model.inertial[free]
        return np.asarray(motion.along.rigid - fitted)

    rows, target = _stacked(case.motions, matrix), _stacked(case.motions, lambda m: m.torque - fixed(m))
    weight = 1.0 / np.sqrt(np.mean(_stacked(case.motions, lambda m: m.torque) ** 2, axis=0))
    scaled = (rows * weight[:, None]).reshape(-1, rows.shape[2])
    values, determined = _least_squares(scaled, (target * weight).ravel())
    labels = [*(names[k] for k in free), *labels]
    return Answer(
        {label: (float(v), None) for label, v, own in zip(labels, values, determined) if own},
        [fixed(m) + matrix(m) @ values for m in case.held_out_motions],
    )


def _least_squares(columns: Array, target: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Minimum-norm solution in unit columns, and which parameters the data determine individually."""
    size = np.linalg.norm(columns, axis=0)
    seen = size > RANK * size.max()
    left, singular, right = np.linalg.svd(columns[:, seen] / size[seen], full_matrices=False)
    kept = singular > RANK * singular[0]
    values, determined = np.zeros(size.size), np.zeros(size.size, dtype=bool)
    values[seen] = right[kept].T @ (left[:, kept].T @ target / singular[kept]) / size[seen]
    determined[seen] = (right[kept] ** 2).sum(axis=0) > DETERMINED
    return values, determined


def _kept(case: Case, name: str) -> bool:
    """Whether an inertial parameter keeps the file's value: gravity, known ones, rotors it lacks."""
    known, body = case.nominal.known, name.split(".")[0]
    if name.endswith(".reflected_inertia"):
        motor = case.nominal.joint(body).actuator
        return motor is None or motor.rotor_inertia == 0.0
    return name.startswith("gravity") or name in known or body in known


def _stacked(motions: Sequence[Motion], values: Callable[[Motion], Array]) -> Array:
    return np.concatenate([m.reduced(values(m)) for m in motions])


def sparse(case: Case) -> Answer:
    """PySINDy's thresholded least squares on the residual torques, with the challenge's regressors."""
    try:
        from pysindy import STLSQ
    except ImportError:
        return Answer(note="PySINDy is not installed; it comes with the extra `peers`")
    found: dict[str, tuple[float, float | None]] = {}
    predicted = [m.along.nominal().copy() for m in case.held_out_motions]
    chosen = []
    for k, joint in enumerate(case.motions[0].joints):
        library = _stacked(case.motions, lambda m, k=k: _library(m, k))  # type: ignore[misc]
        target = _stacked(
            case.motions,
            lambda m, k=k: (m.torque - m.along.nominal())[:, k : k + 1],  # type: ignore[misc]
        )
        size = np.maximum(np.linalg.norm(library, axis=0) / np.sqrt(len(library)), 1e-300)
        scale = max(float(np.sqrt(np.mean(target**2))), 1e-300)
        unit, aim = library / size, target / scale

        def weights(threshold: float, rows: slice, unit: Array = unit, aim: Array = aim) -> Array:
            fit = STLSQ(threshold=threshold, alpha=RIDGE)
            fit.fit(unit[rows], aim[rows])
            return np.asarray(fit.coef_).ravel()

        most = int((1 - CHECKED) * len(unit))
        errors = {
            t: float(np.mean((aim[most:, 0] - unit[most:] @ weights(t, slice(0, most))) ** 2))
            for t in THRESHOLDS
        }
        best = min(errors, key=errors.__getitem__)
        chosen.append(f"{best:g}")
        values = weights(best, slice(None)) * scale / size
        found |= {f"{name}@{joint}": (float(v), None) for name, v in zip(REGRESSORS, values) if v}
        for torque, motion in zip(predicted, case.held_out_motions):
            torque[:, k] += _library(motion, k) @ values
    return Answer(found, predicted, f"threshold {', '.join(chosen)}")


def _library(motion: Motion, k: int) -> Array:
    """All regressors of one joint, shape (N, K).

    The nominal torque is used where a regressor needs the torque: the measured one is the target, and would
    be its own best regressor.
    """
    q, v, a = (part[:, k] for part in motion.state)
    return np.column_stack([shape(q, v, a, motion.along.nominal()[:, k]) for shape in REGRESSORS.values()])


def diagnosis(case: Case) -> Answer:
    """`missing-physics diagnose` of the fitted recordings; its augmented robot predicts."""
    result = diagnose(case.nominal, list(case.fitted), options=Options(experiments=False))
    answer = result.diagnosis
    values = final_values(answer)
    robot = robot_from_toml(result.augmented_robot_toml)
    named = ", ".join(f"{f.effect}@{f.location} ({100 * f.probability:.3g} %)" for f in answer.findings)
    return Answer(
        {label: (e.value, 0.5 * (e.ci95[1] - e.ci95[0])) for label, e in values.items()},
        [m.predicted(robot) for m in case.held_out_motions],
        f"verdict: {answer.verdict}; names {named or 'nothing'}",
    )
