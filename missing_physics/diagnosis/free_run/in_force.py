"""Whether the controller of the robot file was in force in a recording.

What a controller commands is known along any recorded motion: it needs the reference, the joints' positions
and rates, and nothing of the robot that is to be found. A recorded torque that is something else was made by
another controller, or is what sensors and drives make of the right one. The latter are effects to be found,
so all that they can do is given away: to first order, a torque's gain, offset, delay and ripple, and the
gain, offset, delay, drift and cycle of each position, which a stiff controller multiplies by its gains. Only
what is left of the torque after that, beyond the noise that the controller makes of the encoders', counts.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import lsq_linear

from missing_physics.diagnosis.free_run.model import LoopModel, Row
from missing_physics.diagnosis.free_run.run import Runner
from missing_physics.diagnosis.motion.estimate import Motion
from missing_physics.diagnosis.motion.low_pass import LowPass
from missing_physics.recordings import percent
from reference_model.codegen.batched import Batched
from reference_model.control.laws import has_integral
from reference_model.effects.base import GearEffect
from reference_model.effects.body_force import ForceEffect
from reference_model.effects.catalogue import get_effect
from reference_model.effects.structure import StructureEffect
from robot_model import NoController, Recording, Robot

__all__ = ["NOT_IN_FORCE", "another_controller", "not_commanded"]

Array = NDArray[np.float64]

#: Torque that the controller does not explain, as a part of how the recorded one varies (rms), beyond which
#: another controller was in force.
NOT_IN_FORCE = 0.15
#: What effects may do: error of a torque's gain, of a position's gain, delays either way [s], zero errors and
#: cycles of an encoder [rad or m], and rate of a clock.
TORQUE_GAIN, POSITION_GAIN, DELAY, ZERO, CLOCK = 0.2, 0.1, 0.03, 0.1, 0.02
#: Noise may be known to this factor only.
NOISE = 2.0
#: Cycles are looked for up to this order, in steps of this part of the way's own [1/rad].
HIGHEST, STEP = 400.0, 0.5
#: No more of them at once: of a joint that turns so often between samples, cycles are not to be told anyway.
MOST_ORDERS = 20_000
#: Finer orders about the best of these.
FINE = 41
#: Way of a joint along which they are looked for first [rad], and how many are pursued along longer ones.
WAY, PURSUED = 12.0, 5
#: A drive that saturates gives this part of its largest torque on average where more is commanded.
SATURATED = 0.9
#: Step of a derivative, as a part of the motion's range.
SMALL = 1e-4
#: Fewest rows that are compared.
FEWEST = 32


def another_controller(robot: Robot, recordings: Sequence[Recording], motions: Sequence[Motion]) -> str:
    """A sentence where the robot's controller was not in force in one of the recordings; empty otherwise.

    Args:
        robot: with the controller that is asked about.
        recordings: see `not_commanded`.
        motions: what each says.
    """
    for recording, motion in zip(recordings, motions):
        left = not_commanded(robot, recording, motion)
        if left > NOT_IN_FORCE:
            return (
                f"The torques in {recording.source or 'the recording'} are not what the robot file's "
                "controller commands along the recorded motion, nor what sensors and drives can make of it "
                f"(they differ by {percent(left)}): another controller was in force, and runs in closed loop "
                "say nothing of what was named."
            )
    return ""


def not_commanded(robot: Robot, recording: Recording, motion: Motion, *, seed: int = 0) -> float:
    """Largest part of a joint's torque that its controller does not explain, rms over rms.

    Args:
        robot: with the controller that is asked about.
        recording: holds every moving joint's position, and the reference of those that are driven.
        motion: what the recording says.
        seed: of the noise that is passed through the controller.

    Returns:
        0 where no torque is known, where the noise hides what is left, and for robots with a free base,
        flexible links, spherical joints or no controller, which are not looked into.
    """
    if isinstance(robot.controller, NoController) or robot.base.kind == "free":
        return 0.0
    if robot.flexible_links or robot.spherical_joints:
        return 0.0
    along = _Along.of(_acting(robot), recording, motion)
    commanded = along.command(along.q, along.v)
    noisy = along.noise(np.random.default_rng(seed))
    worst = 0.0
    for k in range(along.q.shape[1]):
        torque = np.interp(along.time, motion.time, motion.torque[:, k])
        motor = robot.moving_joints[k].actuator
        if np.isfinite(torque).all() and motor is not None:
            stated = np.inf if motor.torque_limit is None else motor.torque_limit
            worst = max(worst, _left(along, k, torque, commanded[:, k], noisy[:, k], stated))
    return worst


@dataclass(frozen=True)
class _Along:
    """A recorded motion and what a controller commands along it.

    Attributes:
        time: of the samples that the motion covers, shape (N,).
        q, v: positions and rates, shape (N, n).
        command: of a motion, shape (N, n).
        motion: filters as torques are.
    """

    time: Array
    q: Array
    v: Array
    command: Callable[[Array, Array], Array]
    motion: Motion
    integrates: bool

    @classmethod
    def of(cls, robot: Robot, recording: Recording, motion: Motion) -> _Along:
        runner = Runner(robot, recording)
        inside = (runner.time >= motion.time[0]) & (runner.time <= motion.time[-1])
        time, rows = runner.time[inside], runner.rows[inside]
        q, v = (_resampled(time, motion.time, series) for series in (motion.position, motion.velocity))
        ends, constants = Row.ends(q.shape[1]), runner.constants()
        commanded = Batched(LoopModel(robot).commanded())

        def command(position: Array, rate: Array) -> Array:
            error = rows[:, ends[1] : ends[2]] - position
            integral = cumulative_trapezoid(error, time, axis=0, initial=0.0)
            return np.asarray(commanded(position, rate, integral, rows, constants)[0])

        return cls(time, q, v, command, motion, has_integral(robot))

    def reduced(self, values: Array) -> Array:
        """Through the filter in which torques are compared, shape (R, ...)."""
        return self.motion.low_pass.reduce(_resampled(self.motion.time, self.time, values))

    def noise(self, rng: np.random.Generator) -> Array:
        """What the noise of positions, as far as it is left in the motion, makes the controller command."""
        motion = self.motion
        smoother = LowPass(motion.low_pass.rate, motion.motion_cutoff)
        shaken = _resampled(self.time, motion.time, smoother.smooth(motion.drawn_noise(rng)))
        rate = np.gradient(shaken, self.time, axis=0)
        return self.command(self.q + shaken, self.v + rate) - self.command(self.q, self.v)

    def moved(self, joint: int, error: Array) -> Array:
        """What the command changes by where a joint is elsewhere by a small error, per unit of it, (N, n)."""
        size = SMALL * max(float(np.ptp(self.q[:, joint])), 1e-9) / max(float(np.abs(error).max()), 1e-300)
        q, v = self.q.copy(), self.v.copy()
        q[:, joint] += size * error
        v[:, joint] += size * np.gradient(error, self.time)
        return (self.command(q, v) - self.command(self.q, self.v)) / size


def _acting(robot: Robot) -> Robot:
    """The robot as its controller knows it: without limits, which an encoder's error seems to exceed.

    Nor with what lies behind its joints.
    """
    behind = GearEffect | StructureEffect | ForceEffect
    kept = tuple(use for use in robot.effects if not isinstance(get_effect(use.effect), behind))
    joints = tuple(
        joint.model_copy(update={"actuator": joint.actuator.model_copy(update={"torque_limit": None})})
        if joint.actuator is not None
        else joint
        for joint in robot.joints
    )
    return robot.model_copy(update={"effects": kept, "joints": joints})


def _resampled(time: Array, known: Array, values: Array) -> Array:
    """Columns at other instants, shape (N, ...)."""
    if values.ndim == 1:
        return np.interp(time, known, values)
    return np.column_stack([np.interp(time, known, column) for column in values.T])


def _left(
    along: _Along, k: int, torque: Array, commanded: Array, noisy: Array, stated: float = np.inf
) -> float:
    """Part of one joint's torque that is left, rms over rms of how it varies; its limit may be `stated`."""
    target = along.reduced(torque)
    size = float(np.std(target))
    if target.size < FEWEST or size <= 0.0:
        return 0.0
    rate, cutoff = along.motion.low_pass.rate, along.motion.low_pass.cutoff
    white = float(along.motion.torque_noise[k]) * np.sqrt(min(2.0 * cutoff / rate, 1.0))
    hidden = NOISE * float(np.hypot(np.std(along.reduced(noisy)), white))

    def part(residual: Array) -> float:
        return float(np.sqrt(max(float(np.mean(residual**2)) - hidden**2, 0.0))) / size

    # Of a drive that saturates, the largest recorded torque is the limit, and holds where more is commanded.
    best, most = np.inf, float(np.abs(torque).max())
    beyond = np.abs(commanded) > most
    held = beyond.any() and float(np.mean((torque * np.sign(commanded))[beyond])) > SATURATED * most
    for limit in (np.inf, *([stated] if stated < np.inf else []), *([most] if held else [])):
        columns = [column for column in _effects(along, k, commanded, limit) if column[0].any()]
        residual = _residual(columns, target)
        best = min(best, part(residual))
        if best > NOT_IN_FORCE:
            best = min(
                best, part(_residual([*columns, *_cycle(along, k, commanded, residual, limit)], target))
            )
        if best <= NOT_IN_FORCE:
            break
    return best


