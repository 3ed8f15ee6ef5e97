"""What changes of base and flexible links add to the torques and channels of one recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from missing_physics.diagnosis.dynamics.base_rates import rotation_matrices
from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.responses.passive_changes import Change, Masses, change_of
from missing_physics.diagnosis.responses.passive_course import Deviation, Equations, PassiveCourse
from missing_physics.diagnosis.terms.term import Term
from reference_model.passive.base_motion import BaseMotion

__all__ = ["PassiveResponses"]

Array = NDArray[np.float64]

#: Step of a difference by a number of a change, as a part of its value or typical size.
STEP = 1e-4


@dataclass(frozen=True)
class _Observed:
    """Torques (N, n), deviation, and the accelerations (N, p) that follow."""

    torque: Array
    moved: Deviation
    accelerations: Array


class PassiveResponses:
    """Changes along the motion of one recording; everything is computed when first asked for.

    Args:
        dynamics: of the nominal robot along the motion.
    """

    def __init__(self, dynamics: MotionDynamics) -> None:
        self._dynamics = dynamics
        self._course: PassiveCourse | None = None
        self._changes: dict[tuple[str, str], Change | None] = {}
        self._foretold: dict[tuple[str, str], _Observed] = {}

    def change(self, effect: str, place: str) -> Change | None:
        """The change; None where the robot cannot have it there."""
        if (effect, place) not in self._changes:
            if self._course is None:
                self._course = PassiveCourse(self._dynamics)
            self._changes[effect, place] = change_of(effect, self._course, place)
        return self._changes[effect, place]

    def shown(self, term: Term, channels: Sequence[str] = ()) -> tuple[Array, Array]:
        """What `term` adds, and its derivatives by the free numbers.

        Args:
            term: an effect that is a change of base or flexible links.
            channels: further ones that see it (see `dynamics/channels.py`).

        Returns:
            Outputs that are predicted, shape (N, m, 1 + k), and the channels, shape (N, p, 1 + k).
        """
        change = self.change(*term.key)
        assert change is not None
        values = {p.name: term.parameters[p.name] for p in term.effect.parameters}
        steps = {p.name: STEP * max(abs(values[p.name]), p.typical) for p in term.estimated}
        if term.key not in self._foretold:
            absent = {p.name: p.absent for p in term.effect.parameters if p.absent is not None}
            self._foretold[term.key] = self._nothing(change, {**values, **absent})
        return self._columns(change, values, steps, self._foretold[term.key], channels)

    def of_masses(self, directions: Array, channels: Sequence[str]) -> tuple[Array, Array]:
        """What combinations (P, B) of all inertial numbers add to first order, as `shown`, (N, ..., B)."""
        if self._course is None:
            self._course = PassiveCourse(self._dynamics)
        names = [f"{k}" for k in range(directions.shape[1])]
        change, none = Masses(self._course, directions), dict.fromkeys(names, 0.0)
        steps = dict.fromkeys(names, STEP)
        outputs, seen = self._columns(change, none, steps, self._nothing(change, none), channels)
        return outputs[:, :, 1:], seen[:, :, 1:]

    def _columns(
        self,
        change: Change,
        values: Mapping[str, float],
        steps: Mapping[str, float],
        nothing: _Observed,
        channels: Sequence[str],
    ) -> tuple[Array, Array]:
        """The change and its derivatives by what is in `steps`."""
        course = change.course
        equations = change.equations(values)
        moved, moves = course.follow(equations)
        acceleration = self._rates_of_rates(equations, moved)
        at, pushed = course.pose, []
        for name, step in steps.items():
            by = change.equations({**values, name: values[name] + step}).less(equations, step)
            push = by.force + np.einsum("tij,tj->ti", by.lossy[at], moved.rates)
            push += np.einsum("tij,tj->ti", by.elastic[at], moved.shapes)
            push += np.einsum("tij,tj->ti", by.inertia[at], acceleration)
            pushed.append(push)
        derived = course.driven(moves, np.stack(pushed, axis=2)) if pushed else []
        columns = [self._outputs(self._observed(change, values, moved), nothing, channels)]
        for (name, step), by_name in zip(steps.items(), derived):
            there = {**values, name: values[name] + step}
            seen = self._outputs(self._observed(change, there, moved.plus(by_name, step)), nothing, channels)
            columns.append((seen - columns[0]) / step)
        whole = np.stack(columns, axis=2)
        split = whole.shape[1] - len(channels)
        return whole[:, :split], whole[:, split:]

    def _rates_of_rates(self, equations: Equations, moved: Deviation) -> Array:
        """v' by the linear equations."""
        at = self._course_at
        pull = equations.force + np.einsum("tij,tj->ti", equations.lossy[at], moved.rates)
        pull += np.einsum("tij,tj->ti", equations.elastic[at], moved.shapes)
        return -np.einsum("tij,tj->ti", np.linalg.inv(equations.inertia)[at], pull)

    @property
    def _course_at(self) -> NDArray[np.int_]:
        assert self._course is not None
        return self._course.pose

    def _observed(self, change: Change, values: Mapping[str, float], moved: Deviation) -> _Observed:
        rows = change.rows(values, moved)
        found = -np.asarray(np.linalg.solve(rows.inertia, rows.needed[:, :, None])[:, :, 0], dtype=float)
        torque = np.asarray(rows.torque + np.einsum("tij,tj->ti", rows.coupling, found), dtype=float)
        return _Observed(torque, moved, found)

    def _nothing(self, change: Change, absent: Mapping[str, float]) -> _Observed:
        """Where nothing is missing, by the same formulas."""
        force = change.equations(absent)
        count, coordinates = len(force.force), force.elastic.shape[2]
        return self._observed(
            change, absent, Deviation(np.zeros_like(force.force), np.zeros((count, coordinates)))
        )

    def _outputs(self, here: _Observed, nothing: _Observed, channels: Sequence[str]) -> Array:
        """[torques; gyro channels that are predicted; further channels], shape (N, ...)."""
        parts = [here.torque - nothing.torque]
        if self._dynamics.further:
            axes = ["xyz".index(channel[-1]) for channel in self._dynamics.further]
            parts.append((here.moved.rates - nothing.moved.rates)[:, 3:6][:, axes])
        parts += [(self._seen(c, here) - self._seen(c, nothing))[:, None] for c in channels]
        return np.hstack(parts)

    def _seen(self, channel: str, here: _Observed) -> Array:
        """What a further channel sees of a deviating motion beyond the foretold one, shape (N,)."""
        along, f = self._dynamics, (0 if self._dynamics.base is None else 6)
        place, _, quantity = channel.partition(".")
        moved, s = here.moved, along.model.tree.modal
        if place == "base":
            base = along.base
            assert base is not None
            kind, axis = quantity.split(".")[0], "xyz".index(quantity[-1])
            if kind == "angular_velocity":
                return moved.rates[:, 3 + axis]
            if kind == "linear_acceleration":
                return here.accelerations[:, axis]
            turned = np.einsum("nij,nj->ni", rotation_matrices(base.attitude), moved.rates[:, 3:6])
            angle = cumulative_trapezoid(turned, along.motion.time, axis=0, initial=0.0)
            return np.asarray(angle[:, axis])
        body = next((b for b in along.model.tree.bodies if b.name == place), None)
        if body is None or body.flexible is None or along.inner is None:
            return np.zeros(len(moved.rates))  # an encoder: the joint moves as it was recorded
        own = slice(body.modal, body.modal + body.modes)
        shapes = moved.shapes[:, own]
        if quantity.startswith("strain"):
            return np.asarray(shapes @ body.flexible.strain[int(quantity.split(".")[1]) - 1])
        axis = "xyz".index(quantity[-1])
        if quantity.startswith("tip_deflection"):
            return np.asarray(shapes @ body.flexible.translations[body.flexible.tip][axis])
        inner = replace(
            along.inner,
            modal=along.inner.modal + moved.shapes[:, :s],
            modal_rates=along.inner.modal_rates + moved.rates[:, f : f + s],
            modal_accelerations=here.accelerations[:, f : f + s],
        )
        base = along.base
        if base is not None:
            base = BaseMotion(
                base.attitude,
                base.angular_velocity + moved.rates[:, 3:6],
                base.linear_velocity + moved.rates[:, :3],
                here.accelerations[:, 3:6],
                here.accelerations[:, :3],
            )
        felt = along.model.node_motion(place, *along.state, base=base, inner=inner, inertial=along.about)
        return np.asarray(felt.acceleration[:, axis])
