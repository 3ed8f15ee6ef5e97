"""Conditions of a case: their frequencies and their implementation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from challenge_cases import ARM, design, hiding, made

from exudyn_model import simulate
from missing_physics.challenge.cases.conditions import (
    CELLS,
    CORNER,
    TORQUES,
    Conditions,
    Factors,
    TorqueRecord,
    draw_torque_record,
    factors_of,
)
from missing_physics.challenge.cases.families import family_of
from missing_physics.challenge.cases.numbers import (
    DEVELOPMENT_SEEDS,
    HALVES,
    YARDSTICK_SEEDS,
    half_of,
    is_kept_for_scoring,
)
from missing_physics.challenge.cases.ranges import Draw
from missing_physics.challenge.cases.truth import Design
from missing_physics.challenge.concealing.conceal import Concealed, concealed, with_exact
from missing_physics.challenge.concealing.recorded_torque import TorquePath, logged
from missing_physics.challenge.draws.design import draw_design
from missing_physics.challenge.draws.file_errors import draw_file_errors, with_file_errors
from missing_physics.challenge.draws.hold import PHASE, SHORTEST, bandwidth, draw_hold
from robot_model import (
    ComputedTorque,
    JointPD,
    NoController,
    Recording,
    Robot,
    load_robot,
    robot_from_toml,
    shipped_robots,
)

RATE = 200.0


def drawing(seed: int = 1) -> Draw:
    return Draw(np.random.default_rng(seed))


def under(case: Design, conditions: Conditions) -> Concealed:
    return Concealed(case.model_copy(update={"conditions": conditions}))


@cache
def motion() -> tuple[Recording, Recording]:
    """Both recordings of the axis without sensors."""
    return made(design()).exact


def along(conditions: Conditions) -> Concealed:
    """The axis under conditions that do not change its motion, not simulated again."""
    case = design().model_copy(update={"conditions": conditions})
    return Concealed.of(case, [(exact.time, exact.channels) for exact in motion()])


# Shares


@pytest.mark.parametrize("half", HALVES)
def test_every_level_of_every_factor_is_balanced_in_both_halves(half: str) -> None:
    """Off by at most 8 of 150: two to three standard deviations of what the last, incomplete block may do."""
    drawn = [factors_of(number) for number in YARDSTICK_SEEDS if half_of(number) == half]
    assert len(drawn) == 150
    for factor in ("file_exact", "controller_known", "held", "noise_stated"):
        assert abs(sum(getattr(own, factor) for own in drawn) - 75) <= 8, factor
    counts = Counter(own.torque for own in drawn)
    assert all(abs(counts[kind] - 150 / 4) <= 8 for kind in TORQUES)


def test_each_block_of_each_half_contains_every_combination_once() -> None:
    for parity in (0, 1):
        block = [factors_of(2 * k + parity) for k in range(2 * len(CELLS), 3 * len(CELLS))]
        assert Counter(block) == Counter(CELLS)


def test_conditions_are_independent_of_the_hidden_effects() -> None:
    """Pearson's chi-square of families against each factor on the yardstick: no more than chance."""
    families = [family_of(number) for number in YARDSTICK_SEEDS]
    for factor in Factors.model_fields:
        levels = [getattr(factors_of(number), factor) for number in YARDSTICK_SEEDS]
        table = Counter(zip(families, levels))
        square = 0.0
        for family, many in Counter(families).items():
            for level, often in Counter(levels).items():
                expected = many * often / len(YARDSTICK_SEEDS)
                square += (table[family, level] - expected) ** 2 / expected
        freedom = (len(set(families)) - 1) * (len(set(levels)) - 1)
        assert square < freedom + 3.5 * np.sqrt(2 * freedom), factor


def test_yardstick_halves_are_fixed() -> None:
    """The half that is only counted would be worth nothing if numbers changed sides."""
    assert range(50000, 50300) == YARDSTICK_SEEDS
    assert [half_of(number) for number in (50000, 50001, 50298, 50299)] == ["looked", "counted"] * 2
    assert not set(YARDSTICK_SEEDS) & set(DEVELOPMENT_SEEDS)
    assert [is_kept_for_scoring(number) for number in (19999, 20000, 50000, 50299, 50300)] == [
        *(False, True, False, False, True)
    ]


def test_case_files_follow_the_conditions() -> None:
    for number in range(10050, 10075):
        case = draw_design(number)
        factors = factors_of(number)
        assert case.conditions.factors == factors
        assert bool(case.conditions.file_errors) == (not factors.file_exact)
        assert (case.nominal.controller.sample_time > 0) == factors.held
        assert case.conditions.torque.kind == factors.torque


# Robot file


