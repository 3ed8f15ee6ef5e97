"""The rows of recorded torques.

In addition to the columns of the standard model there are those of delays. Torque and position of one
recording rarely belong to the same instant (a held command, a filtered current, two buses), so a delay of
about a sample common to all joints is no physical effect. Each joint may have an additional delay.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.hypotheses import TIMING, Candidate, Hypothesis, Term, candidates
from missing_physics.inference.data import Data, blocks_of
from missing_physics.inference.kept import Kept
from missing_physics.inference.torques.columns import Columns, KeptColumns, added_to_bodies, cut
from missing_physics.inference.torques.places import places
from missing_physics.inference.torques.runs import Run, about, runs_of
from missing_physics.inference.torques.scans import Scan, scanned, scans_of
from missing_physics.inference.torques.touched import at_links
from missing_physics.standard import MODEL_ERROR, StandardModel
from missing_physics.standard.fit import design_of, least_rms
from missing_physics.standard.layout import Information, Layout
from missing_physics.standard.model import EFFECTS
from missing_physics.standard.prediction import inertial_with_effects
from missing_physics.standard.rows import FRICTION, is_friction
from reference_model.effects.base import BodyEffect, JointEffect, YieldingGear
from reference_model.effects.catalogue import used_effects
from reference_model.effects.structure import StructureEffect
from reference_model.evaluation.model import RobotModel
from robot_model import Recording, Robot

__all__ = ["TorqueData"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Standard deviation of the prior of a joint's additional delay, due to filters in its drive [s]: their
#: cut-offs are some tens of Hz. Holds and buses delay all joints by about a sample.
FILTER = 5e-3
#: Delays that differ by less count as equal [rad at the band's end]: the non-linearity is a thousandth.
SAME = 0.05


@dataclass(frozen=True, eq=False, kw_only=True)
class TorqueData(Data):
    """Rows of recorded torques, one channel for each joint.

    The layout has the parameters of the standard model, the common delay and the additional delay of each
    joint. The size of a channel is that of `Rows.scale`.

    Attributes:
        standard: the standard model at which everything is linearised.
        runs: recordings, the fitted ones first.
        common: columns of terms that depend on the motion only, cached for all linearisations.
        scans: of effects that add coordinates, computed once for all linearisations; empty before.
    """

    standard: StandardModel
    runs: tuple[Run, ...]
    common: Kept[Columns] = field(default_factory=Kept, repr=False)
    scans: list[tuple[Scan, ...]] = field(default_factory=list, repr=False)
    _targets: dict[int, Array] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(
        cls,
        standard: StandardModel,
        recordings: Sequence[Recording],
        held_out: Sequence[Recording] = (),
        extra: Information | None = None,
    ) -> Self:
        """The rows of recordings in the band in which the standard model was fitted.

        Args:
            standard: the fitted standard model.
            recordings: those that are fitted.
            held_out: held-out recordings; if empty, a quarter of each recording (`held_out_windows`).
            extra: information on the bodies from other channels.
        """
        runs = runs_of(standard, (*recordings, *held_out))
        fitted = len(recordings)
        blocks = blocks_of([run.rows.samples for run in runs], fitted)
        squares = np.concatenate([r.rows.scale for r in runs[:fitted]]) ** 2
        torque = np.sqrt(np.mean(squares, axis=0))
        # A channel that is zero throughout needs a scale, too.
        torque = np.maximum(torque, max(1e-9 * float(torque.max()), np.finfo(float).eps))
        step = 1.0 / runs[0].motion.sampling
        driven = np.any([run.driven for run in runs], axis=0)
        layout = _with_timing(standard.estimate.layout, runs[0].model.joints, driven, step)
        layout = replace(layout, extra=extra)
        file_values = np.concatenate(
            [_file_values(standard.nominal, runs[0].model), np.zeros(torque.size + 1)]
        )
        given = tuple(_given(standard.nominal, dict(zip(layout.names, file_values))))
        return cls(
            layout=layout,
            file_values=file_values,
            designs=_designs(runs),
            blocks=blocks,
            size=torque,
            noise=np.sqrt(np.mean([run.rows.noise**2 for run in runs], axis=0)),
            error=MODEL_ERROR * torque,
            independent=float(min(1.0, 2.0 * runs[0].motion.cutoff * np.diff(runs[0].rows.time[:2])[0])),
            robot=standard.nominal,
            joints=tuple(runs[0].model.joints),
            given=given,
            standard=standard,
            runs=runs,
        )

    @cached_property
    def least(self) -> Array:
        """Least rms residual of each joint in a fit, shape (n,)."""
        return least_rms([run.rows for run in self.runs])

    def about(self, parameters: Array) -> Self:
        """The same rows, linearised at other parameters of the standard model and shifted by their delays.

        Args:
            parameters: of the standard model, shape (X,).
        """
        along, estimate = parameters.copy(), self.standard.estimate.values
        for one in self.given:  # keep the friction that a law replaces in the torque that the motion needs
            for name, value in one.held:
                place = self.layout.names.index(name)
                along[place] = estimate[place] if parameters[place] == value else parameters[place]
        runs = tuple(about(run, along) for run in self.runs)
        return replace(self, runs=runs, designs=_designs(runs))

    @property
    def laws(self) -> tuple[Candidate, ...]:
        """The effects of `given` whose contribution is not yet subtracted from the rows."""
        return tuple(one for one in self.given if not one.term.in_rows)

    @property
    def about_numbers(self) -> Array:
        """Standard model parameters at which the rows are linearised, shape (X,)."""
        given = self.runs[0].parameters
        return np.concatenate([given, np.zeros(self.file_values.size - given.size)])

    def with_bodies(self, parameters: Array, terms: Sequence[Term]) -> Array:
        """Standard model parameters with the contributions of terms added to the bodies, shape (X,)."""
        found = parameters.copy()
        for term in terms:
            if isinstance(term.effect, BodyEffect):
                places, added, _ = added_to_bodies(term, term.effect, self.runs[0].model)
                found[places] += added
            elif isinstance(term.effect, StructureEffect):
                name = f"{term.at}.{term.effect.beam_number}"
                if name in self.layout.names:
                    found[self.layout.names.index(name)] += term.values[0]
        return found

    def is_near(self, one: Array, other: Array, terms: Sequence[Term] = ()) -> bool:
        """Whether rows linearised at the first parameters are valid at the second, shape (X,) each.

        The delays must be nearly equal. The motion of a free base and flexible links depends on the masses,
        and some effects are driven by the torque that the motion needs, or by friction. In these cases the
        difference must change the torques by less than the noise and the error of any model.
        """
        angle = (
            2.0
            * np.pi
            * self.runs[0].motion.cutoff
            * np.abs(self.delays_of(one) - self.delays_of(other)).max()
        )
        if angle >= SAME:
            return False
        driven = {t.at for t in terms if t.effect.uses_torque or t.effect.is_modifier}
        follows = self.follows or any(t.effect.adds_coordinates for t in terms)
        joints = np.array([follows or joint in driven for joint in self.joints])
        if not joints.any():
            return True
        count = len(self.runs[0].model.inertial_names) - 3 if follows else one.size
        apart = [design[:, joints, :count] @ (one - other)[:count] for design in self.designs]
        change = np.sqrt(np.max([np.mean(own**2, axis=0) for own in apart], axis=0))
        return bool(np.all(change < np.minimum(self.error, self.noise)[joints]))

    @property
    def follows(self) -> bool:
        """Whether a free base or flexible links follow the joints, so that the motion depends on masses."""
        return self.runs[0].along.response is not None

    @property
    def bends(self) -> bool:
        """Whether links are flexible, so that torques are not linear in the inertial parameters."""
        return self.runs[0].along.inner is not None

    def delays_of(self, parameters: Array) -> Array:
        """Delay of each recorded torque for given standard model parameters [s], shape (n,)."""
        first = self.file_values.size - self.size.size - 1
        return np.asarray(parameters[first] + parameters[first + 1 :])

    @cached_property
    def terms(self) -> KeptColumns:
        """Columns of terms along the recordings."""
        return KeptColumns(self.runs, self.common)

    def nominal(self, run: int) -> Array:
        """Torques predicted by the robot file in one recording, zero where nothing is compared, (K, n)."""
        laws = [self.columns(one.term, run)[:, :, 0] for one in self.laws]
        return np.asarray(sum(laws, self.designs[run] @ self.file_values))

    def target(self, run: int) -> Array:
        """Torques to be fitted, zero where nothing is compared, shape (K, n).

        The recorded torques are already shifted by the delays at which the recording is linearised; the
        columns of the delays times these delays are added back.
        """
        if run not in self._targets:
            own, first = self.runs[run], self.file_values.size - self.size.size
            shift = self.designs[run][:, :, first:] @ own.delays
            self._targets[run] = np.where(own.rows.counted, own.torque + shift, 0.0)
        return self._targets[run]

    @property
    def sigma(self) -> Array:
        """rms residual of the standard model at each joint, shape (n,)."""
        return self.standard.estimate.sigma

    @property
    def width(self) -> float:
        """Relative width of the prior of bodies chosen in the fit of the standard model."""
        return self.standard.estimate.width

    @property
    def timing(self) -> tuple[str, ...]:
        """Name of the delay common to all torques."""
        return (TIMING,)

    @property
    def delays(self) -> tuple[str, ...]:
        """Names of the additional delays of single joints."""
        return tuple(f"{joint}.{TIMING}" for joint in self.joints)

    def time(self, run: int) -> Array:
        """Times of the rows of one recording [s], shape (K,)."""
        return self.runs[run].rows.time

    def counted(self, run: int) -> Mask:
        """Mask of the rows of one recording that are compared, shape (K, n)."""
        return self.runs[run].rows.counted

    def samples(self, run: int) -> Array:
        """Number of samples that each row of one recording counts as, 0 to 1, shape (K, n)."""
        return self.runs[run].rows.samples

    def candidates(
        self, hypothesis: Hypothesis, parameters: Array, residual: Sequence[Array]
    ) -> list[Candidate]:
        """Candidates that may be added to a hypothesis."""
        channels = frozenset.intersection(*(run.channels for run in self.runs))
        coulomb = {j: float(parameters[self.layout.names.index(f"{j}.coulomb")]) for j in self.joints}
        seen = [self.fitted_rows(i) for i in range(self.fitted)]
        where = places(self.robot, self.runs, seen, residual, coulomb)
        sigma = np.sqrt(np.sum([(own**2).sum(axis=0) for own in residual], axis=0))
        sigma = np.maximum(sigma / np.sqrt(max(sum(map(len, residual)), 1)), self.error)
        fitted = self.runs[: self.fitted]
        touched = at_links(self.robot, hypothesis, fitted, residual, sigma)
        if not self.scans:
            self.scans.append(scans_of(self.robot, fitted, seen))
        yields = scanned(self.robot, self.scans[0], hypothesis, self.designs[: self.fitted], residual, sigma)
        return [*candidates(self.robot, hypothesis, where, channels, self.given), *touched, *yields]

    def cut(self, terms: Sequence[Term]) -> Array:
        """Number of rows of each block and joint in which terms saturate the torque, shape (B, n)."""
        found = np.zeros_like(self.counts)
        for term in terms:
            if term.effect.cuts_torque:
                rows = [np.where(run.rows.counted, cut(term, run, i), 0.0) for i, run in enumerate(self.runs)]
                found += [rows[block.run][block.rows].sum(axis=0) for block in self.blocks]
        return found

    @cached_property
    def orders(self) -> Array:
        """Number of distinguishable angular orders of a wave over each joint's position, shape (n,).

        Orders differ by one cycle over the travel; the highest one reaches the end of the band at the
        median speed. At least one.
        """
        found = np.ones(self.size.size)
        for run in self.runs[: self.fitted]:
            motion = run.motion
            travel, speed = np.ptp(motion.position, axis=0), np.median(np.abs(motion.velocity), axis=0)
            found = np.maximum(found, motion.cutoff * travel / np.maximum(speed, 1e-12))
        return found

    @property
    def start(self) -> Array:
        """The fitted parameters of the standard model, with zero delays, shape (X,)."""
        return np.concatenate([self.standard.estimate.values, np.zeros(self.size.size + 1)])


def _designs(runs: Sequence[Run]) -> tuple[Array, ...]:
    return tuple(
        np.where(
            r.rows.counted[:, :, None], np.concatenate([design_of(r.rows), _delay_columns(r)], axis=2), 0.0
        )
        for r in runs
    )


def _delay_columns(run: Run) -> Array:
    """Derivatives of the torques by delays, the common one first: minus their rates, shape (K, n, 1 + n).

    Dry friction is omitted since it changes only where nothing is compared. Zero at undriven joints, whose
    torque is known to be zero.
    """
    time, joints = run.motion.time, len(run.model.joints)
    rate = -run.reduce(np.asarray(make_interp_spline(time, run.sliding, k=3)(time, 1))) * run.driven
    found = np.zeros((len(rate), joints, 1 + joints))
    found[:, :, 0] = rate
    found[:, np.arange(joints), 1 + np.arange(joints)] = rate
    return run.rows.nuisance.removed(found)


def _with_timing(base: Layout, joints: Sequence[str], driven: NDArray[np.bool_], step: float) -> Layout:
    size = len(base.names)
    offsets = [base.names.index(f"{joint}.offset") for joint in joints]
    slides = [bool(base.free[place] and moved) for place, moved in zip(offsets, driven)]
    free = np.array([any(slides), *(one and sum(slides) > 1 for one in slides)])
    width = np.array([step, *[np.hypot(step, FILTER)] * len(joints)])
    return Layout(
        names=(*base.names, TIMING, *(f"{joint}.{TIMING}" for joint in joints)),
        start=np.concatenate([base.start, np.zeros(free.size)]),
        free=np.concatenate([base.free, free]).astype(bool),
        bodies=base.bodies,
        gaussian=np.concatenate([base.gaussian, size + np.flatnonzero(free)]),
        positive=base.positive,
        size=np.concatenate([base.size, width]),
        centre=np.concatenate([base.centre, np.zeros(free.size)]),
        width=np.concatenate([base.width, width]),
        beams=base.beams,
        scale=np.concatenate([base.scale, np.zeros(width.size)]),
    )


def _given(robot: Robot, file_values: Mapping[str, float]) -> Iterator[Candidate]:
    """Effects of the robot file at joints that are not in the standard model.

    Friction laws, their modifiers and gears behind the only encoder; and effects already subtracted from the
    rows (springs, ripple), whose linear parameters may be wrong.

    Args:
        robot: nominal.
        file_values: parameters of the standard model by the robot file.
    """
    parameters = {effect for effect, _, _ in EFFECTS.values()}
    joints = {drive.name for drive in robot.drives}
    counts = Counter((used.effect.id, used.at) for used in used_effects(robot))
    for used in used_effects(robot):
        if used.effect.id in parameters or used.at not in joints:
            continue
        if is_friction(used.effect):
            level = f"{used.at}.coulomb"
            held = ((level, float(file_values[level])),) if used.effect.family else ()
            yield Candidate(Term.given(used.effect, used.at, used.parameters), held)
        elif isinstance(used.effect, YieldingGear):
            yield Candidate(Term.given(used.effect, used.at, used.parameters))
        elif isinstance(used.effect, JointEffect) and counts[used.effect.id, used.at] == 1:
            yield Candidate(Term.given(used.effect, used.at, used.parameters, in_rows=True))


def _file_values(robot: Robot, model: RobotModel) -> Array:
    """Values of the standard model's parameters in the robot file, shape (X,)."""
    known = {effect: (kind, sign) for kind, (effect, _, sign) in EFFECTS.items()}
    friction = dict.fromkeys((f"{joint}.{kind}" for joint in model.joints for kind in FRICTION), 0.0)
    for used in used_effects(robot):
        name, sign = known.get(used.effect.id, ("", 0.0))
        if f"{used.at}.{name}" in friction:
            friction[f"{used.at}.{name}"] += sign * next(iter(used.parameters.values()))
    return np.concatenate([inertial_with_effects(model), list(friction.values())])
