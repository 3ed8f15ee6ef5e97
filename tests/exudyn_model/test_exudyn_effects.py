"""Laws at given states: by formula here, and against the same effect of the reference model."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from exudyn_robots import cart, joint, pendulum

from exudyn_model import simulate
from exudyn_model.effects.base import TRANSITION, Instant, JointLaw
from exudyn_model.effects.build import BODY_CHANGES, JOINT_LAWS, SENSOR_FAULTS
from exudyn_model.effects.drives import ActuatorLag
from exudyn_model.effects.friction import LuGreFriction
from exudyn_model.effects.links.bodies import BodyChange
from exudyn_model.effects.sensors import SensorFault
from reference_model.effects.base import BodyEffect, JointEffect, JointSignals, SensorEffect
from reference_model.effects.catalogue import get_effect
from reference_model.plant.acting import TRANSITION as REFERENCE_TRANSITION
from robot_model import EffectUse, InputError

#: Signals that a law of this engine does not use: the reference model gets zeros there.
UNSEEN = {"acceleration": 0.0, "radial_force": 0.0, "axial_force": 0.0, "bending_moment": 0.0}
#: Arms that make the bearing's load moment W equal to the sum of its radial forces.
UNIT_ARMS = (1.0, 0.0)
AMBIENT = 293.15
TORQUE = {"coulomb_torque": 3.0, "static_torque": 5.0, "stribeck_velocity": 0.05}
LUGRE = {**TORQUE, "bristle_stiffness": 2e3, "bristle_damping": 8.0}


def instant(**changes: float) -> Instant:
    given = {
        "time": 0.6,
        "step": 0.0,
        "position": 0.3,
        "velocity": 0.2,
        "command": 4.0,
        "friction": 0.0,
        "last_velocity": 0.2,
        "last_command": 4.0,
    }
    return Instant(**{**given, **changes})


def drawn(effect: JointEffect | BodyEffect | SensorEffect, chance: np.random.Generator) -> dict[str, float]:
    """Parameters within their bounds, of the typical size."""
    values = {}
    for p in effect.parameters:
        lower, upper = max(p.lower, -2 * abs(p.typical)), min(p.upper, 2 * abs(p.typical))
        values[p.name] = float(chance.uniform(lower, upper))
    return values


def states() -> list[Instant]:
    chance = np.random.default_rng(3)
    speeds = [0.0, 3e-5, -2e-4, 0.01, -0.05, 0.3, -2.0]
    commands = chance.normal(0, 20, len(speeds))
    loads = np.concatenate([[0.0], chance.uniform(1.0, 40.0, len(speeds) - 1)])
    return [
        instant(
            time=float(chance.uniform(0, 5)),
            position=float(chance.uniform(-2, 2)),
            velocity=v,
            last_velocity=v,
            command=float(command),
            last_command=float(command),
            friction=float(chance.normal(0, 3)),
            load=float(load),
            last_load=float(load),
        )
        for v, command, load in zip(speeds, commands, loads)
    ]


def reference_force(
    effect: JointEffect, now: Instant, p: dict[str, float], z: float
) -> tuple[float, float, float]:
    """Force, rate of the state and initial state by the reference model's expressions."""
    signals, column = JointSignals.symbols(transition=REFERENCE_TRANSITION, bearing_arms=UNIT_ARMS)
    symbol = ca.SX.sym("z", effect.states)
    parts = (
        effect.torque(signals, p, symbol),
        effect.state_rate(signals, p, symbol),
        effect.initial_state(signals, p),
    )
    function = ca.Function("law", [column, symbol], [ca.vertcat(*parts)])
    known = {
        "time": now.time,
        "position": now.position,
        "velocity": now.velocity,
        "torque": now.command,
        "friction": now.friction,
        "temperature": AMBIENT,
        "radial_sum": now.load,
        **UNSEEN,
    }
    values = function([known[name] for name in JointSignals.CHANNELS], [z] * effect.states)
    force, *state = np.asarray(values).ravel()
    return force, *(state or (0.0, 0.0))