@pytest.mark.parametrize("name", shipped_robots())
@pytest.mark.parametrize("seed", range(5))
def test_file_errors_are_one_to_ten_percent_and_realisable(name: str, seed: int) -> None:
    robot = load_robot(name)
    errors = draw_file_errors(robot, drawing(seed))
    file = with_file_errors(robot, errors)  # Robot itself refuses bodies that cannot be
    assert errors
    assert all(0.01 <= abs(error) <= 0.1 for error in errors.values())
    for real, wrong in zip(robot.links, file.links):
        for before, after in ((real.mass, wrong.mass), *zip(real.inertia, wrong.inertia)):
            assert before == after == 0 or 0.01 <= abs(after / before - 1) <= 0.1001
    for real, wrong in zip(robot.effects, file.effects):
        [ratio] = {round(wrong.parameters[key] / real.parameters[key], 9) for key in real.parameters}
        assert 0.01 <= abs(ratio - 1) <= 0.1001
    for real, wrong in zip(robot.moving_joints, file.moving_joints):
        before, after = real.actuator.rotor_inertia, wrong.actuator.rotor_inertia
        assert before == after == 0 or 0.01 <= abs(after / before - 1) <= 0.1001


def test_file_errors_differ_between_parameters() -> None:
    errors = draw_file_errors(load_robot("six_joint_space_arm"), drawing())
    assert {"base.mass", "link1.inertia", "joint1.rotor_inertia"} <= set(errors)
    assert len(set(errors.values())) == len(errors)
    assert 0.2 < np.mean([error > 0 for error in errors.values()]) < 0.8


def test_simulation_uses_the_machine_and_diagnosis_gets_the_file() -> None:
    drawn = design(ARM, seconds=0.3)
    # A PD controller that does not know the arm's weight carries no model.
    blind = drawn.nominal.controller.model_copy(update={"gravity_feedforward": False})
    case = drawn.model_copy(update={"nominal": drawn.nominal.model_copy(update={"controller": blind})})
    exact = under(case, Conditions())
    wrong = under(case, Conditions(file_errors={"link2.mass": 0.1, "joint1.rotor_inertia": -0.05}))
    assert wrong.given.links[1].mass == pytest.approx(1.1 * exact.given.links[1].mass)
    assert np.array_equal(wrong.exact[0]["joint1.torque"], exact.exact[0]["joint1.torque"])


def test_controller_uses_the_parameters_of_the_file() -> None:
    """A heavier model asks for more torque at rest than the machine needs."""
    arm = design(ARM, seconds=0.3).nominal
    robot = arm.model_copy(update={"controller": ComputedTorque(kp=400.0, kd=40.0)})
    heavy = with_file_errors(robot, {"link2.mass": 0.1, "link1.mass": 0.1})
    true, wrong = (simulate(robot, sensors=False, controller_model=model) for model in (None, heavy))
    first = slice(0, 1)
    assert abs(wrong["joint1.torque"][first]) > 1.02 * abs(true["joint1.torque"][first])
    assert np.abs(wrong["joint1.position"] - true["joint1.position"]).max() > 1e-4


def files(conditions: Conditions) -> tuple[Robot, str, dict[str, bytes]]:
    made = along(conditions).files()
    return robot_from_toml(made["robot.toml"].decode()), made["robot.toml"].decode(), made


def test_robot_file_without_controller_has_no_reference() -> None:
    robot, _, made = files(Conditions(factors=Factors(controller_known=False)))
    assert isinstance(robot.controller, NoController)
    assert robot.reference is None
    assert b"reference" not in made["recording.csv"].splitlines()[0]
    whole, _, complete = files(Conditions())
    assert isinstance(whole.controller, JointPD)
    assert b"joint1.reference_position" in complete["recording.csv"].splitlines()[0]


def test_unstated_noise_is_in_no_file() -> None:
    robot, text, made = files(Conditions(factors=Factors(noise_stated=False)))
    assert robot.sensors == ()
    assert "noise" not in text
    assert "resolution" not in text
    _, _, stated = files(Conditions())
    assert made["recording.csv"] == stated["recording.csv"]  # what was not said was there all the same


def test_case_files_do_not_contain_the_conditions() -> None:
    """They are sealed with the truth: no word of them is in the files."""
    conditions = Conditions(
        factors=Factors(file_exact=False, torque="filtered"),
        file_errors={"carriage.mass": 0.0473},
        torque=TorqueRecord(kind="filtered", order=2, corner=61.7),
    )
    _, text, made = files(conditions)
    for secret in ("0.0473", "61.7", "filtered", "Butterworth", "recorded_torque"):
        assert secret not in text
        assert secret.encode() not in made["recording.csv"].splitlines()[0]


# Held command