#: A filtered column, and the least and greatest coefficient that an effect gives it.
Column = tuple[Array, float, float]


def _residual(columns: Sequence[Column], target: Array) -> Array:
    """What columns leave of a target."""
    matrix = np.column_stack([values for values, _, _ in columns])
    scale = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    low, high = (np.array([column[side] for column in columns]) for side in (1, 2))
    found = lsq_linear(matrix / scale, target, (low * scale, high * scale), method="bvls")
    return np.asarray(target - matrix @ (found.x / scale))


def _effects(along: _Along, k: int, commanded: Array, limit: float) -> Iterator[Column]:
    """What the command and effects of the torque's sensor, of the drive and of encoders do to the torque."""
    ones, since = np.ones(along.time.size), along.time - along.time[0]
    free = np.abs(commanded) < limit
    given = np.clip(commanded, -limit, limit)
    yield along.reduced(given), 1.0 - TORQUE_GAIN, 1.0 + TORQUE_GAIN
    yield along.reduced(np.gradient(given, along.time)), -DELAY, DELAY
    yield along.reduced(ones), -np.inf, np.inf
    if along.integrates:  # of a zero error
        yield along.reduced(free * since), -np.inf, np.inf
    for joint in range(along.q.shape[1]):
        own = (
            (along.q[:, joint], POSITION_GAIN),
            (along.v[:, joint], DELAY),
            (ones, ZERO),
            (since * along.v[:, joint], CLOCK),
        )
        for error, most in own:
            yield along.reduced(free * along.moved(joint, error)[:, k]), -most, most


