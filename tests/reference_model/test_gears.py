"""Separate motor coordinates: two inertias on a spring, play, limits, balances, refusals."""

from __future__ import annotations

import itertools

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import expm

from reference_model.effects.catalogue import used_effects
from reference_model.plant.gears import Gears
from reference_model.simulation import simulate
from robot_model import InputError, Recording, Robot, Sensor, load_robot

Array = NDArray[np.float64]

RATIO, ROTOR = 50.0, 2e-4
MOTOR = RATIO**2 * ROTOR
LOAD = 2.0
STIFFNESS, DAMPING = 4e3, 2.0

ELASTIC = {"effect": "joint_elasticity", "at": "hinge", "stiffness": STIFFNESS}
PLAY = {"effect": "backlash", "at": "hinge", "half_width": 2e-3, "stiffness": STIFFNESS}
LOSSY = {"effect": "gear_hysteresis", "at": "hinge", "torque": 3.0, "travel": 2e-4, "stiffness": STIFFNESS}


def wheel(*effects: dict, duration: float = 0.5, rate: float = 1000.0, **changes: object) -> Robot:
    """A wheel on a motor with a gear, without gravity."""
    joint = {
        "name": "hinge",
        "parent": "base",
        "child": "wheel",
        "axis": (0.0, 0.0, 1.0),
        "actuator": {"gear_ratio": RATIO, "rotor_inertia": ROTOR, **changes.pop("actuator", {})},
        **changes.pop("joint", {}),
    }
    return Robot.model_validate(
        {
            "name": "wheel",
            "links": [{"name": "wheel", "mass": 1.0, "inertia": (LOAD, LOAD, LOAD)}],
            "joints": [joint],
            "reference": {"duration": duration, "sample_rate": rate, **changes.pop("reference", {})},
            "effects": effects,
            **changes,
        }
    )


def moving(recording: Recording) -> tuple[Array, Array]:
    return recording["hinge.position"], recording["hinge.motor_position"]


def pushed(torque: float) -> dict:
    """A constant torque on the motor."""
    return {"effect": "torque_offset", "at": "hinge", "torque": torque}


def load(torque: float) -> dict:
    """A constant torque on the joint."""
    return {"effect": "cable_spring", "at": "hinge", "stiffness": 0.0, "torque_at_zero": torque}


def test_two_inertias_on_a_spring_follow_the_closed_form() -> None:
    push = 5.0
    robot = wheel({**ELASTIC, "damping": DAMPING}, pushed(push), rate=200.0)
    found = simulate(robot, sensors=False, rtol=1e-11, atol=1e-14)
    # [q, th, qd, thd, 1]: linear, so the matrix exponential is exact
    k, d = STIFFNESS, DAMPING
    matrix = np.zeros((5, 5))
    matrix[0, 2] = matrix[1, 3] = 1.0
    matrix[2] = np.array([-k, k, -d, d, 0.0]) / LOAD
    matrix[3] = np.array([k, -k, d, -d, push]) / MOTOR
    start = np.array([0.0, 0.0, 0.0, 0.0, 1.0])
    exact = np.array([expm(matrix * t) @ start for t in found.time])
    # accumulated errors of the integration at these tolerances; 1e-10 of the travel was seen
    for name, column in (("position", 0), ("motor_position", 1), ("velocity", 2), ("motor_velocity", 3)):
        assert np.abs(found[f"hinge.{name}"] - exact[:, column]).max() < 1e-8 * np.abs(exact[:, column]).max()
    torque = k * (exact[:, 1] - exact[:, 0]) + d * (exact[:, 3] - exact[:, 2])
    # the error of positions times the stiffness
    assert np.abs(found["hinge.gear_torque"] - torque).max() < 1e-6 * np.abs(torque).max()


