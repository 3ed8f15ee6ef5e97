"""Plain Python for effects that a simulator's file cannot hold, written from their equations."""

from __future__ import annotations

import re
from collections.abc import Sequence

import casadi as ca

from missing_physics.export.content import Content
from reference_model.effects.base import Effect, JointEffect, JointSignals
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse, Robot

__all__ = ["code_of", "without_code"]

#: Signals that MuJoCo provides for a joint, as Python expressions.
MUJOCO = {
    "time": "data.time",
    "position": "data.qpos[model.jnt_qposadr[joint]]",
    "velocity": "data.qvel[dof]",
    "acceleration": "data.qacc[dof]",
    "torque": "data.qfrc_actuator[dof]",
}
#: The same for a motor of a transmission, which moves with its joints and has an actuator of its name.
OF_MOTOR = {
    "time": "data.time",
    "position": "sum(share * data.qpos[model.jnt_qposadr[joint]] for joint, share in parts)",
    "velocity": "sum(share * data.qvel[model.jnt_dofadr[joint]] for joint, share in parts)",
    "acceleration": "sum(share * data.qacc[model.jnt_dofadr[joint]] for joint, share in parts)",
    "torque": "data.actuator_force[motor]",
}
INFIX = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
COMPARED = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
CALLED = {
    **{ca.OP_EXP: "exp", ca.OP_LOG: "log", ca.OP_SQRT: "sqrt", ca.OP_SIN: "sin", ca.OP_COS: "cos"},
    **{ca.OP_TAN: "tan", ca.OP_ASIN: "asin", ca.OP_ACOS: "acos", ca.OP_ATAN: "atan", ca.OP_FABS: "fabs"},
    **{ca.OP_TANH: "tanh", ca.OP_SINH: "sinh", ca.OP_COSH: "cosh", ca.OP_FLOOR: "floor", ca.OP_CEIL: "ceil"},
    **{ca.OP_POW: "pow", ca.OP_CONSTPOW: "pow", ca.OP_ATAN2: "atan2", ca.OP_LOG1P: "log1p"},
    **{ca.OP_EXPM1: "expm1", ca.OP_HYPOT: "hypot", ca.OP_COPYSIGN: "copysign", ca.OP_ERF: "erf"},
    **{ca.OP_FMOD: "fmod"},
}
WRITTEN = {
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "2.0 * {0}",
    ca.OP_INV: "1.0 / {0}",
    ca.OP_ASSIGN: "{0}",
    ca.OP_SIGN: "math.copysign(1.0, {0}) if {0} else 0.0",
    ca.OP_NOT: "float(not {0})",
    ca.OP_AND: "float({0} and {1})",
    ca.OP_OR: "float({0} or {1})",
    ca.OP_FMIN: "min({0}, {1})",
    ca.OP_FMAX: "max({0}, {1})",
    ca.OP_IF_ELSE_ZERO: "{1} if {0} else 0.0",
}
HEAD = '''"""Torques of {name} that its model file cannot hold; units are N m and rad, or N and m."""

import math
'''
CALLBACK = '''

STATES = {{}}


def advanced(key, law, signals, start, now):
    """Torque of a law with a state [N m or N], which is kept between calls (exponential Euler)."""
    before, state = STATES.get(key, (now, start))
    step = now - before
    if step < 0.0:  # the simulation began anew
        state, step = start, 0.0
    if step > 0.0:
        rate = law(*signals, state)[1]
        slope = law(*signals, state + 1.0)[1] - rate
        grown = math.expm1(slope * step) / slope if slope else step
        state += grown * rate
    STATES[key] = now, state
    return law(*signals, state)[0]


def passive(model, data):
    """Adds the torques to MuJoCo's passive forces; torques of motors are those of the last step."""
{lines}


# import mujoco; mujoco.set_mjcb_passive(passive)
'''


def code_of(content: Content) -> str:
    """A Python module with a function for each remaining effect, and MuJoCo's callback that calls them.

    The functions require nothing but Python. Signals that MuJoCo does not provide for a joint, such as
    bearing loads and temperatures, are arguments that the callback cannot supply; it leaves these effects out
    and says so. Empty where no remaining effect has code.
    """
    robot = content.robot
    motors = _motors(robot)
    functions: list[str] = []
    lines: list[str] = []
    for k, use in enumerate(content.left):
        effect = get_effect(use.effect)
        if not _has_code(effect):
            continue
        name = re.sub(r"\W", "_", f"{use.effect}_at_{use.at}", flags=re.ASCII)
        name += f"_{k}" if f"def {name}(" in "".join(functions) else ""
        used, text = _function(name, use, robot)
        functions.append(text)
        motor = motors.get(use.at)
        states = bool(effect.states)  # type: ignore[attr-defined]
        lines += _called(name, use, used, motor, states=states)
    if not functions:
        return ""
    return (
        HEAD.format(name=robot.name)
        + "".join(f"\n\n{text}" for text in functions)
        + CALLBACK.format(lines="\n".join(lines))
    )