@pytest.mark.parametrize("name", sorted(JOINT_LAWS))
def test_engines_agree_on_joint_effects(name: str) -> None:
    effect = get_effect(name)
    assert isinstance(effect, JointEffect)
    assert TRANSITION == REFERENCE_TRANSITION
    chance = np.random.default_rng(5)
    for now in states():
        values = drawn(effect, chance)
        law: JointLaw = JOINT_LAWS[name](**values)
        memory = law.initial(now)
        z = 0.8 * memory[0] + 1e-3 if memory else 0.0
        force, rate, initial = reference_force(effect, now, values, z)
        found, _ = law.advance(now, (z,) if memory else ())
        # The same formulas in double precision; 1e-12 leaves room for another order of operations.
        assert found == pytest.approx(force, rel=1e-12, abs=1e-12)
        if memory:
            assert memory[0] == pytest.approx(initial, rel=1e-12, abs=1e-15)
            step = 1e-6 * abs(z) / max(abs(rate), 1e-12)
            after = instant(**{**as_dict(now), "step": step})
            _, (later,) = law.advance(after, (z,))
            # A step that changes the state by 1e-6: the quotient is the rate to 1e-6 and rounding.
            assert (later - z) / step == pytest.approx(rate, rel=1e-5, abs=1e-9)


def as_dict(now: Instant) -> dict[str, float]:
    return {name: getattr(now, name) for name in Instant.__dataclass_fields__}