def test_frequency_and_damping_of_the_twist() -> None:
    robot = wheel({**ELASTIC, "damping": DAMPING}, pushed(5.0), duration=2.0, rate=5000.0)
    found = simulate(robot, sensors=False, rtol=1e-11, atol=1e-14)
    twist = found["hinge.motor_position"] - found["hinge.position"]
    twist -= 5.0 / MOTOR / (1 / LOAD + 1 / MOTOR) / STIFFNESS  # about its rest under the constant push
    reduced = LOAD * MOTOR / (LOAD + MOTOR)
    decay = DAMPING / (2 * reduced)
    wanted = np.sqrt(STIFFNESS / reduced - decay**2)
    ups = np.flatnonzero((twist[:-1] < 0) & (twist[1:] >= 0))
    crossings = found.time[ups] - twist[ups] * np.diff(found.time)[0] / (twist[ups + 1] - twist[ups])
    # a straight line between samples 0.02 rad of phase apart errs by 1e-5 of a period
    assert 2 * np.pi / np.diff(crossings).mean() == pytest.approx(wanted, rel=1e-4)
    peaks = np.array([np.abs(twist[a:b]).max() for a, b in itertools.pairwise(ups)])
    rate = -np.polyfit(crossings[: len(peaks)], np.log(peaks), 1)[0]
    assert rate == pytest.approx(decay, rel=1e-2)  # peaks between samples: (0.01 rad)^2/2 and their scatter


def test_within_the_play_motor_and_load_move_freely_until_the_flanks_meet() -> None:
    found = simulate(wheel(PLAY, pushed(1.0), duration=0.06, rate=10_000.0), sensors=False)
    q, motor = moving(found)
    meet = np.sqrt(2 * PLAY["half_width"] * MOTOR / 1.0)  # 1 N m on the rotor alone
    free = found.time < meet - 1e-6
    assert 100 < free.sum() < len(free)
    # the rotor flies like a free one, and nothing moves the load
    assert np.abs(motor[free] - found.time[free] ** 2 / (2 * MOTOR)).max() < 1e-9
    assert np.abs(q[free]).max() < 1e-20  # rounding of zeros by the integrator
    assert np.abs(found["hinge.gear_torque"][free]).max() == 0.0
    assert found["hinge.gear_torque"][found.time > meet + 1e-4].min() > 0.0


def test_flanks_without_damping_bounce_elastically() -> None:
    shove = {"effect": "external_torque", "at": "hinge", "torque": 4.0, "start": 0.0, "duration": 0.02}
    found = simulate(wheel(PLAY, shove, duration=1.0), sensors=False, rtol=1e-10, atol=1e-13)
    twist = found["hinge.motor_position"] - found["hinge.position"]
    assert (
        np.abs(twist).max() < PLAY["half_width"] + np.abs(found["hinge.gear_torque"]).max() / STIFFNESS + 1e-9
    )
    after = found.time > 0.2  # the edges of the shove are smooth
    momentum = LOAD * found["hinge.velocity"] + MOTOR * found["hinge.motor_velocity"]
    assert np.ptp(momentum[after]) < 1e-7 * np.abs(momentum).max()
    relative = found["hinge.motor_velocity"] - found["hinge.velocity"]
    apart = after & (np.abs(twist) < PLAY["half_width"])
    speeds = np.abs(relative[apart])
    assert (np.sign(relative[apart])[1:] != np.sign(relative[apart])[:-1]).any()  # it did bounce
    assert np.ptp(speeds) < 1e-6 * speeds.max()


def test_damped_flanks_come_to_rest_on_one_side() -> None:
    push = 5.0
    found = simulate(wheel({**PLAY, "damping": 30.0}, load(push), duration=3.0), sensors=False)
    twist = found["hinge.motor_position"] - found["hinge.position"]
    carried = -push / LOAD / (1 / LOAD + 1 / MOTOR)
    rest = -PLAY["half_width"] + carried / STIFFNESS
    assert twist[-1] == pytest.approx(rest, abs=1e-6)
    assert (found["hinge.gear_torque"] <= 1e-12).all()  # one flank only, which never pulls


def gear(*effects: dict) -> ca.Function:
    """Twist and rate -> torque, loss, and the rate of the stored energy of a gear without states."""
    robot = wheel(*effects)
    d, v = ca.SX.sym("d"), ca.SX.sym("v")
    found = Gears(robot, used_effects(robot)).act(d, v, ca.SX(0, 1))
    return ca.Function("gear", [d, v], [found.torque, found.loss, ca.jacobian(found.stored, d) * v])


WITH_PLAY = gear({**PLAY, "damping": 30.0})


