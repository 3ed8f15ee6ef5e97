"""Drawn arms of one and two joints, and their recordings by inverse dynamics along analytic motions.

Nothing is integrated: the recorded torque is the equation of motion at the recorded instants, plus noise. So
whatever intervals miss is due to the inference, not to an integrator.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.signal import lfilter

from robot_model import Recording, Robot, robot_from_toml

__all__ = ["EFFECTS", "Arm", "arm_of"]

Array = NDArray[np.float64]

#: Effects of the catalogue that an arm has beyond friction and offsets; none in the first of every eight.
EFFECTS = (
    "",
    "cable_spring",
    "torque_ripple",
    "stribeck_friction",
    "asymmetric_friction",
    "quadratic_drag",
    "external_torque",
    "lugre_friction",
)
#: Effects that hold Coulomb friction themselves.
LAWS = ("stribeck_friction", "lugre_friction")
#: First number of the seeds.
SEED = 62000
GRAVITY = 9.81
#: Duration of each of the two recordings [s], and their possible sampling rates [Hz].
DURATION, RATES = 30.0, (100.0, 200.0, 500.0)
#: Sines per joint, and the range of their frequencies [Hz].
SINES, FREQUENCIES = 4, (0.08, 0.7)
#: Noise of encoders [rad], and of torques relative to their rms [-], per sample.
ENCODER, TORQUE = (1e-6, 1e-4), (0.01, 0.1)
#: Relative standard deviation of the file's masses, centres, inertias and rotors [-].
FILE_ERROR = 0.03
#: Highest frequency of a ripple at the median speed, as a multiple of the highest one of the motion [-]: the
#: band ends at five times the bandwidth of the motion.
RIPPLE = 2.5
#: Travel before bristles slide relative to the joint's [-], and their damping over their stiffness [s].
PRESLIDING, BUILDS_UP = (3e-4, 3e-2), (1e-3, 1e-2)
#: Steps of the bristles' equation within a sample, in which the speed is taken as constant.
STEPS = 20


@dataclass(frozen=True)
class Link:
    """A link of a planar arm: mass [kg], centre and length [m], inertia about the centre, rotor [kg m^2]."""

    mass: float
    centre: float
    length: float
    inertia: float
    rotor: float


@dataclass(frozen=True)
class Motion:
    """Sums of sines: rates [rad/s], sizes [rad] and phases [rad] of each joint, shape (n, s)."""

    rates: Array
    sizes: Array
    phases: Array

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """Position, velocity, acceleration, shape (N, n) each."""
        angle = self.rates * time[:, None, None] + self.phases
        slow = self.sizes * self.rates
        parts = self.sizes * np.sin(angle), slow * np.cos(angle), -slow * self.rates * np.sin(angle)
        position, velocity, acceleration = (part.sum(axis=2) for part in parts)
        return position, velocity, acceleration


@dataclass(frozen=True)
class Arm:
    """A drawn arm.

    Attributes:
        number: of the draw, which is its seed.
        robot: the file, without friction, with inexact masses.
        effect: id of the effect, "" for none.
        at: joint of the effect.
        truth: parameters of the effect by name.
        friction: viscous, Coulomb friction and offset of each joint by the name of the standard model.
        delay: of the recorded torques [s].
        fit, held_out: recordings.
    """

    number: int
    robot: Robot
    effect: str
    at: str
    truth: Mapping[str, float]
    friction: Mapping[str, float]
    delay: float
    fit: Recording
    held_out: Recording


def arm_of(number: int, *, drift: float = 0.0) -> Arm:
    """The arm of a number: eight effects in turn, first with one joint, then with two.

    Args:
        number: of the draw.
        drift: time constant of an additional first-order low-passed noise of the torques [s], as large as
            their white noise; none if zero.
    """
    random = np.random.default_rng([SEED, number])
    effect, joints = EFFECTS[number % len(EFFECTS)], 1 + number // len(EFFECTS) % 2
    links = [_link(random) for _ in range(joints)]
    motions = [_motion(random, joints) for _ in range(2)]
    level = bool(random.random() < 0.5)  # a level arm has no gravity in its torques
    rate = float(random.choice(RATES))
    time = np.arange(0.0, DURATION, 1.0 / rate)
    gravity = 0.0 if level else GRAVITY
    needed, speed = _needed(links, gravity, *motions[0].at(time)), motions[0].at(time)[1]
    size, fastest = np.sqrt(np.mean(needed**2, axis=0)), np.abs(speed).max(axis=0)
    friction = {}
    for k in range(joints):
        name = f"joint{k + 1}"
        friction[f"{name}.viscous"] = size[k] / fastest[k] * _decades(random, 0.02, 0.5)
        friction[f"{name}.coulomb"] = size[k] * _decades(random, 0.02, 0.4)
        friction[f"{name}.offset"] = size[k] * random.normal(0.0, 0.05)
    k = int(random.integers(joints))
    truth = _effect(random, effect, float(size[k]), motions[0], k, time) if effect else {}
    if effect in ("cable_spring", "asymmetric_friction"):  # holds a constant torque itself
        friction[f"joint{k + 1}.offset"] = 0.0
    if effect in LAWS:
        friction[f"joint{k + 1}.coulomb"] = 0.0
    delay = float(random.normal(0.0, 1.0 / rate))
    encoder, torque_noise = _decades(random, *ENCODER), size * _decades(random, *TORQUE)
    recordings = []
    for which, motion in enumerate(motions):
        moved = motion.at(time - delay)
        torque = _needed(links, gravity, *moved)
        for j in range(joints):
            own = [friction[f"joint{j + 1}.{kind}"] for kind in ("viscous", "coulomb", "offset")]
            torque[:, j] += own[0] * moved[1][:, j] + own[1] * np.sign(moved[1][:, j]) + own[2]
        if effect and not (effect == "external_torque" and which == 1):
            torque[:, k] = _with_effect(
                effect, truth, time - delay, moved[0][:, k], moved[1][:, k], torque[:, k]
            )
        channels = {}
        for j in range(joints):
            noisy = motion.at(time)[0][:, j] + encoder * random.standard_normal(time.size)
            channels[f"joint{j + 1}.position"] = noisy
            noise = random.standard_normal(time.size)
            if drift:
                noise = noise + _drift(np.random.default_rng([SEED, number, which, j]), time, drift)
            channels[f"joint{j + 1}.torque"] = torque[:, j] + torque_noise[j] * noise
        recordings.append(Recording(time, channels, source=f"arm {number}, run {which + 1}"))
    robot = _robot(random, links, gravity, encoder, torque_noise)
    return Arm(number, robot, effect, f"joint{k + 1}", truth, friction, delay, *recordings)


def _decades(random: np.random.Generator, low: float, high: float) -> float:
    """Log-uniform."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def _drift(random: np.random.Generator, time: Array, constant: float) -> Array:
    """Stationary first-order low-passed noise of rms one with this time constant [s]."""
    kept = float(np.exp(-(time[1] - time[0]) / constant))
    white = np.sqrt(1.0 - kept**2) * random.standard_normal(time.size)
    white[0] /= np.sqrt(1.0 - kept**2)
    return np.asarray(lfilter([1.0], [1.0, -kept], white))