def _motors(robot: Robot) -> dict[str, dict[str, float]]:
    """For each motor of a transmission, the coefficients of its motion by the joint's name."""
    return {
        motor.name: {joint: float(part) for joint, part in zip(one.joints, row) if part}
        for one in robot.transmissions
        for motor, row in zip(one.motors, one.motors_from_joints)
    }


def without_code(content: Content) -> tuple[EffectUse, ...]:
    """Remaining effects without code: those in a gear, in a sensor or on a body."""
    return tuple(use for use in content.left if not _has_code(get_effect(use.effect)))


def _has_code(effect: Effect) -> bool:
    return isinstance(effect, JointEffect) and effect.states <= 1


def _function(name: str, use: EffectUse, robot: Robot) -> tuple[list[str], str]:
    """Signals that the function takes, and its text."""
    effect = get_effect(use.effect)
    assert isinstance(effect, JointEffect)
    drives = {drive.name: drive for drive in robot.drives}
    bearing = None if use.at in _motors(robot) else robot.joint(use.at).bearing
    signals, column = JointSignals.symbols(
        gear_ratio=drives[use.at].gear_ratio if use.at in drives else 1.0,
        bearing_arms=(bearing.radial_arm, bearing.axial_arm) if bearing else (0.0, 0.0),
    )
    values = {**effect.defaults(), **use.parameters}
    state = ca.SX.sym("z", effect.states)
    outputs = [ca.SX(effect.torque(signals, values, state))]
    if effect.states:
        outputs.append(ca.SX(effect.state_rate(signals, values, state)))
    symbols = dict(zip(JointSignals.CHANNELS, ca.vertsplit(column)))
    used = [key for key, symbol in symbols.items() if ca.depends_on(ca.vertcat(*outputs), symbol)]
    arguments = [symbols[key] for key in used] + ([state] if effect.states else [])
    names = [*used, *(["state"] if effect.states else [])]
    body = _lines(ca.Function("f", arguments, outputs), names)
    gives = "torque and rate of the state" if effect.states else "torque"
    numbers = ", ".join(f"{key} = {value:.6g}" for key, value in use.parameters.items())
    doc = f'    """{effect.title} at {use.at}, {gives}: {effect.equation}; {numbers}."""'
    return used, "\n".join([f"def {name}({', '.join(names)}):", doc, *body]) + "\n"


def _lines(function: ca.Function, names: Sequence[str]) -> list[str]:
    """The instructions of a CasADi function of scalars, as Python."""
    lines, results = [], ["0.0"] * function.n_out()
    for k in range(function.n_instructions()):
        kind, into, read = (
            function.instruction_id(k),
            function.instruction_output(k),
            function.instruction_input(k),
        )
        if kind == ca.OP_OUTPUT:
            results[into[0]] = f"r{into[0]}"
            lines.append(f"    r{into[0]} = w{read[0]}")
            continue
        lines.append(f"    w{into[0]} = {_expression(function, k, kind, read, names)}")
    return [*lines, f"    return {', '.join(results)}"]


def _expression(function: ca.Function, k: int, kind: int, read: Sequence[int], names: Sequence[str]) -> str:
    if kind == ca.OP_CONST:
        return repr(float(function.instruction_constant(k)))
    if kind == ca.OP_INPUT:
        return names[read[0]]
    work = [f"w{index}" for index in read]
    if kind in INFIX:
        return f" {INFIX[kind]} ".join(work)
    if kind in COMPARED:
        return f"float({work[0]} {COMPARED[kind]} {work[1]})"
    if kind in CALLED:
        return f"math.{CALLED[kind]}({', '.join(work)})"
    return WRITTEN[kind].format(*work)


def _called(
    name: str, use: EffectUse, used: Sequence[str], motor: dict[str, float] | None, *, states: bool
) -> list[str]:
    """Lines of the callback; `motor` has the coefficients of the motor's motion in those of its joints."""
    known = MUJOCO if motor is None else OF_MOTOR
    if unknown := [key for key in used if key not in known]:
        return [f"    # {name} is left out: MuJoCo does not provide {', '.join(unknown)}."]
    signals = ", ".join(known[key] for key in used)
    call = f"{name}({signals})"
    if states:
        start = known["torque"] if use.effect == "actuator_lag" else "0.0"
        call = f"advanced({name!r}, {name}, ({signals}{',' if used else ''}), {start}, data.time)"
    if motor is not None:
        return [
            f"    shares = {motor!r}",
            f"    motor = model.actuator({use.at!r}).id",
            "    parts = [(model.joint(name).id, share) for name, share in shares.items()]",
            f"    force = {call}",
            "    for joint, share in parts:",
            "        data.qfrc_passive[model.jnt_dofadr[joint]] += share * force",
        ]
    return [
        f"    joint = model.joint({use.at!r}).id",
        "    dof = model.jnt_dofadr[joint]",
        f"    data.qfrc_passive[dof] += {call}",
    ]
