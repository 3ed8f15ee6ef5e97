"""Errors and series of the torques, before and after, on both parts of the data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.explanation import Explanation
from missing_physics.diagnosis.problem import Problem
from missing_physics.diagnosis.prove import HeldOut
from missing_physics.diagnosis.result import ChannelFit, ChannelSeries, Errors, Fit
from robot_model import Robot, unit_of

__all__ = ["TorqueScores"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TorqueScores:
    """What explanations are scored on.

    Attributes:
        robot: names the joints.
        problem, train: what is fitted, and its rows, shape (R,).
        validation, scored: what is only scored, and its rows; the same problem where rows are held out.
        held_out: residuals on the latter.
    """

    robot: Robot
    problem: Problem
    train: NDArray[np.bool_]
    validation: Problem
    scored: NDArray[np.bool_]
    held_out: HeldOut

    def fit(self, before: Explanation, after: Explanation) -> tuple[Fit, float]:
        """Errors on both parts of the data, and the part of the mismatch energy that is explained."""
        channels = {}
        residuals = {
            "before": (before.residual, self.held_out.residual(before)),
            "after": (after.residual, self.held_out.residual(after)),
        }
        for index, joint in enumerate(self.problem.joints):
            if not self.problem.usable[index]:
                continue
            counted = (
                self.train & (self.problem.sliding[:, index] > 0),
                self.scored & (self.validation.sliding[:, index] > 0),
            )
            rms = {
                when: Errors(_rms(r[0][counted[0], index]), _rms(r[1][counted[1], index]))
                for when, r in residuals.items()
            }
            prismatic = self.robot.joint(joint).kind == "prismatic"
            channels[f"{joint}.torque"] = ChannelFit(
                unit=unit_of(f"{joint}.torque", prismatic=prismatic),
                before=rms["before"],
                after=rms["after"],
                noise_floor=float(self.problem.noise_floor[index]),
                relative_error_before=self.relative(residuals["before"], index),
                relative_error_after=self.relative(residuals["after"], index),
            )
        before_energy, after_energy, noise = self._whitened(residuals["before"][1], residuals["after"][1])
        mismatch_before = max(before_energy - noise, 1e-300)
        explained = 1.0 - max(after_energy - noise, 0.0) / mismatch_before
        improvement = 1.0 - float(np.sqrt(after_energy / max(before_energy, 1e-300)))
        return Fit(channels, improvement), explained

    def _whitened(self, before: Array, after: Array) -> tuple[float, float, float]:
        """Held-out energies in units of the noise floor, and what noise alone would give."""
        weight = self.validation.sliding[self.scored][:, self.problem.usable]
        floor = np.maximum(self.problem.noise_floor, 1e-300)
        energies = [
            float(((r / floor)[self.scored][:, self.problem.usable] ** 2 * weight).sum())
            for r in (before, after)
        ]
        return energies[0], energies[1], float(weight.sum())

    def relative(self, residuals: tuple[Array, Array], index: int) -> Errors:
        """rms of the error over rms of the torque of one joint, on both parts of the data."""
        measured = self.problem.measured, self.validation.measured
        parts = self.train, self.scored
        ratios = [
            _rms(r[rows, index]) / max(_rms(m[rows, index]), 1e-300)
            for r, m, rows in zip(residuals, measured, parts)
        ]
        return Errors(*ratios)

    def series(self, before: Explanation, after: Explanation) -> tuple[ChannelSeries, ...]:
        """Measured torques and those of both explanations, recording by recording and joint by joint."""
        result = []
        parts = [(self.problem, "train", ~self.train)]
        if self.validation is not self.problem:
            parts.append((self.validation, "validation", np.ones(self.validation.time.size, dtype=bool)))
        for problem, role, held in parts:
            nominal, augmented = before.predict(problem), after.predict(problem)
            for number, segment in enumerate(problem.segments):
                own = problem.segment_of == number
                for index, joint in enumerate(problem.joints):
                    if not problem.usable[index]:
                        continue
                    channel = f"{joint}.torque"
                    prismatic = self.robot.joint(joint).kind == "prismatic"
                    result.append(
                        ChannelSeries(
                            recording=segment.motion.source,
                            role=role,  # type: ignore[arg-type]
                            channel=channel,
                            unit=unit_of(channel, prismatic=prismatic),
                            location=joint,
                            time=problem.time[own],
                            measured=problem.measured[own, index],
                            nominal=nominal[own, index],
                            augmented=augmented[own, index],
                            held_out=held[own],
                            noise_floor=float(problem.noise_floor[index]),
                            position=problem.position[own, index],
                            velocity=problem.velocity[own, index],
                            variable_units=("m", "m/s") if prismatic else ("rad", "rad/s"),
                        )
                    )
        return tuple(result)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0