def _link(random: np.random.Generator) -> Link:
    mass, length = _decades(random, 0.5, 10.0), random.uniform(0.2, 0.6)
    radius = length * random.uniform(0.2, 0.35)
    inertia = mass * radius**2
    return Link(
        mass, length * random.uniform(0.3, 0.7), length, inertia, inertia * _decades(random, 0.02, 0.5)
    )


def _motion(random: np.random.Generator, joints: int) -> Motion:
    low, high = np.log(FREQUENCIES)
    frequencies = np.exp(random.uniform(low, high, (joints, SINES)))
    sizes = random.uniform(0.15, 0.4, (joints, SINES)) / np.sqrt(frequencies)
    return Motion(2.0 * np.pi * frequencies, sizes, random.uniform(0.0, 2.0 * np.pi, (joints, SINES)))


def _needed(links: list[Link], gravity: float, q: Array, v: Array, a: Array) -> Array:
    """Torques of the arm by Lagrange's equations, angles from the horizontal, shape (N, n)."""
    one = links[0]
    own = one.inertia + one.mass * one.centre**2
    if len(links) == 1:
        return np.asarray((own + one.rotor) * a + gravity * one.mass * one.centre * np.cos(q))
    two = links[1]
    first, second = own + two.mass * one.length**2, two.inertia + two.mass * two.centre**2
    h, whole = two.mass * one.length * two.centre, q[:, 0] + q[:, 1]
    c, s = h * np.cos(q[:, 1]), h * np.sin(q[:, 1])
    outer = gravity * two.mass * two.centre * np.cos(whole)
    inner = gravity * (one.mass * one.centre + two.mass * one.length) * np.cos(q[:, 0])
    carried = (second + c) * a[:, 1] - s * (2.0 * v[:, 0] * v[:, 1] + v[:, 1] ** 2)
    torque = (first + second + 2.0 * c + one.rotor) * a[:, 0] + carried + inner + outer
    outermost = (second + c) * a[:, 0] + (second + two.rotor) * a[:, 1] + s * v[:, 0] ** 2 + outer
    return np.column_stack([torque, outermost])


