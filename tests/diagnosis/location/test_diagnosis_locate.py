"""Where, when and on what: synthetic residuals whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_cases import ARM, Array, Extra, Sines, bare, problem_of, recorded

from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.location.orders import spatial_peaks
from missing_physics.diagnosis.location.residual import locate, outstanding_windows
from missing_physics.results.result import Mismatch
from reference_model.evaluation.model import RobotModel
from robot_model import Robot

ROBOT = bare("two_link_arm", noise=True)
SEEDS = (0, 1, 2)
every_seed = pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.proof) for seed in SEEDS[1:])]
)
#: Joint 2 travels 4 rad.
FAR = (ARM[0], Sines((1.2, 0.7, 0.2), (0.21, 0.47, 0.9), (1.0, 0.2, 2.9)))


@pytest.fixture(scope="module")
def problem() -> Problem:
    return problem_of(ROBOT, recorded(ROBOT, ARM, duration=20.0, seed=2))


def located(problem: Problem, joint: int, shape: Array) -> Mismatch:
    """What is said of the noise with `shape` on top at one joint."""
    residual = problem.residual.copy()
    residual[:, joint] += shape
    return next(m for m in locate(problem, ROBOT, residual) if m.location == f"joint{joint + 1}")


def share(item: Mismatch, variable: str) -> float:
    return next((d.share for d in item.depends_on if d.variable.endswith(variable)), 0.0)


def test_noise_is_no_mismatch(problem: Problem) -> None:
    found = locate(problem, ROBOT, problem.residual)
    assert {m.location for m in found} == {"joint1", "joint2"}
    assert all(m.p_value > 0.05 for m in found)
    assert all(not m.depends_on for m in found)
    assert sum(m.share for m in found) == pytest.approx(1.0)


def test_what_the_filter_passes_next_to_a_reversal_is_no_mismatch(problem: Problem) -> None:
    sliding = problem.sliding[:, 0] > 0
    edge = sliding & ~(np.roll(sliding, 1) & np.roll(sliding, -1))
    item = located(problem, 0, 30.0 * problem.noise_floor[0] * edge)
    assert edge.sum() > 10
    assert item.p_value > 0.05
    inner = sliding & ~edge & (np.arange(sliding.size) % 5 == 0)
    assert located(problem, 0, 30.0 * problem.noise_floor[0] * inner).p_value < 1e-9


def test_shares_are_parts_of_the_whitened_energy_largest_first(problem: Problem) -> None:
    residual = np.random.default_rng(0).standard_normal(problem.residual.shape)
    residual *= problem.noise_floor * np.array([2.0, 6.0])
    first, second = locate(problem, ROBOT, residual)
    assert (first.location, first.channel) == ("joint2", "joint2.torque")
    # 36 against 4, by about a thousand samples each
    assert first.share == pytest.approx(0.9, abs=0.02)
    assert second.share == pytest.approx(0.1, abs=0.02)
    assert first.p_value < 1e-9


def test_a_curve_over_velocity_is_seen_as_one(problem: Problem) -> None:
    velocity = problem.velocity[:, 1]
    item = located(problem, 1, 5.0 * np.sign(velocity))
    assert item.depends_on[0].variable == "joint2.velocity"
    # 24 bins hold the sign but for the one at zero; noise is a ten-thousandth of the energy
    assert 0.9 < share(item, "velocity") <= 1.0
    assert item.p_value < 1e-9
    assert "joint2" in item.words
    assert "curve over velocity" in item.words


def test_a_curve_over_position_is_seen_where_it_is(problem: Problem) -> None:
    position = problem.position[:, 0]
    edge = float(np.quantile(position, 0.8))
    item = located(problem, 0, 8.0 * np.maximum(position - edge, 0.0) / np.ptp(position))
    best = item.depends_on[0]
    assert best.variable == "joint1.position"
    assert best.share > 0.8
    bin_width = 0.2 * np.ptp(position)
    assert best.range[0] > edge - bin_width
    assert best.range[1] == pytest.approx(position.max(), abs=1e-9)


def test_what_depends_on_nothing_is_not_said_to(problem: Problem) -> None:
    chance = np.random.default_rng(1)
    item = located(problem, 0, 5.0 * chance.standard_normal(problem.time.size))
    assert not item.depends_on
    assert item.p_value < 1e-9


def test_memory_is_not_taken_for_a_dependence(problem: Problem) -> None:
    """One draw per block: a curve drawn and judged on the same blocks would explain most of it."""
    draws = np.random.default_rng(4).standard_normal(problem.blocks.max() + 1)
    item = located(problem, 1, 5.0 * draws[problem.blocks])
    assert item.p_value < 1e-9
    assert not item.depends_on


def test_a_burst_is_found_in_time(problem: Problem) -> None:
    burst = (problem.time > 6.0) & (problem.time < 6.5)
    item = located(problem, 1, 4.0 * burst)
    start, stop = item.windows[0]
    # a window of 1/240 of 20 s, and one sample of 1/80 s
    assert start == pytest.approx(6.0, abs=0.15)
    assert stop == pytest.approx(6.5, abs=0.15)
    assert "6." in item.words


def test_a_line_in_the_spectrum_is_found(problem: Problem) -> None:
    item = located(problem, 0, 2.0 * np.sin(2 * np.pi * 3.3 * problem.time))
    # Welch's windows of a sixth of 20 s resolve 0.3 Hz
    assert item.frequency_hz[0] == pytest.approx(3.3, abs=0.3)


def test_windows_come_strongest_first_and_not_from_even_noise() -> None:
    chance = np.random.default_rng(2)
    time = np.arange(4800) / 100.0
    noise = chance.standard_normal(4800)
    residual = noise.copy()
    residual[1000:1200] += 5.0
    residual[3000:3100] += 12.0
    first, second = outstanding_windows(time, residual)[:2]
    # half the averaging window of 20 samples on each side
    assert first == pytest.approx((30.0, 31.0), abs=0.15)
    assert second == pytest.approx((10.0, 12.0), abs=0.15)
    assert not outstanding_windows(time, noise)
    assert not outstanding_windows(time, np.zeros(4800))


@pytest.mark.parametrize("flips", [False, True])
@pytest.mark.parametrize("order", [5.0, 40.0])
def test_orders_along_the_position(order: float, flips: bool) -> None:
    time = np.arange(8000) / 200.0
    position = np.sin(2 * np.pi * 0.11 * time) + 0.7 * np.sin(2 * np.pi * 0.05 * time)
    velocity = np.gradient(position, time)
    residual = np.cos(order * position + 0.4) * (np.sign(velocity) if flips else 1.0)
    residual += 0.5 * np.random.default_rng(3).standard_normal(time.size)
    peaks = spatial_peaks(position, velocity, residual, cutoff=20.0, count=2)
    # the travel resolves 2 pi over itself; the peak of a strong line is known far better
    assert min(abs(k - order) for k in peaks) < 0.3 * 2 * np.pi / np.ptp(position)
    strongest = peaks[2 if flips and len(peaks) > 2 else 0]
    assert abs(strongest - order) < np.pi / np.ptp(position)


def test_no_orders_without_travel_or_above_the_filter() -> None:
    time = np.arange(2000) / 200.0
    still = np.zeros(2000)
    assert spatial_peaks(still, still, np.sin(time), cutoff=10.0, count=2) == ()
    position = np.sin(time)
    velocity = np.cos(time)
    fast = spatial_peaks(position, velocity, np.cos(300.0 * position), cutoff=2.0, count=3)
    assert all(order < 2 * np.pi * 2.0 / 0.5 for order in fast)


def loaded() -> Robot:
    """Joints in two bearings each, joint 2 inclined, so that gravity bends its bearings pose by pose."""
    data = ROBOT.model_dump()
    for joint in data["joints"]:
        joint["bearing"] = {"radial_arm": 0.05, "axial_arm": 0.04, "span": 0.2}
    data["joints"][1]["axis"] = [0.0, -0.6, 0.8]
    return Robot.model_validate(data)


LOADED = loaded()


def load_moment(position: Array, velocity: Array, acceleration: Array) -> Array:
    loads = RobotModel(LOADED).bearing_loads(position, velocity, acceleration)
    return np.asarray(0.04 * loads[:, :, 1] + 0.05 * loads[:, :, 3])


def sign(velocity: Array) -> Array:
    return np.tanh(velocity / 1e-3)


def at_joint2(
    extra: Extra,
    *,
    seed: int,
    robot: Robot = ROBOT,
    motions: tuple[object, ...] = FAR,
    temperature: Array | None = None,
) -> Mismatch:
    """What is said of joint 2, whose actuator alone delivers `extra` more."""
    recording = recorded(robot, motions, lambda *now: extra(*now) * [0.0, 1.0], duration=20.0, seed=seed)
    if temperature is not None:
        noise = 0.1 * np.random.default_rng([seed, 1]).standard_normal(len(recording))
        recording = recording.with_channels({"joint2.temperature": temperature + noise})
    problem = problem_of(robot, recording)
    return next(m for m in locate(problem, robot, problem.residual) if m.location == "joint2")


def conditions(item: Mismatch) -> set[str]:
    """Temperature and load, where they are told."""
    return {d.variable for d in item.depends_on} & {"joint2.temperature", "joint2.load_moment"}


def warmth(time: Array) -> Array:
    return np.asarray(293.15 + 20.0 * (1 - np.exp(-time / 6.0)))


def cooling(time: Array) -> Array:
    """Warms, and cools again half way."""
    return np.asarray(293.15 + 20.0 * np.sin(np.pi * time / 20.0) ** 2)


TIME = np.arange(5000) / 250.0


@every_seed
def test_a_ripple_is_located_by_its_order(seed: int) -> None:
    item = at_joint2(lambda t, q, v, a: np.cos(12 * q + 0.3), seed=seed)
    (order,) = item.orders
    assert (order.variable, order.unit) == ("joint2.position", "1/turn")
    # the travel of 4 rad resolves 1.6 per turn; a strong cycle is known far better
    assert order.cycles == pytest.approx(12.0, abs=0.1)
    assert order.per_motor_turn == pytest.approx(order.cycles / 80.0)
    # 1 N m of ripple and some hundredths of noise
    assert 0.9 < order.share <= 1.0
    assert "with a cycle of 12 per turn of joint2 (0.15 per turn of its motor)" in item.words
    assert not conditions(item)


@every_seed
def test_an_order_of_friction_is_reported_beside_the_friction(seed: int) -> None:
    item = at_joint2(lambda t, q, v, a: (3.0 + np.cos(20 * q)) * sign(v), seed=seed)
    assert item.depends_on[0].variable == "joint2.velocity"
    (order,) = item.orders
    assert order.cycles == pytest.approx(20.0, abs=0.1)
    # half of 1 beside 9
    assert order.share == pytest.approx(0.05, abs=0.02)


def test_two_orders_are_reported_largest_first() -> None:
    item = at_joint2(lambda t, q, v, a: np.cos(20 * q) + 0.7 * np.sin(7 * q), seed=0)
    assert [o.cycles for o in item.orders] == pytest.approx([20.0, 7.0], abs=0.2)


def test_a_frequency_is_no_order() -> None:
    for seed in SEEDS:
        item = at_joint2(lambda t, q, v, a: np.sin(2 * np.pi * 1.7 * t) + 0 * q, seed=seed)
        assert item.frequency_hz
        assert not item.orders


class Turning:
    """Turns on and on, at a constant speed or not."""

    def __init__(self, change: float) -> None:
        self.change = change

    def __call__(self, t: Array) -> tuple[Array, Array, Array]:
        w, c = 0.2 * np.pi, self.change
        return 1.3 * t + c * np.sin(w * t), 1.3 + c * w * np.cos(w * t), -c * w**2 * np.sin(w * t)


@pytest.mark.parametrize(("change", "told"), [(0.0, False), (0.8, True)])
def test_a_constant_speed_does_not_tell_order_from_frequency(change: float, told: bool) -> None:
    item = at_joint2(lambda t, q, v, a: np.cos(7 * q), seed=0, motions=(ARM[0], Turning(change)))
    assert [o.cycles for o in item.orders] == pytest.approx([7.0] * told, abs=0.05)
    assert item.frequency_hz


def test_fewer_than_two_cycles_are_a_curve_over_the_position() -> None:
    item = at_joint2(lambda t, q, v, a: np.cos(2.5 * q), seed=0)
    assert item.depends_on[0].variable == "joint2.position"
    assert not item.orders


def test_a_gearless_slide_is_recognised_by_cycles_per_metre() -> None:
    data = bare("single_axis", noise=True).model_dump()
    data["joints"][0]["actuator"]["gear_ratio"] = 1.0
    robot = Robot.model_validate(data)
    motion = (Sines((0.06, 0.035, 0.012), (0.15, 0.37, 0.83), (0.0, 1.3, 2.1), centre=0.2),)
    size = 40.0 * problem_of(robot, recorded(robot, motion, seed=0)).noise_floor[0]
    pitch = 2 * np.pi / 0.02
    problem = problem_of(
        robot, recorded(robot, motion, lambda t, q, v, a: size * np.cos(pitch * q), duration=20.0, seed=0)
    )
    (item,) = locate(problem, robot, problem.residual)
    (order,) = item.orders
    assert (order.unit, order.per_motor_turn) == ("1/m", None)
    assert order.cycles == pytest.approx(50.0, rel=0.01)
    assert "50 per metre of joint1, which" in item.words


@every_seed
@pytest.mark.parametrize("warming", [warmth, cooling])
def test_friction_that_fades_with_warmth_is_located_by_temperature(warming: Extra, seed: int) -> None:
    def extra(t: Array, q: Array, v: Array, a: Array) -> Array:
        return 3.0 * sign(v) * (np.exp(-0.03 * (warming(t) - 293.15)) - 1)

    item = at_joint2(extra, seed=seed, temperature=warming(TIME))
    assert conditions(item) == {"joint2.temperature"}
    assert share(item, "velocity") > share(item, "temperature") > 0.05
    assert "a curve over its temperature explains" in item.words
    found = next(d for d in item.depends_on if d.variable.endswith("temperature"))
    assert 292.0 < found.range[0] < found.range[1] < 314.0
    assert not item.orders
    assert not conditions(at_joint2(extra, seed=seed))


@every_seed
def test_a_thermometer_is_no_stand_in_for_the_time(seed: int) -> None:
    """Friction that grows with the time on a joint that warms as well, and one that warms by 0.5 K."""
    item = at_joint2(lambda t, q, v, a: 0.1 * t * sign(v), seed=seed, temperature=warmth(TIME))
    assert not conditions(item)

    def little(t: Array) -> Array:
        return np.asarray(293.15 + (warmth(t) - 293.15) / 40)

    fading = at_joint2(
        lambda t, q, v, a: 3.0 * sign(v) * (little(t) - 294.0), seed=seed, temperature=little(TIME)
    )
    assert not conditions(fading)


@every_seed
def test_friction_of_a_loaded_bearing_is_located_by_its_load(seed: int) -> None:
    def extra(t: Array, q: Array, v: Array, a: Array) -> Array:
        return 0.3 * sign(v) * load_moment(q, v, a)

    item = at_joint2(extra, seed=seed, robot=LOADED)
    assert conditions(item) == {"joint2.load_moment"}
    assert "a curve over the load of its bearing explains" in item.words
    assert not item.orders
    # without a bearing in the robot file nothing is known of its load
    blank = LOADED.model_dump()
    for joint in blank["joints"]:
        joint["bearing"] = None
    assert not conditions(at_joint2(extra, seed=seed, robot=Robot.model_validate(blank)))


@every_seed
def test_a_load_is_no_stand_in_for_the_pose_or_the_torque(seed: int) -> None:
    def gear(t: Array, q: Array, v: Array, a: Array) -> Array:
        return 0.1 * sign(v) * np.abs(RobotModel(LOADED).inverse_dynamics(q, v, a))

    # friction of the gears goes with the torque of both; the load of joint 1 goes with its torque
    problem = problem_of(LOADED, recorded(LOADED, FAR, gear, duration=20.0, seed=seed))
    found = locate(problem, LOADED, problem.residual)
    assert all(d.variable.split(".")[1] != "load_moment" for m in found for d in m.depends_on)
    cable = at_joint2(lambda t, q, v, a: 0.3 * q + 0.5 * q**2, seed=seed, robot=LOADED)
    assert not conditions(cable)
    assert cable.depends_on[0].variable == "joint2.position"


@pytest.mark.parametrize("seed", range(6))
def test_plain_friction_has_no_order_and_no_condition(seed: int) -> None:
    item = at_joint2(lambda t, q, v, a: 3.0 * sign(v), seed=seed, robot=LOADED, temperature=warmth(TIME))
    assert item.depends_on[0].variable == "joint2.velocity"
    assert not conditions(item)
    assert not item.orders
