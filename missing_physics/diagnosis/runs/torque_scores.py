"""Errors and series of what is predicted, before and after, on both parts of the data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.least_squares.problem import Output
from missing_physics.diagnosis.naming.final_model import FinalModel
from missing_physics.diagnosis.preparation.proof import SILENT
from missing_physics.diagnosis.preparation.split import Split
from missing_physics.results.result import ChannelFit, ChannelSeries, Errors, Fit, Stage
from robot_model import Robot, unit_of

__all__ = ["TorqueScores"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TorqueScores:
    """What explanations are scored on.

    Attributes:
        robot: names the joints.
        data: of the explanation that is reported.
        nominal: the same data, linearised about the nominal numbers.
    """

    robot: Robot
    data: Split
    nominal: Split

    def fit(self, before: Explanation, after: Explanation) -> tuple[Fit, float]:
        """Errors on both parts of the data, and the part of the mismatch energy that is explained.

        `before` was fitted to `nominal`, `after` to `data`.
        """
        channels = {}
        data = self.data
        residuals = {
            "before": (before.residual, self.nominal.held_out.residual(before)),
            "after": (after.residual, data.held_out.residual(after)),
        }
        for index, output in enumerate(data.problem.outputs):
            if not data.problem.usable[index]:
                continue
            counted = (
                data.train & (data.problem.sliding[:, index] > 0),
                data.scored & (data.validation.sliding[:, index] > 0),
            )
            rms = {
                when: Errors(_rms(r[0][counted[0], index]), _rms(r[1][counted[1], index]))
                for when, r in residuals.items()
            }
            channels[output.channel] = ChannelFit(
                unit=self._unit(output),
                before=rms["before"],
                after=rms["after"],
                noise_floor=float(data.problem.noise_floor[index]),
                relative_error_before=self.relative(residuals["before"], index),
                relative_error_after=self.relative(residuals["after"], index),
            )
        held_out = self._whitened(residuals, unseen=True)
        improvement = 1.0 - float(np.sqrt(held_out[1] / max(held_out[0], 1e-300)))
        return Fit(channels, improvement), self._explained(held_out, self._whitened(residuals, unseen=False))

    def stage(self, model: FinalModel) -> Stage:
        """An explanation along the way: its numbers, and its errors over what was measured."""
        reached, errors = model.explanation, {}
        whole = reached.residual, self.data.held_out.residual(reached)
        for index, joint in enumerate(self.data.problem.joints):
            relative = self.relative(whole, index)
            if self.data.problem.usable[index] and relative is not None:
                errors[f"{joint}.torque"] = relative
        return Stage(
            effects=tuple(term.label for term in reached.found),
            parameters={term.label: model.estimates(term) for term in reached.terms},
            nominal_parameters=model.inertial_parameters(),
            relative_error=errors,
        )

    @staticmethod
    def _explained(held_out: tuple[float, float], fitted: tuple[float, float]) -> float:
        """Part of the mismatch that is gone, from mean energies before and after in units of the noise.

        Told by the held-out data, or by the fitted ones where hardly anything differs in the held-out data.
        """
        excess = [[max(energy - 1.0, 0.0) for energy in pair] for pair in (held_out, fitted)]
        before, after = excess[0] if excess[0][0] > SILENT * excess[1][0] else excess[1]
        return 1.0 - after / max(before, 1e-300)

    def _prismatic(self, output: Output) -> bool:
        return output.joint is not None and self.robot.joint(output.place).kind == "prismatic"

    def _unit(self, output: Output) -> str:
        return unit_of(output.channel, prismatic=self._prismatic(output))

    def _whitened(self, residuals: Mapping[str, tuple[Array, Array]], *, unseen: bool) -> tuple[float, float]:
        """Mean energies of the residuals before and after, over that of the noise floor."""
        data = self.data
        problem, rows = (data.validation, data.scored) if unseen else (data.problem, data.train)
        usable, floor = data.problem.usable, np.maximum(data.problem.noise_floor, 1e-300)
        weight = problem.sliding[rows][:, usable]
        before, after = (
            float((((residuals[when][unseen] / floor)[rows][:, usable]) ** 2 * weight).sum())
            / max(float(weight.sum()), 1e-300)
            for when in ("before", "after")
        )
        return before, after

    def relative(self, residuals: tuple[Array, Array], index: int) -> Errors | None:
        """rms of the error over rms of what was measured, on both parts of the data.

        None where nothing drives the joint.
        """
        measured = self.data.problem.measured, self.data.validation.measured
        if not measured[0][:, index].any():
            return None
        parts = self.data.train, self.data.scored
        ratios = [
            _rms(r[rows, index]) / max(_rms(m[rows, index]), 1e-300)
            for r, m, rows in zip(residuals, measured, parts)
        ]
        return Errors(*ratios)

    def series(self, before: Explanation, after: Explanation) -> tuple[ChannelSeries, ...]:
        """What was measured and what both explanations say, recording by recording, output by output."""
        result = []
        data, given = self.data, self.nominal
        parts = [(data.problem, given.problem, "train", ~data.train)]
        if data.validation is not data.problem:
            every = np.ones(data.validation.time.size, dtype=bool)
            parts.append((data.validation, given.validation, "validation", every))
        for problem, unmoved, role, held in parts:
            nominal, augmented = before.predict(unmoved), after.predict(problem)
            for number, segment in enumerate(problem.segments):
                own = problem.segment_of == number
                for index, output in enumerate(problem.outputs):
                    if not problem.usable[index]:
                        continue
                    k = output.joint
                    result.append(
                        ChannelSeries(
                            recording=segment.motion.source,
                            role=role,  # type: ignore[arg-type]
                            channel=output.channel,
                            unit=self._unit(output),
                            location=output.place,
                            time=problem.time[own],
                            measured=problem.measured[own, index],
                            nominal=nominal[own, index],
                            augmented=augmented[own, index],
                            held_out=held[own],
                            noise_floor=float(problem.noise_floor[index]),
                            position=None if k is None else problem.position[own, k],
                            velocity=None if k is None else problem.velocity[own, k],
                            variable_units=("m", "m/s") if self._prismatic(output) else ("rad", "rad/s"),
                            counted=problem.sliding[own, index] > 0,
                        )
                    )
        return tuple(result)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0