def _effect(
    random: np.random.Generator, effect: str, size: float, motion: Motion, k: int, time: Array
) -> dict[str, float]:
    """Parameters of an effect from 5 to 50 % of the torque's rms, in some directions of either sign."""
    position, velocity, _ = (each[:, k] for each in motion.at(time))
    travel, fastest = float(np.ptp(position)), float(np.abs(velocity).max())
    force, sign = size * _decades(random, 0.05, 0.5), float(random.choice([-1.0, 1.0]))
    if effect == "cable_spring":
        return {"stiffness": 2.0 * force / travel, "torque_at_zero": size * random.normal(0.0, 0.1)}
    if effect == "torque_ripple":
        phase = random.uniform(0.0, 2.0 * np.pi)
        end = RIPPLE * float(motion.rates[k].max()) / float(np.median(np.abs(velocity)))
        return {
            "cosine": force * np.cos(phase),
            "sine": force * np.sin(phase),
            "cosine_per_torque": random.normal(0.0, 0.025),
            "sine_per_torque": random.normal(0.0, 0.025),
            "order": random.uniform(2.0 * np.pi / travel, max(end, 4.0 * np.pi / travel)),
        }
    if effect in LAWS:
        found = {
            "coulomb_torque": force,
            "static_torque": force * random.uniform(1.2, 2.5),
            "stribeck_velocity": fastest * _decades(random, 0.05, 0.4),
        }
        if effect == "stribeck_friction":
            return found
        stiffness = force / (travel * _decades(random, *PRESLIDING))
        return {
            **found,
            "bristle_stiffness": stiffness,
            "bristle_damping": stiffness * _decades(random, *BUILDS_UP),
        }
    if effect == "asymmetric_friction":
        return {
            "coulomb_difference": size * random.normal(0.0, 0.1),
            "viscous_difference": sign * force / fastest,
        }
    if effect == "quadratic_drag":
        return {"coefficient": force / fastest**2}
    duration = random.uniform(0.5, 3.0)
    begin = random.uniform(0.1 * DURATION, 0.9 * DURATION - duration)
    return {"torque": sign * 2.0 * force, "start": begin, "duration": duration}