@given(d=st.floats(-4e-3, 4e-3), v=st.floats(-0.5, 0.5))
def test_flanks_never_pull_and_never_generate_energy(d: float, v: float) -> None:
    torque, loss, charging = (float(part) for part in WITH_PLAY(d, v))
    assert torque * d >= 0.0
    assert loss >= -1e-15
    assert torque * v == pytest.approx(charging + loss, abs=1e-12)  # rounding of some N m rad/s


@pytest.mark.parametrize(
    "effects",
    [
        [{**ELASTIC, "damping": DAMPING, "cubic_stiffness": 1e9}],
        [{**PLAY, "damping": DAMPING}],
        [
            {**ELASTIC, "damping": DAMPING, "cubic_stiffness": 1e9},
            {k: PLAY[k] for k in ("effect", "at", "half_width")},
        ],
        [{**LOSSY, "damping": DAMPING}],
        [ELASTIC, {k: LOSSY[k] for k in ("effect", "at", "torque", "travel")}],
    ],
    ids=["elastic", "play", "elastic with play", "lossy", "elastic and lossy"],
)
@pytest.mark.parametrize("kind", ["pd", "computed_torque"])
def test_energy_minus_work_is_constant(effects: list[dict], kind: str) -> None:
    controller = {"kind": kind, "kp": 300.0 if kind == "pd" else 200.0, "kd": 20.0}
    motion = {"joint": "hinge", "kind": "multisine", "amplitudes": [0.2], "frequencies": [2.0], "ramp": 0.2}
    rub = {"effect": "viscous_friction", "at": "hinge", "coefficient": 1.0}
    ripple = {"effect": "torque_ripple", "at": "hinge", "cosine": 0.5, "sine": 0.0, "order": 50.0}
    robot = wheel(*effects, rub, ripple, controller=controller, reference={"joints": [motion]}, duration=1.0)
    found = simulate(robot, sensors=False, work=True, rtol=1e-10, atol=1e-13)
    rest = found["robot.energy"] - found["robot.work"]
    assert np.ptp(found["robot.work"]) > 0.1
    # the integration's tolerance over some hundred kinks of the play
    assert np.ptp(rest) < 1e-6 * np.ptp(found["robot.work"])


def test_a_stiff_gear_converges_to_the_rigid_joint_with_rotor() -> None:
    motion = {"joint": "hinge", "kind": "quintic", "displacement": 0.5, "duration": 0.5}
    controller = {"kind": "pd", "kp": 200.0, "kd": 30.0}
    given = {"controller": controller, "reference": {"joints": [motion]}, "duration": 1.0, "rate": 100.0}
    rigid = simulate(wheel(**given), sensors=False, rtol=1e-11, atol=1e-13)
    errors = []
    for stiffness in (1e5, 4e5):
        elastic = {**ELASTIC, "stiffness": stiffness, "damping": 2e-3 * stiffness}
        found = simulate(wheel(elastic, **given), sensors=False, rtol=1e-10, atol=1e-13)
        errors.append(np.abs(found["hinge.position"] - rigid["hinge.position"]).max())
    # the compliance is the small parameter (singular perturbation): first order in 1/K
    assert errors[0] < 1e-3
    assert np.log2(errors[0] / errors[1]) / 2 == pytest.approx(1.0, abs=0.05)


def test_fixed_steps_keep_order_four_for_smooth_gears() -> None:
    motion = {"joint": "hinge", "kind": "quintic", "displacement": 0.5, "duration": 0.5}
    given = {"controller": {"kind": "pd", "kp": 200.0, "kd": 30.0}, "reference": {"joints": [motion]}}
    robot = wheel({**ELASTIC, "damping": DAMPING, "cubic_stiffness": 1e9}, **given, duration=0.4, rate=100.0)
    exact = simulate(robot, sensors=False, rtol=1e-12, atol=1e-15)["hinge.motor_position"]
    steps = [simulate(robot, sensors=False, step=h)["hinge.motor_position"] for h in (1e-3, 5e-4)]
    errors = [np.abs(found - exact).max() for found in steps]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.3)