@pytest.mark.parametrize("name", sorted(BODY_CHANGES))
def test_engines_agree_on_body_effects(name: str) -> None:
    effect = get_effect(name)
    assert isinstance(effect, BodyEffect)
    values = drawn(effect, np.random.default_rng(7))
    change: BodyChange = BODY_CHANGES[name](**values)
    terms = effect.terms(values)
    for mine, theirs in (
        (change.added().mass, terms.mass),
        (change.added().first_moment, terms.first_moment),
        (change.added().inertia, terms.inertia),
        (change.added_gravity(), terms.gravity),
    ):
        theirs = np.asarray(ca.evalf(ca.densify(ca.SX(theirs))))
        np.testing.assert_allclose(np.ravel(mine), theirs.ravel(order="F"), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("name", sorted(SENSOR_FAULTS))
def test_engines_agree_on_sensor_effects(name: str) -> None:
    effect = get_effect(name)
    assert isinstance(effect, SensorEffect)
    time = np.arange(400) * 2e-3
    truth = np.sin(5 * time) + 0.3 * time
    values = drawn(effect, np.random.default_rng(9))
    fault: SensorFault = SENSOR_FAULTS[name](**values)
    # The same formulas; 1e-12 leaves room for another order of operations.
    np.testing.assert_allclose(fault.applied(time, truth), effect.apply(time, truth, values), atol=1e-12)


def test_dry_friction_by_formula() -> None:
    v = 0.03
    level = 3.0 + 2.0 * np.exp(-((v / 0.05) ** 2))
    now = instant(velocity=v, last_velocity=v)
    for name, values, expected in (
        ("viscous_friction", {"coefficient": 2.0}, -2.0 * v),
        ("coulomb_friction", {"torque": 4.0}, -4.0),
        ("stribeck_friction", TORQUE, -level),
    ):
        # 0.03 is three hundred transitions: the smoothed sign is 1 to double precision.
        assert JOINT_LAWS[name](**values).force(now) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("v", [0.003, -0.4])
def test_lugre_reaches_its_steady_state_in_one_large_step(v: float) -> None:
    law = LuGreFriction(**LUGRE)
    now = instant(velocity=v, last_velocity=v, step=100.0)
    force, (z,) = law.advance(now, (0.0,))
    level = 3.0 + 2.0 * np.exp(-((v / 0.05) ** 2))
    assert force == pytest.approx(-np.sign(v) * level, rel=1e-6)  # the level's floor is 1e-9 of 3 N m
    assert z == pytest.approx(np.sign(v) * level / 2e3, rel=1e-6)


def test_a_lag_follows_a_ramp_late_by_its_time_constant() -> None:
    law, y = ActuatorLag(time_constant=0.02), 0.0
    for k in range(1, 201):
        now = instant(step=1e-3, command=3e-3 * k, last_command=3e-3 * (k - 1))
        force, (y,) = law.advance(now, (y,))
    # Ten time constants after the start only exp(-10) of the transient is left.
    assert y == pytest.approx(3e-3 * 200 - 3.0 * 0.02, abs=3.0 * 0.02 * np.exp(-9.9))
    assert force == pytest.approx(y - 0.6, rel=1e-12)


def test_coulomb_friction_stops_a_slide_at_the_analytic_time() -> None:
    start = joint(
        "slide", kind="prismatic", child="body", axis=(1.0, 0.0, 0.0), initial_velocity=0.6, actuator=None
    )
    robot = cart(joints=(start,)).with_effects(
        EffectUse.model_validate({"effect": "coulomb_friction", "at": "slide", "torque": 3.0})
    )
    recording = simulate(robot, sensors=False)
    stopped = np.searchsorted(recording.time, 0.6)  # v0 m / T = 0.6 * 3 / 3
    expected = 0.6 * recording.time[:stopped] - 0.5 * recording.time[:stopped] ** 2
    # Constant deceleration; smoothing starts to matter within 1e-3 s of the stop, 1e-7 m.
    np.testing.assert_allclose(recording["slide.position"][: stopped - 1], expected[:-1], atol=1e-7)
    assert np.abs(recording["slide.velocity"][stopped + 2 :]).max() < 1e-6
    # At 0.6 s it has gone 0.18 m; the creep while tanh(v / 1e-4) fades adds about 1e-4 * 1e-4 s.
    assert recording["slide.position"][-1] == pytest.approx(0.18, abs=1e-6)


def test_a_pendulum_held_by_friction_stays_up() -> None:
    start = joint("hinge", axis=(0.0, 1.0, 0.0), initial_position=0.5, actuator=None)
    weight = 2.0 * 9.81 * 0.5 * np.sin(0.5)
    robot = pendulum(joints=(start,)).with_effects(
        EffectUse.model_validate({"effect": "coulomb_friction", "at": "hinge", "torque": 2 * weight})
    )
    recording = simulate(robot, sensors=False)
    # It creeps at v = 1e-4 atanh(1/2) = 5.5e-5 rad/s, never more.
    assert abs(recording["hinge.position"][-1] - 0.5) == pytest.approx(5.49e-5, rel=0.01)
    np.testing.assert_allclose(recording["hinge.friction_torque"][10:], weight, rtol=1e-3)


def test_an_unknown_effect_is_refused_by_name() -> None:
    robot = cart().with_effects(EffectUse(effect="magnetic_drag", at="slide"))
    with pytest.raises(InputError, match="no counterpart of effect 'magnetic_drag' at 'slide'"):
        simulate(robot)


def test_a_wrong_parameter_is_refused_by_name() -> None:
    use = {"effect": "viscous_friction", "at": "slide", "coeficient": 1.0}
    with pytest.raises(InputError, match="unknown parameter 'coeficient'; did you mean 'coefficient'"):
        simulate(cart().with_effects(EffectUse.model_validate(use)))
    with pytest.raises(InputError, match="parameter 'coefficient' is missing"):
        simulate(cart().with_effects(EffectUse(effect="viscous_friction", at="slide")))


def test_an_effect_at_a_wrong_place_is_refused() -> None:
    use = {"effect": "viscous_friction", "at": "slid", "coefficient": 1.0}
    with pytest.raises(InputError, match="not at 'slid'; did you mean 'slide'"):
        simulate(cart().with_effects(EffectUse.model_validate(use)))


def test_a_negative_payload_may_not_leave_a_joint_without_inertia() -> None:
    use = {"effect": "payload", "at": "body", "mass": -3.0}
    with pytest.raises(InputError, match="joint 'slide' has no inertia to move"):
        simulate(cart().with_effects(EffectUse.model_validate(use)))
    use["mass"] = -4.0
    with pytest.raises(InputError, match="mass of -1 kg, and no mass is negative"):
        simulate(cart().with_effects(EffectUse.model_validate(use)))