def test_held_command_is_a_staircase() -> None:
    """Two samples of each tick of 10 ms hold the same torque; a continuous one changes at each."""
    robot = design(seconds=0.5).nominal
    held = robot.model_copy(
        update={"controller": robot.controller.model_copy(update={"sample_time": 2 / RATE})}
    )
    torque = simulate(held, sensors=False)["joint1.torque"]
    pairs = torque[: len(torque) // 2 * 2].reshape(-1, 2)
    assert np.array_equal(pairs[:, 0], pairs[:, 1])
    smooth = simulate(robot, sensors=False)["joint1.torque"]
    assert np.mean(smooth[:-1:2] == smooth[1::2]) < 0.05


def test_a_hold_keeps_the_phase_of_the_loop_and_the_clock_of_the_recording() -> None:
    for number in range(10050, 10060):
        robot = draw_design(number).nominal
        hold = draw_hold(robot, 250.0, drawing(number))
        assert 1 / (250.0 * hold) == pytest.approx(round(1 / (250.0 * hold)))
        assert hold == pytest.approx(SHORTEST) or hold * bandwidth(robot) / 2 <= PHASE


def test_bandwidth_of_a_position_loop_equals_its_closed_form() -> None:
    axis = load_robot("single_axis")
    robot = axis.model_copy(update={"controller": JointPD(kp=95.0 * 30.0**2, kd=95.0 * 20.0)})
    assert bandwidth(robot) == pytest.approx(30.0)
    stiff = axis.model_copy(update={"controller": JointPD(kp=95.0 * 30.0**2, kd=95.0 * 50.0)})
    assert bandwidth(stiff) == pytest.approx(50.0)


# Recorded torque


def wave(path: TorquePath, frequency: float = 3.0) -> tuple[np.ndarray, np.ndarray]:
    """A sine on the finer grid, and the instants of the log; 10 s."""
    fine = path.rate * path.steps
    time = np.arange(int(10 * fine)) / fine
    return np.sin(2 * np.pi * frequency * time), time[:: path.steps]


@pytest.mark.parametrize("order", [1, 2])
def test_a_filter_has_the_response_of_its_order(order: int) -> None:
    """Gain and phase of 1/(1 + s), or of 1/(1 + sqrt(2) s + s^2), with s = i f/f_c."""
    path = TorquePath(TorqueRecord(kind="filtered", order=order, corner=30.0), 0.0, RATE)
    torque, time = wave(path)
    s = 1j * 3.0 / 30.0
    response = 1 / (1 + s) if order == 1 else 1 / (1 + np.sqrt(2) * s + s**2)
    expected = abs(response) * np.sin(2 * np.pi * 3.0 * time + np.angle(response))
    # Linear pieces of 1 ms follow a sine of 3 Hz to (w h)^2 / 8 = 4e-5; the beginning is left out.
    assert np.abs(path.passed(torque) - expected)[100:].max() < 5e-5


def test_a_delay_is_that_of_the_record() -> None:
    path = TorquePath(TorqueRecord(kind="delayed", delay=0.0031), 0.0, RATE)
    torque, time = wave(path)
    assert np.abs(path.passed(torque) - np.sin(2 * np.pi * 3.0 * (time - 0.0031)))[5:].max() < 5e-5


@pytest.mark.parametrize("share", [0.5, 0.99])
def test_a_late_log_of_a_command_held_for_a_sample_shows_the_last_one(share: float) -> None:
    path = TorquePath(TorqueRecord(kind="delayed", delay=share / RATE), 1 / RATE, RATE)
    commands = np.random.default_rng(2).normal(size=50)
    staircase = np.repeat(commands, path.steps)
    assert np.array_equal(path.passed(staircase)[1:], commands[:-1])


def test_ticks_of_the_controller_are_on_the_finer_grid() -> None:
    for rate, ticks in ((200.0, 2), (250.0, 1), (250.0, 8), (1000.0, 2)):
        record = TorqueRecord(kind="delayed", delay=0.7 / rate)
        steps = TorquePath(record, 1 / (rate * ticks), rate).steps
        assert steps % ticks == 0
        assert rate * steps >= 1000.0
    assert TorquePath(TorqueRecord(kind="command"), 0.001, 200.0).steps == 1


def test_noise_behind_a_filter_has_unit_rms_and_its_colour() -> None:
    path = TorquePath(TorqueRecord(kind="filtered", order=1, corner=30.0), 0.0, RATE)
    noise = path.noise(100_000, np.random.default_rng(3))
    assert noise.std() == pytest.approx(1.0, abs=0.01)
    # One pole at exp(-w T): successive samples of filtered white noise are correlated by it.
    correlation = np.mean(noise[1:] * noise[:-1])
    assert correlation == pytest.approx(np.exp(-2 * np.pi * 30.0 / RATE), abs=0.02)


def test_drawn_torque_records_are_within_their_ranges() -> None:
    for seed in range(50):
        late, behind = (draw_torque_record(kind, RATE, drawing(seed)) for kind in ("delayed", "filtered"))
        assert 0.5 / RATE <= late.delay <= 1.0 / RATE
        assert behind.order in (1, 2)
        assert CORNER[0] * RATE <= behind.corner <= CORNER[1] * RATE
        # -d(phase)/dw at rest: 1/w_c, or sqrt(2)/w_c.
        assert np.sqrt(behind.order) / (2 * np.pi * behind.corner) <= 1.51 / RATE


def recorded(record: TorqueRecord) -> tuple[Recording, Recording, Concealed]:
    """A recording, its exact motion, and its case."""
    plain = record.kind in ("command", "measured")
    case = along(Conditions(torque=record)) if plain else under(design(), Conditions(torque=record))
    return case.recordings[0], case.exact[0], case


def test_a_command_is_recorded_without_noise() -> None:
    made, exact, case = recorded(TorqueRecord(kind="command"))
    sensor = case.sensed_by.sensor("joint1.torque")
    assert sensor.noise == 0
    error = made["joint1.torque"] - exact["joint1.torque"]
    assert np.abs(error).max() <= 0.5001 * sensor.resolution


def test_a_measured_torque_has_the_noise_of_its_sensor() -> None:
    made, exact, case = recorded(TorqueRecord(kind="measured"))
    sensor = case.sensed_by.sensor("joint1.torque")
    spread = np.hypot(sensor.noise, sensor.resolution / np.sqrt(12))
    assert np.std(made["joint1.torque"] - exact["joint1.torque"]) == pytest.approx(spread, rel=0.1)


def test_a_delayed_torque_lags_behind_the_true_one() -> None:
    delay = 0.8 / RATE
    made, exact, _ = recorded(TorqueRecord(kind="delayed", delay=delay))
    rate = np.gradient(exact["joint1.torque"], exact.time)
    missing = exact["joint1.torque"] - made["joint1.torque"]
    assert float(rate @ missing / (rate @ rate)) == pytest.approx(delay, rel=0.05)


def test_filtered_noise_is_as_large_as_the_file_states() -> None:
    made, exact, case = recorded(TorqueRecord(kind="filtered", order=2, corner=40.0))
    error = made["joint1.torque"] - logged(exact, "joint1")
    sensor = case.given.sensor("joint1.torque")
    spread = np.hypot(sensor.noise, sensor.resolution / np.sqrt(12))
    assert np.std(error) == pytest.approx(spread, rel=0.15)
    drawn = case.design.nominal.sensor("joint1.torque").noise
    assert sensor.noise == pytest.approx(drawn * case.path.noise_gain)


def test_noise_of_an_effects_size_is_added_to_commands() -> None:
    case = hiding("torque_offset", "joint1", torque=8.0)
    noisy = {"noise_ratio": 0.5, "noise_of": case.hidden[0]}
    made = under(case.model_copy(update=noisy), Conditions(torque=TorqueRecord(kind="command")))
    assert made.sensed_by.sensor("joint1.torque").noise == pytest.approx(4.0)


def hold(case: Design, seconds: float) -> Design:
    controller = case.nominal.controller.model_copy(update={"sample_time": seconds})
    return case.model_copy(update={"nominal": case.nominal.model_copy(update={"controller": controller})})


@pytest.mark.parametrize(
    "change",
    [
        lambda case: case,
        lambda case: hold(case, 1 / RATE),
        lambda case: case.model_copy(
            update={"conditions": Conditions(torque=TorqueRecord(kind="delayed", delay=0.6 / RATE))}
        ),
    ],
    ids=["measured", "held", "delayed and held"],
)
def test_the_exact_motion_of_a_case_makes_the_same_files_again(change: Callable[[Design], Design]) -> None:
    case = change(hold(design(seconds=0.5), 0.5 / RATE))
    made = concealed(case)
    again = with_exact(case, made["exact.npz"]).files()
    assert again == {name: made[name] for name in again}


def test_least_squares_with_an_exact_file_leaves_only_noise() -> None:
    """Mass and friction of the axis against the recorded torque: nothing is missing, nothing is left."""
    case = along(Conditions(torque=TorqueRecord(kind="measured")))
    made, exact = case.recordings[0], case.exact[0]
    velocity = exact["joint1.velocity"]
    moving = np.abs(velocity) > 1e-3
    columns = np.column_stack([exact["joint1.acceleration"], velocity, np.sign(velocity)])[moving]
    torque = made["joint1.torque"][moving]
    found = np.linalg.lstsq(columns, torque, rcond=None)[0]
    sensor = case.given.sensor("joint1.torque")
    spread = np.hypot(sensor.noise, sensor.resolution / np.sqrt(12))
    assert np.std(torque - columns @ found) == pytest.approx(spread, rel=0.1)
    assert found[0] == pytest.approx(case.given.links[0].mass, rel=0.02)
