"""Integrating the closed loop with CVODES (SUNDIALS; Hindmarsh et al., ACM TOMS 31 (2005) 363-396).

Backward differentiation with Newton iteration and exact Jacobians, because smoothed dry friction and tight
control are stiff. A sampled controller's command is constant between its instants, so the integration
restarts there, after one explicit step where that is accurate enough; a continuous one needs a single run.
The right-hand side and its Jacobian can be compiled C (see `compiled`); the course is the same.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.codegen.batched import Batched
from reference_model.codegen.compiled import compiled
from reference_model.plant.closed_loop import TIP_NUMBERS, Plant
from reference_model.plant.loop import LOOP_TOLERANCE, unsettled
from reference_model.steppers.held_pieces import Piece, in_pieces
from robot_model import InputError
from robot_model.system.interrupts import interruptible

__all__ = [
    "LONGEST_STEP",
    "MAX_STEPS",
    "Course",
    "advance_held",
    "along_tables",
    "cvodes",
    "cvodes_options",
    "integrate",
    "stopped",
    "symbols",
]

Array = NDArray[np.float64]
#: Largest number of CVODES steps between two output instants; a stiff reversal takes hundreds.
MAX_STEPS = 10_000

#: Longest step in output intervals. CVODES would otherwise step over a short pulse that begins during a rest,
#: and an implicit method over many time constants of an unstable loop makes it look stable.
LONGEST_STEP = 2.0


@dataclass(frozen=True)
class Course:
    """States and commands over time.

    Attributes:
        time: [s], shape (N,).
        states: shape (N, rows).
        commands: in force from each instant on, rows as of `control.command`, shape (N, rows).
        modes: 1, -1 or 0 of joints that slide either way or stick, shape (N, n), where they are exact.
    """

    time: Array
    states: Array
    commands: Array
    modes: Array | None = None


def integrate(
    plant: Plant,
    reference: ca.Function,
    time: Array,
    *,
    hold: float,
    rtol: float,
    atol: float,
    compile_code: bool = False,
) -> Course:
    """The course of the closed loop at the instants `time`, which begin at 0.

    Args:
        plant: the closed loop.
        reference: t -> r, rd, rdd.
        time: output instants [s], rising.
        hold: interval over which a command is held [s]; 0 for a continuous controller.
        rtol, atol: tolerances of CVODES.
        compile_code: run the plant as compiled C where that is possible.

    Raises:
        InputError: the integration fails; the message gives time, state and what to try.
    """
    options = cvodes_options(rtol, atol)
    if hold <= 0 and len(time) > 1:  # pieces of a sampled run are short anyway, and count time from 0 to 1
        options["max_step_size"] = LONGEST_STEP * float(np.diff(time).min())
    if hold > 0:
        return _sampled(plant, reference, time, hold, options, compile_code)
    return _continuous(plant, reference, time, options, compile_code)


def cvodes_options(rtol: float, atol: float) -> dict[str, Any]:
    """Of CVODES, and of the explicit steps before it."""
    return {"reltol": rtol, "abstol": atol, "max_num_steps": MAX_STEPS, "disable_internal_warnings": True}


def cvodes(dae: Mapping[str, Any], grid: Any, options: Mapping[str, Any], compile_code: bool) -> ca.Function:
    """CVODES from 0 over the instants of `grid`.

    An integrator looks in its `cache` for its right-hand side and Jacobian before it makes them; so those
    of a first integrator, compiled, serve a second one.
    """
    solver = ca.integrator("course", "cvodes", dict(dae), 0.0, grid, dict(options))
    if not compile_code:
        return solver
    own = [solver.get_function(name) for name in ("daeF", "jacF")]
    cache = {function.name(): function for function in compiled(own).functions}
    return ca.integrator("course", "cvodes", dict(dae), 0.0, grid, {**options, "cache": cache})


def symbols(reference: ca.Function, size: int) -> tuple[Any, Any, Any]:
    """Symbols of time and state of the type that `reference` accepts, and that type."""
    kind = ca.SX if reference.is_a("SXFunction") else ca.MX
    return kind.sym("t"), kind.sym("x", size), kind


def _continuous(
    plant: Plant, reference: ca.Function, time: Array, options: Mapping[str, Any], compile_code: bool
) -> Course:
    t, x, kind = symbols(reference, plant.layout.size)
    goal = reference(t)
    command = plant.command(t, x, *goal)
    states = plant.initial(reference)[None]
    if len(time) > 1:
        dae = {"t": t, "x": x, "ode": plant.rate(t, x, goal[0], command)}
        if kind is ca.MX:
            options = {**options, "cache": along_tables(plant, reference)}
        solver = cvodes(dae, time[1:].tolist(), options, compile_code)
        try:
            with interruptible():
                found = solver(x0=states[0])["xf"]
            states = np.vstack([states, found.full().T])
        except RuntimeError:
            states = _with_restarts(plant, reference, time, options)
    law = ca.Function("law", [t, x], [command])
    return Course(time, states, Batched(law)(time[:, None], states)[0])


def along_tables(plant: Plant, reference: ca.Function) -> dict[str, ca.Function]:
    """Right-hand side and Jacobian for a reference that only MX graphs can hold, as CVODES expects them.

    MX differentiates every call of a function separately and multiplies the results. Here the loop around the
    reference is differentiated as one SX expression, to which MX only passes the reference's values: the same
    numbers in a fifth of the time for an arm of six joints.
    """
    t, x = ca.SX.sym("t"), ca.SX.sym("x", plant.layout.size)
    goal = [ca.SX.sym(name, plant.layout.joints) for name in ("r", "rd", "rdd")]
    rate = plant.rate(t, x, goal[0], plant.command(t, x, *goal))
    slope = ca.jacobian(rate, x)
    own = [t, x, *goal]
    value = ca.Function("value", own, [rate], {"cse": True})
    slopes = ca.Function("slopes", own, [slope], {"cse": True})
    time, state, nothing = ca.MX.sym("t"), ca.MX.sym("x", x.shape[0]), [ca.MX.sym(k, 0) for k in "zpu"]
    along = reference(time)
    given, names = [time, state, *nothing], ["t", "x", "z", "p", "u"]
    none = ca.MX(0, 1)
    results = [value(time, state, *along), none]
    derived = [slopes(time, state, *along), ca.MX(0, x.shape[0]), ca.MX(x.shape[0], 0), ca.MX(0, 0)]
    slots = ["jac_ode_x", "jac_alg_x", "jac_ode_z", "jac_alg_z"]
    return {
        "daeF": ca.Function("daeF", given, results, names, ["ode", "alg"]),
        "jacF": ca.Function("jacF", given, derived, names, slots),
    }


def _with_restarts(plant: Plant, reference: ca.Function, time: Array, options: Mapping[str, Any]) -> Array:
    """States at all instants, restarting at each: the last attempt before an error."""
    advance = _advance(plant, reference, options, held=False, compile_code=False)
    states = [plant.initial(reference)]
    for now, then in itertools.pairwise(time):
        states.append(_step(plant, advance, states[-1], np.zeros(plant.commands), now, then))
    return np.array(states)


def _sampled(
    plant: Plant,
    reference: ca.Function,
    time: Array,
    hold: float,
    options: Mapping[str, Any],
    compile_code: bool,
) -> Course:
    """Integration with one explicit step for each piece where that is accurate enough, else CVODES."""
    advance = advance_held(plant, reference, options, compile_code=compile_code)
    rtol, atol = options["reltol"], options["abstol"]
    course = in_pieces(
        plant, reference, time, hold, rtol=rtol, atol=atol, moved=advance, compile_code=compile_code
    )
    return Course(time, *course)


def advance_held(
    plant: Plant, reference: ca.Function, options: Mapping[str, Any], *, compile_code: bool = False
) -> Piece:
    """CVODES over a piece in which the command is held."""
    advance = _advance(plant, reference, options, held=True, compile_code=compile_code)

    def moved(state: Array, command: Array, now: float, then: float) -> Array:
        return _step(plant, advance, state, command, now, then)

    return moved


def _advance(
    plant: Plant, reference: ca.Function, options: Mapping[str, Any], *, held: bool, compile_code: bool
) -> ca.Function:
    """State, [command; start; length] -> state at the end of a piece; time runs from 0 to 1 inside.

    The command is `held` over the piece, or else the controller's own at every instant.
    """
    reference = _needed(plant, reference) if held else reference
    t, x, kind = symbols(reference, plant.layout.size)
    p = kind.sym("p", plant.commands + 2)
    first, length = p[-2], p[-1]
    instant = first + t * length
    goal = reference(instant)
    command = p[: plant.commands] if held else plant.command(instant, x, *goal)
    dae = {"t": t, "x": x, "p": p, "ode": length * plant.rate(instant, x, goal[0], command)}
    settings = {key: value for key, value in options.items() if key != "max_step_size"}
    return cvodes(dae, 1.0, settings, compile_code)


def _needed(plant: Plant, reference: ca.Function) -> ca.Function:
    """The reference, or zeros where a held command leaves nothing that depends on it: those stay SX."""
    if plant.layout.integral:
        return reference
    t, zero = ca.SX.sym("t"), ca.DM.zeros(plant.layout.joints, 1)
    return ca.Function("none", [t], [ca.SX(zero)] * 3)


def _step(plant: Plant, advance: ca.Function, state: Array, command: Array, now: float, then: float) -> Array:
    if then <= now:
        return state
    try:
        with interruptible():
            found = advance(x0=state, p=[*command, now, then - now])["xf"]
        return found.full().ravel()
    except RuntimeError as error:
        raise _stopped(plant, now, state, command, error) from None


def _stopped(plant: Plant, instant: float, state: Array, command: Array, error: RuntimeError) -> InputError:
    reason = next((why for flag, why in _CVODE_REASONS.items() if flag in str(error)), "")
    return stopped(plant, instant, state, command, reason)


def stopped(plant: Plant, instant: float, state: Array, command: Array, reason: str) -> InputError:
    """Error for an integration that stops after `instant` [s] in this state; the reason may be empty."""
    watched = dict(zip(Plant.WATCHED, plant.watch(instant, state, np.zeros(plant.layout.joints), command)))
    if not float(watched["residual"]) < LOOP_TOLERANCE:
        return unsettled(plant.robot, instant)
    tips = watched["tips"].full().reshape(-1, TIP_NUMBERS)
    because = f" because {reason}" if reason else ""
    return InputError(
        f"robot '{plant.robot.name}': the simulation stopped after t = {instant:.6g} s{because} "
        f"({_where(plant, state, tips)}); try lower controller gains, a smoother reference, or coarser "
        "tolerances."
    )


def _where(plant: Plant, state: Array, tips: Array) -> str:
    """Text description of the state: joints, spherical joints, and tip deflections of flexible links."""
    parts, robot = plant.layout.split(state), plant.robot
    words = [
        f"{joint.name} at {q:.4g} {'m' if joint.kind == 'prismatic' else 'rad'} "
        f"moving at {qd:.4g} {'m' if joint.kind == 'prismatic' else 'rad'}/s"
        for joint, q, qd in zip(robot.moving_joints, parts["position"], parts["velocity"])
    ]
    turning = np.linalg.norm(parts["ball_rates"].reshape(-1, 3), axis=1)
    words += [f"{ball.name} turning at {w:.4g} rad/s" for ball, w in zip(robot.spherical_joints, turning)]
    bent = np.linalg.norm(tips[:, :3], axis=1)
    words += [f"tip of {link.name} deflected by {d:.4g} m" for link, d in zip(plant.flexible, bent)]
    return ", ".join(words) or "no joint moves"


_CVODE_REASONS: Mapping[str, str] = {
    "CV_TOO_MUCH_WORK": f"more than {MAX_STEPS} steps were needed to the next sample",
    "CV_ERR_FAILURE": "no step was small enough for the tolerance",
    "CV_CONV_FAILURE": "the implicit step did not converge",
    "CV_RHSFUNC_FAIL": "the accelerations are not finite",
    "CV_FIRST_RHSFUNC_ERR": "the accelerations are not finite at the start",
    "CV_REPTD_RHSFUNC_ERR": "the accelerations are not finite",
}
