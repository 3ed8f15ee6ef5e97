"""Integrating the closed loop with exact stick and slip: between events the equations are smooth.

Dormand and Prince's method of order 8 with dense output (Hairer, Norsett, Wanner, Solving Ordinary
Differential Equations I, 1993, II.5-6), or Radau IIA of order 5 where effects have states of their own, which
are stiff. A zero of the dense output ends a piece: a sliding joint comes to rest, or the holding force of a
sticking one reaches its bound. Then the modes of all joints at rest are determined again together, because
each joint changes the loads and accelerations of the others.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations, product
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reference_model.codegen.batched import Batched, Single
from reference_model.codegen.compiled import compiled
from reference_model.plant.loop import LOOP_TOLERANCE, unsettled
from reference_model.plant.sticking import StickingPlant
from reference_model.steppers.effort import Effort
from reference_model.steppers.held_pieces import SAME_INSTANT
from reference_model.steppers.integration import LONGEST_STEP, Course, symbols
from robot_model import InputError, Robot

__all__ = ["integrate_sticking"]

Array = NDArray[np.float64]

#: Excess of a holding force over its bound at which the joint breaks away, relative to 1 + the bound. The
#: joint then certainly accelerates, and a joint just found sticking is not released by rounding.
PAST_THE_BOUND = 1e-10
#: A sliding joint is stopped this far beyond zero speed, and is then set to rest [rad/s or m/s]. One that
#: breaks away is faster within microseconds.
PAST_REST = 1e-12
#: Joints slower than this are at rest: the above with a margin for rounding.
AT_REST = 10 * PAST_REST
#: More changes of mode than this within the longest step are chattering, not motion.
MOST_CHANGES = 500
#: Most combinations of modes tried at one instant: all of seven joints at rest at once.
MOST_TRIALS = 3**7


def integrate_sticking(
    plant: StickingPlant,
    reference: ca.Function,
    time: Array,
    *,
    hold: float,
    rtol: float,
    atol: float,
    compile_code: bool = False,
    effort: Effort | None = None,
) -> Course:
    """The course of the closed loop at the instants `time`, which begin at 0; see `integration.integrate`.

    Every evaluation of the equations of motion adds the number of states to `effort`.

    Raises:
        InputError: stick and slip alternate without end, no modes fit, or the integration fails.
    """
    sampled = hold > 0
    functions = _Functions(plant, reference, sampled, compile_code)
    effort = effort or Effort()
    longest = LONGEST_STEP * float(np.diff(time).min()) if len(time) > 1 else np.inf
    method = "Radau" if plant.forces.states else "DOP853"
    options: dict[str, Any] = {"rtol": rtol, "atol": atol, "method": method, "max_step": longest}
    state = plant.initial(reference)
    command = functions.law(0.0, state) if sampled else np.zeros(plant.commands)
    state, mode = _agreed(functions, 0.0, state, command)
    shown = [(state, mode, command)]
    now = 0.0
    for stop, outputs, ticks in _pieces(time, hold):
        passed, state, mode = _moved(functions, state, command, mode, (now, stop), outputs, options, effort)
        shown += [(*one, command) for one in passed]
        now = stop
        if ticks:
            command = functions.law(now, state)
            state, mode = _agreed(functions, now, state, command)
            if len(outputs) and outputs[-1] == stop:
                shown[-1] = (state, mode, command)
    states, modes, commands = (np.array(part) for part in zip(*shown))
    given = commands if sampled else functions.commands(time[:, None], states)
    return Course(time, states, given, modes)


class _Functions:
    """Functions evaluated by the integration, of (t, x, held command, mode).

    Attributes:
        plant: the closed loop.
        slope, verdict, jacobian: time derivative of the state; see `StickingPlant`; derivative of the first.
        law: (t, x) -> command.
        commands: the same for all instants.
        speeds: places of the joints' velocities in the state.
    """

    def __init__(
        self, plant: StickingPlant, reference: ca.Function, sampled: bool, compile_code: bool
    ) -> None:
        self.plant = plant
        t, x, kind = symbols(reference, plant.layout.size)
        held, mode = kind.sym("held", plant.commands), kind.sym("mode", plant.layout.joints)
        goal = reference(t)
        wish = plant.command(t, x, *goal)
        given = (t, x, goal[0], held if sampled else wish, mode)
        rate = plant.rate(*given)
        inputs = [t, x, held, mode]
        functions: tuple[ca.Function, ...] = (
            ca.Function("slope", inputs, [rate]),
            ca.Function("verdict", inputs, list(plant.verdict(*given))),
            ca.Function("jacobian", inputs, [ca.densify(ca.jacobian(rate, x))]),
        )
        if compile_code:
            functions = compiled(functions).functions
        self.slope, self.verdict, self.jacobian = map(Single, functions)
        self._law = ca.Function("law", [t, x], [wish])
        places = np.arange(plant.layout.size, dtype=float)
        first = int(plant.layout.split(places)["velocity"][0])
        self.speeds = slice(first, first + plant.layout.joints)

    def law(self, now: float, state: Array) -> Array:
        return np.asarray(self._law(now, state)).ravel()

    def commands(self, time: Array, states: Array) -> Array:
        return Batched(self._law)(time, states)[0]


def _pieces(time: Array, hold: float) -> Iterator[tuple[float, Array, bool]]:
    """Ends of the pieces with a held command, the outputs in each, and whether the controller acts then.

    Outputs are instants after the previous piece; one at a controller instant ends its piece.
    """
    wanted = time[1:].copy()
    count = int(np.floor(time[-1] / hold * (1 + SAME_INSTANT))) if hold > 0 else 0
    for tick in np.arange(1, count + 1) * hold:
        wanted[np.abs(wanted - tick) <= SAME_INSTANT * hold] = tick
        yield float(tick), wanted[wanted <= tick], True
        wanted = wanted[wanted > tick]
    if len(wanted):
        yield float(wanted[-1]), wanted, False


def _moved(
    functions: _Functions,
    state: Array,
    command: Array,
    mode: Array,
    span: tuple[float, float],
    outputs: Array,
    options: Mapping[str, Any],
    effort: Effort,
) -> tuple[list[tuple[Array, Array]], Array, Array]:
    """States and modes at the outputs of a span over which a command is held, and at its end."""
    now, stop = span
    passed: list[tuple[Array, Array]] = []
    latest: deque[float] = deque(maxlen=MOST_CHANGES)
    while True:
        given = {**options, "jac": _jacobian(functions, command, mode)} if _stiff(options) else options
        piece = solve_ivp(
            lambda t, x, m=mode: functions.slope(t, x, command, m)[0][:, 0],
            (now, stop),
            state,
            events=_events(functions, command, mode),
            dense_output=True,
            **given,
        )
        effort.states += piece.nfev * len(state)
        now, state = float(piece.t[-1]), piece.y[:, -1]
        if piece.status < 0 or not np.isfinite(state).all():
            raise _failed(functions.plant.robot, now)
        here, outputs = outputs[outputs <= now], outputs[outputs > now]
        passed += [(piece.sol(instant), mode) for instant in here]
        if piece.status == 0:
            return passed, state, mode
        if len(latest) == MOST_CHANGES and now - latest[0] < options["max_step"]:
            raise _chatters(functions.plant.robot, now)
        latest.append(now)
        state, mode = _agreed(functions, now, state, command)


def _stiff(options: Mapping[str, Any]) -> bool:
    return options["method"] == "Radau"


def _jacobian(functions: _Functions, command: Array, mode: Array) -> Callable[[float, Array], Array]:
    return lambda t, x: functions.jacobian(t, x, command, mode)[0]


def _events(functions: _Functions, command: Array, mode: Array) -> list[Callable[[float, Array], float]]:
    """For each joint that can stick a function that falls through zero where its mode ends."""
    allowed = np.where(mode == 0, PAST_THE_BOUND, PAST_REST)
    latest: dict[tuple[float, bytes], Array] = {}

    def margins(t: float, x: Array) -> Array:
        key = (t, x.tobytes())
        if key not in latest:
            latest.clear()
            latest[key] = functions.verdict(t, x, command, mode)[0][:, 0] + allowed
        return latest[key]

    def ending(joint: int) -> Callable[[float, Array], float]:
        def event(t: float, x: Array) -> float:
            return float(margins(t, x)[joint])

        event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
        return event

    return [ending(joint) for joint in functions.plant.dry]


def _agreed(functions: _Functions, now: float, state: Array, command: Array) -> tuple[Array, Array]:
    """The state with resting joints exactly at rest, and consistent modes with the most sticking joints."""
    state = state.copy()
    speed = state[functions.speeds]  # a view
    dry = functions.plant.dry
    resting = [joint for joint in dry if abs(speed[joint]) <= AT_REST]
    speed[resting] = 0.0
    sliding = np.ones(len(speed))
    for joint in dry:
        sliding[joint] = np.sign(speed[joint])
    settled = False
    for _, mode in zip(range(MOST_TRIALS), _trials(sliding, resting)):
        margin, moved, residual = (part[:, 0] for part in functions.verdict(now, state, command, mode))
        if not residual[0] < LOOP_TOLERANCE:
            continue
        settled = True
        if all(
            margin[joint] >= -PAST_THE_BOUND / 2 if mode[joint] == 0 else mode[joint] * moved[joint] > 0
            for joint in resting
        ):
            return state, mode
    raise _disagree(functions.plant.robot, now, resting) if settled else unsettled(functions.plant.robot, now)


def _trials(sliding: Array, resting: Sequence[int]) -> Iterator[Array]:
    """Modes of all joints: those at rest stick, then one of them slides either way, then two, and so on."""
    for count in range(len(resting) + 1):
        for joints in combinations(resting, count):
            for signs in product((1.0, -1.0), repeat=count):
                mode = sliding.copy()
                mode[list(resting)] = 0.0
                mode[list(joints)] = signs
                yield mode


def _chatters(robot: Robot, now: float) -> InputError:
    return InputError(
        f"robot '{robot.name}': stick and slip alternate more than {MOST_CHANGES} times within two samples "
        f"at t = {now:.6g} s; simulate without exact stiction, or lower the controller's gains."
    )


def _disagree(robot: Robot, now: float, resting: Sequence[int]) -> InputError:
    names = ", ".join(robot.moving_joints[joint].name for joint in resting)
    return InputError(
        f"robot '{robot.name}': at t = {now:.6g} s neither sticking nor sliding of {names} agrees with the "
        "friction it causes; lower the coefficients of load-dependent friction or its arms."
    )


def _failed(robot: Robot, now: float) -> InputError:
    return InputError(
        f"robot '{robot.name}': the simulation with exact stiction stopped after t = {now:.6g} s because no "
        "step was small enough for the tolerance; try lower controller gains or a smoother reference."
    )