def test_hysteresis_is_rate_independent() -> None:
    """The same twist in half the time loses the same energy."""
    lost = []
    for pace in (1.0, 2.0):
        swing = {"joint": "hinge", "kind": "multisine", "amplitudes": [0.02], "frequencies": [0.5 * pace]}
        held = {"effect": "end_stop", "at": "hinge", "stiffness": 1e8, "side": 1.0, "position": 0.0}
        other = {**held, "side": -1.0}
        robot = wheel(
            {**LOSSY, "damping": 0.0},
            held,
            other,
            controller={"kind": "pd", "kp": 3e4, "kd": 300.0},
            reference={"joints": [{**swing, "ramp": 2.0 / pace}]},
            duration=8.0 / pace,
            rate=1000.0,
        )
        found = simulate(robot, sensors=False)
        twist = found["hinge.motor_position"] - found["hinge.position"]
        last = found.time > 4.0 / pace
        lost.append(np.trapezoid(found["hinge.gear_torque"][last], twist[last]))
    amplitude = np.abs(twist[last]).max()
    travel = LOSSY["travel"]
    closed = 2 * 4 * LOSSY["torque"] * (amplitude - travel * np.tanh(amplitude / travel))  # two turns
    assert lost[0] == pytest.approx(lost[1], rel=0.01)  # the loop follows the faster motion a little less
    assert lost[1] == pytest.approx(closed, rel=0.01)


def test_controllers_read_the_encoder_chosen_in_the_file() -> None:
    """A PD loop by the joint's encoder around an undamped spring is unstable, by the motor's never."""
    motion = {"joint": "hinge", "kind": "quintic", "displacement": 0.1, "duration": 0.2}
    swings = {}
    for feedback in ("motor", "joint"):
        controller = {"kind": "pd", "kp": 200.0, "kd": 30.0, "feedback": feedback}
        robot = wheel(ELASTIC, controller=controller, reference={"joints": [motion]}, duration=0.5)
        found = simulate(robot, sensors=False)
        swings[feedback] = np.ptp((found["hinge.motor_position"] - found["hinge.position"])[-100:])
    assert swings["joint"] > 10 * swings["motor"]


def test_integral_action_and_a_servos_back_emf_follow_the_motor() -> None:
    motor = {"actuator": {"torque_constant": 0.1, "resistance": 1.0}}
    servo = {"kind": "voltage_servo", "gain": 5.0, "supply": 24.0}
    motion = {"joint": "hinge", "kind": "quintic", "displacement": 0.3, "duration": 0.2}
    given = {"reference": {"joints": [motion]}, "duration": 0.4}
    found = simulate(wheel({**ELASTIC, "damping": 1.0}, controller=servo, **given, **motor), sensors=False)
    constant = RATIO * 0.1
    torque = constant * (found["hinge.voltage"] - constant * found["hinge.motor_velocity"])
    assert np.abs(torque - found["hinge.torque"]).max() < 1e-9 * np.abs(torque).max()
    loop = {"kind": "pd", "kp": 200.0, "kd": 30.0, "ki": 400.0}
    heavy = load(-5.0)
    done = simulate(
        wheel({**ELASTIC, "damping": 9.0}, heavy, controller=loop, duration=6.0, rate=50.0), sensors=False
    )
    assert done["hinge.motor_position"][-1] == pytest.approx(0.0, abs=1e-5)  # integrated away at the motor
    assert done["hinge.position"][-1] == pytest.approx(-5.0 / STIFFNESS, rel=1e-2)


def test_a_gear_starts_loaded_by_the_first_command() -> None:
    """The wheel becomes a pendulum held against gravity: with its gear wound up it does not stir."""
    robot = load_robot("two_link_arm")
    hold = {"duration": 0.5, "sample_rate": 100.0, "joints": []}
    control = {"kind": "computed_torque", "kp": 100.0, "kd": 20.0, "feedback": "joint"}
    for effect in (
        {"effect": "joint_elasticity", "stiffness": 5e3, "cubic_stiffness": 1e8, "damping": 5.0},
        {"effect": "backlash", "half_width": 1e-3, "stiffness": 5e3, "damping": 5.0},
        {"effect": "gear_hysteresis", "torque": 3.0, "travel": 1e-3, "stiffness": 5e3, "damping": 5.0},
    ):
        held = {**robot.model_dump(), "sensors": [], "reference": hold, "controller": control}
        held["effects"] = [{**effect, "at": "joint1"}]
        found = simulate(Robot.model_validate(held), sensors=False)
        assert abs(found["joint1.gear_torque"][0]) > 10.0
        # gear and gravity agree to rounding at the start, and the loop about that rest is stable
        assert np.ptp(found["joint1.position"]) < 1e-7
        assert np.ptp(found["joint1.motor_position"]) < 1e-7