def _cycle(along: _Along, k: int, commanded: Array, residual: Array, limit: float) -> list[Column]:
    """Ripple of a torque and an eccentric disc of an encoder, of the order that says most of a residual.

    Where a joint goes a long way, orders are looked for in a stretch of it first, which needs fewer of them.
    """
    low_pass, now = along.motion.low_pass, along.motion.time
    q, v = along.motion.position[:, k], along.motion.velocity[:, k]
    stiffness = along.moved(k, np.ones_like(along.time))[:, k]
    since = along.time - along.time[0]
    damping = along.moved(k, since)[:, k] - since * stiffness
    ones = np.ones_like(commanded)
    free, given, stiff, damped = (
        _resampled(now, along.time, (np.abs(commanded) < limit) * series)
        for series in (ones, commanded, stiffness, damping)
    )
    largest = TORQUE_GAIN * min(float(np.std(commanded)), limit)

    def columns(order: float, rows: slice) -> Array:
        cosine, sine = np.cos(order * q[rows]), np.sin(order * q[rows])
        speed = order * v[rows] * damped[rows]
        ripple = [cosine * free[rows], sine * free[rows], cosine * given[rows], sine * given[rows]]
        disc = [stiff[rows] * cosine - speed * sine, stiff[rows] * sine + speed * cosine]
        return low_pass.reduce(np.column_stack([*ripple, *disc]))

    def best_of(orders: Array, apart: float, first: int, last: int) -> Array:
        """Those that leave least, which are so far apart, best first."""
        rows = slice(first * low_pass.stride, 2 * low_pass.edge + last * low_pass.stride + 1)
        target = residual[first : last + 1]
        left = []
        for order in orders:
            values = columns(order, rows)
            found = np.linalg.lstsq(values, target, rcond=1e-8)[0]
            left.append(float(np.sum((target - values @ found) ** 2)))
        best: list[float] = []
        for order in orders[np.argsort(left)]:
            if len(best) < PURSUED and all(abs(order - other) > apart for other in best):
                best.append(order)
        return np.array(best)

    way = q[low_pass.kept(len(q))]
    fine = np.linspace(-1.0, 1.0, FINE)
    longest, orders, step = WAY, np.zeros(0), 0.0
    slowest = max(HIGHEST, 3 * np.pi / max(float(np.ptp(way)), 1e-6))
    while True:
        first, last = _stretch(way, residual, longest)
        once = 2 * np.pi / max(float(np.ptp(way[first : last + 1])), 1e-6)  # slower ones are none on this way
        about, step = np.ravel(orders[:, None] + step * fine), STEP * once
        further = np.arange(once, min(slowest, once + MOST_ORDERS * step), step)
        orders = best_of(np.r_[about, further], 2 * step, first, last)
        if longest >= float(np.ptp(way)):
            break
        slowest, longest = min(slowest, once), longest * (FINE - 1) / 2
    best = float(best_of(orders[0] + step * fine, 0.0, first, last)[0])
    bounds = [largest] * 2 + [TORQUE_GAIN] * 2 + [ZERO] * 2
    return [(column, -bound, bound) for column, bound in zip(columns(best, slice(None)).T, bounds)]


def _stretch(way: Array, residual: Array, most: float) -> tuple[int, int]:
    """First and last row of the stretch in which a joint goes no longer way, and most of a residual lies."""
    energy = np.r_[0.0, np.cumsum(residual**2)]
    highest: deque[int] = deque()
    lowest: deque[int] = deque()
    first, best, found = 0, -1.0, (0, len(way) - 1)
    for last, here in enumerate(way):
        while highest and way[highest[-1]] <= here:
            highest.pop()
        while lowest and way[lowest[-1]] >= here:
            lowest.pop()
        highest.append(last)
        lowest.append(last)
        while way[highest[0]] - way[lowest[0]] > most:
            first += 1
            for ends in (highest, lowest):
                if ends[0] < first:
                    ends.popleft()
        if energy[last + 1] - energy[first] >= best:
            best, found = energy[last + 1] - energy[first], (first, last)
    return found
