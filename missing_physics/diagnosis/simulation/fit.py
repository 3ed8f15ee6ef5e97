"""One rung of the ladder in simulation: a robot whose free numbers follow the fitted recordings best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.free_run.numbers import (
    PAIRS,
    REFERENCE_DELAY,
    Adjustable,
    adjustables,
    with_numbers,
)
from missing_physics.diagnosis.free_run.problem import MARGIN, FreeRuns, Trial, at_bound, best_fit
from missing_physics.diagnosis.free_run.recordings import Parts
from missing_physics.diagnosis.free_run.step import ClosedLoop
from missing_physics.diagnosis.naming.search import Progress
from missing_physics.results.result import Estimate
from reference_model.effects.catalogue import used_effects
from robot_model import Robot, VoltageServo

__all__ = ["CREDIBLE_CHANGE", "Bench", "Reached", "effect_numbers", "grouped", "nominal_names"]

Array = NDArray[np.float64]

#: Starts of each fit, the first included.
STARTS = 2
#: A rung's fit ends when a step changes the sum of squares by less than this part.
CONVERGED = 1e-4
#: Steps of the fits to folds, which start where the fit to all ended.
FOLD_STEPS = 20
#: Part by which a nominal number may credibly be off, in its scale.
CREDIBLE_CHANGE = 0.3
#: A nominal number is freed when such a change, beside those before it, moves the positions by this part of
#: their error.
WORTH_FREEING = 0.05
#: Steps times columns times squared joints that all fits of a diagnosis may take together: about half a
#: minute. Counted in work, not in seconds, so that the same data give the same answer on every machine.
MOST_WORK = 5e7


@dataclass(frozen=True)
class Reached:
    """A robot on the ladder.

    Attributes:
        robot: with its refined numbers.
        free: names that were refined; without those that the runs do not depend on.
        estimates: of them, with 95 % intervals.
        at_bound: names that ended on a bound of what is credible.
        energy: squared position error of the fitted part, in units of the scale.
        effective: effective number of samples of those errors.
        blocks: squared error of each deciding block.
        rms: of the position error of each joint, fitted and deciding, shape (2, n).
    """

    robot: Robot
    free: tuple[str, ...]
    estimates: Mapping[str, Estimate]
    at_bound: tuple[str, ...]
    energy: float
    effective: float
    blocks: Array
    rms: Array

    def evidence_over(self, simpler: Reached) -> float:
        """Half the difference of Bayesian information criteria, with effective samples."""
        return _evidence(simpler.energy, self.energy, self.effective, len(self.free) - len(simpler.free))

    def promised(self, left: float, extra: int) -> float:
        """Evidence over this robot if the squared error `left` remained with `extra` more numbers."""
        return _evidence(self.energy, left, self.effective, extra)


def _evidence(before: float, after: float, effective: float, extra: int) -> float:
    gain = 0.5 * effective * np.log(max(before, 1e-300) / max(after, 1e-300))
    return float(gain - 0.5 * extra * np.log(max(effective, 2.0)))


@dataclass
class Bench:
    """Where robots are fitted and compared.

    Attributes:
        parts: the recordings.
        scale: position error of each joint that counts as one, shape (n,).
        seed: of the starts.
        progress: told what is tried.
        work: done so far, see `MOST_WORK`.
    """

    parts: Parts
    scale: Array
    seed: int
    progress: Progress
    work: float = field(default=0.0)

    @property
    def exhausted(self) -> bool:
        """Whether the work allowed is done."""
        return self.work > MOST_WORK

    def reached(self, robot: Robot) -> Reached:
        """A robot as it is."""
        loop = ClosedLoop(robot, (REFERENCE_DELAY,))
        fit = self._runs(robot, self.parts.fit, loop)
        unchanged: list[Mapping[str, float]] = [{} for _ in self.parts.folds]
        blocks, rms = self._decided(robot, loop, unchanged)
        energy = float(fit.block_energies({}).sum())
        return Reached(robot, (), {}, (), energy, fit.effective({}), blocks, np.stack([fit.rms({}), rms]))

    def promise(self, robot: Robot, free: Sequence[str]) -> float:
        """Squared error that a linearised fit of `free` would leave."""
        loop = ClosedLoop(robot, tuple(free))
        fit = self._runs(robot, self.parts.fit, loop)
        errors, slopes = fit.errors({})
        self._count(fit)
        if not np.isfinite(errors).all() or not np.isfinite(slopes).all():
            return float("inf")
        scale = np.linalg.norm(slopes, axis=0)
        columns = slopes[:, scale > 0] / scale[scale > 0]
        left = errors - columns @ np.linalg.lstsq(columns, errors, rcond=1e-8)[0]
        return float(left @ left)

    def fitted(self, robot: Robot, free: Sequence[str], words: str) -> Reached:
        """Refine `free`.

        Raises:
            InputError: the refined numbers are not those of real bodies.
        """
        loop = ClosedLoop(robot, tuple(free))
        fit = self._runs(robot, self.parts.fit, loop)
        numbers = {name: adjustables(robot)[name] for name in free}
        informed = fit.informed(numbers)
        moved = {name: number for name, number in numbers.items() if name in informed}
        x, _ = best_fit(
            fit,
            moved,
            STARTS,
            self.seed,
            lambda phrase: self.progress(f"{words}: {phrase}"),
            converged=CONVERGED,
        )
        values = dict(zip(moved, map(float, x)))
        refined = with_numbers(robot, values)
        self._count(fit)
        blocks, rms = self._decided(
            robot, loop, [self._of_fold(robot, loop, moved, values, k) for k in range(len(self.parts.folds))]
        )
        return Reached(
            robot=refined,
            free=tuple(moved),
            estimates=fit.intervals(moved, values),
            at_bound=tuple(name for name in moved if at_bound(moved[name], values[name])),
            energy=float(fit.block_energies(values).sum()),
            effective=fit.effective(values),
            blocks=blocks,
            rms=np.stack([fit.rms(values), rms]),
        )

    def _of_fold(
        self,
        robot: Robot,
        loop: ClosedLoop,
        moved: Mapping[str, Adjustable],
        values: Mapping[str, float],
        fold: int,
    ) -> Mapping[str, float]:
        """Numbers fitted to one fold only, from the values fitted to all."""
        trials = self.parts.folds[fold][0]
        if len(self.parts.folds) == 1 or not moved:  # what decides was not fitted at all
            return values
        runs = self._runs(robot, trials, loop)
        x = np.array(list(values.values()))
        inside = [
            np.clip(v, n.lower + MARGIN * n.typical, n.upper - MARGIN * n.typical)
            for v, n in zip(x, moved.values())
        ]
        result = runs.fit(moved, np.array(inside), FOLD_STEPS, converged=CONVERGED)
        self._count(runs)
        return dict(zip(moved, map(float, result.x)))

    def _decided(
        self, robot: Robot, loop: ClosedLoop, values: Sequence[Mapping[str, float]]
    ) -> tuple[Array, Array]:
        """Squared error of each deciding block, and the rms error of each joint over all of them."""
        blocks, squares, seconds = [], np.zeros(self.scale.size), 0.0
        for (_, trials), own in zip(self.parts.folds, values):
            runs = self._runs(robot, trials, loop)
            blocks.append(runs.block_energies(own))
            duration = sum(trial.recording.duration for trial in trials)
            squares = squares + duration * runs.rms(own) ** 2
            seconds += duration
        return np.concatenate(blocks), np.asarray(np.sqrt(squares / seconds))

    def _runs(self, robot: Robot, trials: Sequence[Trial], loop: ClosedLoop) -> FreeRuns:
        return FreeRuns(robot, trials, loop, scale=self.scale)

    def _count(self, fit: FreeRuns) -> None:
        steps = sum(runner.steps for runner in fit.runners)
        self.work += fit.evaluations * steps * (1 + len(fit.loop.free)) * fit.loop.model.joints**2

    def nominal_names(self, robot: Robot, beside: Sequence[str]) -> tuple[str, ...]:
        """Numbers of the robot, besides its effects, that free runs could tell beside `beside`."""
        names = tuple(name for name in nominal_names(robot) if name not in beside)
        loop = ClosedLoop(robot, (*beside, *names))
        fit = self._runs(robot, self.parts.fit, loop)
        errors, slopes = fit.errors({})
        self._count(fit)
        numbers = adjustables(robot)
        scale = np.array([numbers[name].typical for name in loop.free]) * CREDIBLE_CHANGE
        columns, chosen = list((slopes * scale).T[: len(beside)]), []
        level = WORTH_FREEING * float(np.linalg.norm(errors))
        for name, column in zip(names, (slopes * scale).T[len(beside) :]):
            if columns:
                basis, _ = np.linalg.qr(np.column_stack(columns))
                new = column - basis @ (basis.T @ column)
            else:
                new = column
            if np.isfinite(new).all() and np.linalg.norm(new) > level:
                columns.append(column)
                chosen.append(name)
        return tuple(chosen)


def effect_numbers(robot: Robot) -> tuple[str, ...]:
    """Names of all estimated parameters of the robot's effects."""
    return tuple(
        f"{used.effect.id}@{used.at}.{p.name}" for used in used_effects(robot) for p in used.effect.estimated
    )


