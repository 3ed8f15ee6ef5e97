"""One rung of the ladder in simulation: a robot whose free numbers follow the fitted recordings best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.free_runs import FreeRuns, at_bound, best_fit
from missing_physics.diagnosis.naming import Progress
from missing_physics.diagnosis.result import Estimate
from missing_physics.diagnosis.rollout_numbers import PAIRS, REFERENCE_DELAY, adjustables, with_numbers
from missing_physics.diagnosis.rollout_step import ClosedLoop
from missing_physics.diagnosis.simulation_data import Parts
from reference_model.effects.catalogue import used_effects
from robot_model import Robot, VoltageServo

__all__ = ["Bench", "Reached", "effect_numbers", "nominal_names"]

Array = NDArray[np.float64]

#: Starts of each fit, the first included.
STARTS = 2
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
        blocks: squared error of each block of the deciding part.
        rms: of the position error of each joint, fitted and deciding part, shape (2, n).
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
        gain = 0.5 * self.effective * np.log(max(simpler.energy, 1e-300) / max(self.energy, 1e-300))
        extra = len(self.free) - len(simpler.free)
        return float(gain - 0.5 * extra * np.log(max(self.effective, 2.0)))


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
        fit, decide = self._runs(robot, loop)
        energy, blocks = float(fit.block_energies({}).sum()), decide.block_energies({})
        rms = np.stack([fit.rms({}), decide.rms({})])
        return Reached(robot, (), {}, (), energy, fit.effective({}), blocks, rms)

    def promise(self, robot: Robot, free: Sequence[str]) -> float:
        """Squared error that a linearised fit of `free` would leave."""
        loop = ClosedLoop(robot, tuple(free))
        fit = self._fit_runs(robot, loop)
        errors, slopes = fit.errors({})
        self._count(fit, 1)
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
        fit, decide = self._runs(robot, loop)
        numbers = {name: adjustables(robot)[name] for name in free}
        informed = fit.informed(numbers)
        moved = {name: number for name, number in numbers.items() if name in informed}
        before = fit.evaluations
        x, _ = best_fit(
            fit, moved, STARTS, self.seed, lambda phrase: self.progress(f"{words}: {phrase}")
        )
        self._count(fit, fit.evaluations - before)
        values = dict(zip(moved, map(float, x)))
        return Reached(
            robot=with_numbers(robot, values),
            free=tuple(moved),
            estimates=fit.intervals(moved, values),
            at_bound=tuple(name for name in moved if at_bound(moved[name], values[name])),
            energy=float(fit.block_energies(values).sum()),
            effective=fit.effective(values),
            blocks=decide.block_energies(values),
            rms=np.stack([fit.rms(values), decide.rms(values)]),
        )

    def _runs(self, robot: Robot, loop: ClosedLoop) -> tuple[FreeRuns, FreeRuns]:
        return self._fit_runs(robot, loop), FreeRuns(robot, self.parts.decide, loop, scale=self.scale)

    def _fit_runs(self, robot: Robot, loop: ClosedLoop) -> FreeRuns:
        return FreeRuns(robot, self.parts.fit, loop, scale=self.scale)

    def _count(self, fit: FreeRuns, evaluations: int) -> None:
        steps = sum(runner.steps for runner in fit.runners)
        self.work += evaluations * steps * (1 + len(fit.loop.free)) * fit.loop.model.joints**2

    def nominal_names(self, robot: Robot, beside: Sequence[str]) -> tuple[str, ...]:
        """Numbers of the robot, besides its effects, that free runs could tell beside `beside`."""
        names = tuple(name for name in nominal_names(robot) if name not in beside)
        loop = ClosedLoop(robot, (*beside, *names))
        fit = self._fit_runs(robot, loop)
        errors, slopes = fit.errors({})
        self._count(fit, 1)
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
    return tuple(n for n in names if n in known and n not in robot.known and n.split(".")[0] not in robot.known)