@pytest.mark.parametrize("name", ["flexible_space_robot", "six_joint_space_arm"])
def test_free_bases_and_flexible_links_keep_their_momentum_and_balance(name: str) -> None:
    data = load_robot(name).model_dump()
    joint = data["joints"][1]["name"]
    data["sensors"] = []
    data["reference"] |= {"duration": 1.0, "sample_rate": 50.0}
    data["effects"] = [
        {"effect": "joint_elasticity", "at": joint, "stiffness": 2e4, "damping": 20.0},
        {"effect": "viscous_friction", "at": joint, "coefficient": 5.0},
        {"effect": "actuator_lag", "at": joint, "time_constant": 3e-3},
    ]
    found = simulate(Robot.model_validate(data), sensors=False, work=True, rtol=1e-10, atol=1e-12)
    rest = found["robot.energy"] - found["robot.work"]
    assert np.ptp(rest) < 1e-7 * np.ptp(found["robot.work"])
    for axis in "xyz":
        moment = found[f"robot.angular_momentum.{axis}"]
        assert np.abs(moment - moment[0]).max() < 1e-8  # of tens of N m s in the parts
    assert np.ptp(found[f"{joint}.motor_position"] - found[f"{joint}.position"]) > 1e-6


def test_stiction_and_compiled_code_support_gears() -> None:
    motion = {"joint": "hinge", "kind": "multisine", "amplitudes": [0.05], "frequencies": [1.0], "ramp": 0.2}
    rub = {"effect": "coulomb_friction", "at": "hinge", "torque": 6.0}
    given = {"controller": {"kind": "pd", "kp": 400.0, "kd": 20.0}, "reference": {"joints": [motion]}}
    robot = wheel({**ELASTIC, "damping": 2.0}, rub, **given, duration=1.0, rate=200.0)
    stuck = simulate(robot, sensors=False, stiction=True)
    smooth = simulate(robot, sensors=False)
    assert 0 < stuck["hinge.sticking"].sum() < len(stuck)
    # smoothed friction creeps at 1e-4 rad/s at most
    assert np.abs(stuck["hinge.position"] - smooth["hinge.position"]).max() < 1e-4
    still = stuck["hinge.sticking"] == 1
    assert np.abs(stuck["hinge.velocity"][still]).max() == 0.0
    assert np.abs(stuck["hinge.motor_velocity"][still]).max() > 0.01  # the motor winds the spring meanwhile
    fast = simulate(robot, sensors=False, compile_code=True)
    assert np.abs(fast["hinge.position"] - smooth["hinge.position"]).max() < 1e-8


def test_a_stiff_joint_also_has_a_motor_encoder_if_a_sensor_requires_it() -> None:
    sensors = (Sensor(channel="hinge.motor_position"), Sensor(channel="hinge.position"))
    push = load(1.0)
    stiff = simulate(wheel(push, sensors=sensors))
    assert np.array_equal(stiff["hinge.motor_position"], stiff["hinge.position"])
    assert "hinge.motor_position" not in simulate(wheel(push))
    soft = simulate(wheel(push, ELASTIC, sensors=sensors))
    assert np.abs(soft["hinge.motor_position"] - soft["hinge.position"]).max() > 1e-5


BARE_PLAY = {k: PLAY[k] for k in ("effect", "at", "half_width")}


@pytest.mark.parametrize(
    ("effects", "changes", "words"),
    [
        ([BARE_PLAY], {}, "backlash without any stiffness"),
        ([PLAY, ELASTIC], {}, "one spring in a gear.*remove stiffness and damping from backlash"),
        ([ELASTIC, ELASTIC], {}, "joint_elasticity is listed twice"),
        ([ELASTIC, BARE_PLAY, LOSSY], {}, "backlash and gear_hysteresis in one gear"),
        ([ELASTIC], {"actuator": {"rotor_inertia": 0.0}}, "give the joint's actuator a rotor_inertia"),
        ([ELASTIC], {"links": [{"name": "wheel"}]}, "nothing but the rotor"),
    ],
)
def test_impossible_gear_effects_are_refused(effects: list[dict], changes: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        simulate(wheel(*effects, **changes))