def nominal_names(robot: Robot) -> tuple[str, ...]:
    """Numbers of a robot that may be wrong: motors first, as bodies are usually known better.

    Of a voltage servo the constants of its motor; of every robot rotors and mass properties, without what
    the robot file calls known.
    """
    names = []
    for joint in robot.moving_joints:
        motor = joint.actuator
        if motor is None:
            continue
        if isinstance(robot.controller, VoltageServo):
            names += [f"{joint.name}.torque_constant", f"{joint.name}.resistance"]
        names.append(f"{joint.name}.rotor_inertia")
    for link in robot.links:
        names += [f"{link.name}.center_of_mass.{axis}" for axis in "xyz"]
        names.append(f"{link.name}.mass")
        names += [f"{link.name}.inertia.{pair}" for pair in PAIRS[:3]]
    known = adjustables(robot)
    return tuple(
        n for n in names if n in known and n not in robot.known and n.split(".")[0] not in robot.known
    )


def grouped(names: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """Numbers that are freed together: constants of one motor, of which free runs know only products."""
    groups: dict[str, list[str]] = {}
    for name in names:
        place, _, number = name.partition(".")
        key = place if number in ("torque_constant", "resistance") else name
        groups.setdefault(key, []).append(name)
    return tuple(map(tuple, groups.values()))