def _with_effect(
    effect: str, p: Mapping[str, float], time: Array, q: Array, v: Array, needed: Array
) -> Array:
    """Torque of the actuator with an effect, from that without, shape (N,)."""
    if effect == "cable_spring":
        return needed + p["stiffness"] * q - p["torque_at_zero"]
    if effect == "torque_ripple":  # proportional in part to the torque itself
        cosine, sine = np.cos(p["order"] * q), np.sin(p["order"] * q)
        share = 1.0 + p["cosine_per_torque"] * cosine + p["sine_per_torque"] * sine
        return (needed - p["cosine"] * cosine - p["sine"] * sine) / share
    if effect == "stribeck_friction":
        return needed + _level(p, v) * np.sign(v)
    if effect == "lugre_friction":
        return needed + _bristles(p, time, v)
    if effect == "asymmetric_friction":
        return needed + p["coulomb_difference"] * np.sign(v) ** 2 + p["viscous_difference"] * np.abs(v)
    if effect == "quadratic_drag":
        return needed + p["coefficient"] * np.abs(v) * v
    inside = (time > p["start"]) & (time < p["start"] + p["duration"])
    return needed - p["torque"] * inside


def _level(p: Mapping[str, float], v: Array) -> Array:
    """Friction of Stribeck's law at a speed."""
    above = (p["static_torque"] - p["coulomb_torque"]) * np.exp(-((v / p["stribeck_velocity"]) ** 2))
    return np.asarray(p["coulomb_torque"] + above)


def _bristles(p: Mapping[str, float], time: Array, v: Array) -> Array:
    """Friction of LuGre's law that opposes a velocity, starting as it slides, shape (N,).

    The deflection z follows z' = v - s0 |v| z / g(v), exactly for a constant speed within each step; the
    damping is passive at every speed (Barahanov and Ortega 2000).
    """
    stiffness, step = p["bristle_stiffness"], (time[1] - time[0]) / STEPS
    fine = time[0] + step * (np.arange((time.size - 1) * STEPS) + 0.5)
    speed = make_interp_spline(time, v, k=5)(fine)
    rest = _level(p, speed) / stiffness
    kept = np.exp(-np.abs(speed) * step / rest)
    bent = np.empty(fine.size + 1)
    bent[0] = _level(p, v[0]) / stiffness * np.sign(v[0])
    for k, (share, aim) in enumerate(zip(kept, np.sign(speed) * rest)):
        bent[k + 1] = aim + (bent[k] - aim) * share
    z, level = bent[::STEPS], _level(p, v)
    damping = p["bristle_damping"] / (1.0 + p["bristle_damping"] * np.abs(v) / (4.0 * level))
    return np.asarray(stiffness * z + damping * (v - stiffness * np.abs(v) * z / level))


def _robot(
    random: np.random.Generator, links: list[Link], gravity: float, encoder: float, torque_noise: Array
) -> Robot:
    """The robot file, whose numbers are off."""
    text = [
        f'name = "arm"\ngravity = [0.0, {-gravity}, 0.0]\n[base]\nkind = "fixed"'
        if gravity
        else 'name = "arm"\ngravity = [0.0, 0.0, -9.81]\n[base]\nkind = "fixed"'
    ]
    for j, link in enumerate(links):
        mass, centre, inertia, rotor = (
            value * (1.0 + FILE_ERROR * random.standard_normal())
            for value in (link.mass, link.centre, link.inertia, link.rotor)
        )
        name, parent = f"joint{j + 1}", "base" if j == 0 else f"link{j}"
        origin = 0.0 if j == 0 else links[j - 1].length
        text.append(
            f'[[links]]\nname = "link{j + 1}"\nmass = {mass}\ncenter_of_mass = [{centre}, 0.0, 0.0]\n'
            f"inertia = [{0.2 * inertia}, {inertia}, {inertia}]"
        )
        text.append(
            f'[[joints]]\nname = "{name}"\nkind = "revolute"\nparent = "{parent}"\nchild = "link{j + 1}"\n'
            f"origin = [{origin}, 0.0, 0.0]\naxis = [0.0, 0.0, 1.0]\n"
            f"[joints.actuator]\ngear_ratio = 1.0\nrotor_inertia = {rotor}\ntorque_limit = 1000.0"
        )
        text.append(f'[[sensors]]\nchannel = "{name}.position"\nnoise = {encoder}')
        text.append(f'[[sensors]]\nchannel = "{name}.torque"\nnoise = {torque_noise[j]}')
    return robot_from_toml("\n".join(text))
