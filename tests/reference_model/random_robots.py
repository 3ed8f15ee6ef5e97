"""Random trees of rigid bodies and random states of them, for the tests of the reference model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

from reference_model.evaluation.model import RobotModel
from reference_model.passive.base_motion import BaseMotion
from robot_model import Robot


@dataclass(frozen=True)
class Case:
    """A model and N states of it; `base` is None for a fixed base."""

    model: RobotModel
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    base: BaseMotion | None

    @property
    def motion(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.position, self.velocity, self.acceleration

    @property
    def generalised_acceleration(self) -> np.ndarray:
        if self.base is None:
            return self.acceleration
        return np.hstack([self.base.linear_acceleration, self.base.angular_acceleration, self.acceleration])


def random_mass(rng: np.random.Generator) -> dict:
    """A body made of eight random point masses, so that its inertia is physical."""
    masses, points = rng.uniform(0.1, 1.0, 8), rng.normal(0, 0.3, (8, 3))
    centre = masses @ points / masses.sum()
    arms = points - centre
    inertia = sum(m * (a @ a * np.eye(3) - np.outer(a, a)) for m, a in zip(masses, arms))
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return {
        "mass": float(masses.sum()),
        "center_of_mass": tuple(centre.tolist()),
        "inertia": tuple(float(inertia[pair]) for pair in pairs),
    }


def random_robot(
    seed: int, *, base: str, kinds: list[str], gravity: bool = True, rotors: bool = True, **more
) -> Robot:
    """A tree in which every link hangs on a random earlier body; `kinds` has one kind per joint."""
    rng = np.random.default_rng(seed)
    links = [{"name": f"link{k}", **random_mass(rng)} for k in range(len(kinds))]
    joints = [
        {
            "name": f"joint{k}",
            "kind": kind,
            "parent": (["base"] + [link["name"] for link in links[:k]])[rng.integers(0, k + 1)],
            "child": f"link{k}",
            "origin": tuple(rng.normal(0, 0.4, 3).tolist()),
            "rpy": tuple(rng.uniform(-3, 3, 3).tolist()),
            "axis": tuple(rng.normal(size=3).tolist()),
            "actuator": {"gear_ratio": 10.0, "rotor_inertia": float(rng.uniform(0, 0.01)) if rotors else 0.0},
        }
        for k, kind in enumerate(kinds)
    ]
    order = rng.permutation(len(joints))  # the file's order need not be the tree's
    return Robot.model_validate(
        {
            "name": "random",
            "gravity": tuple(rng.normal(0, 5, 3).tolist()) if gravity else (0.0, 0.0, 0.0),
            "base": {"kind": base, **random_mass(rng), "rpy": tuple(rng.uniform(-1, 1, 3).tolist())},
            "links": links,
            "joints": [joints[k] for k in order],
            **more,
        }
    )


def random_case(robot: Robot, seed: int, samples: int = 4) -> Case:
    rng = np.random.default_rng(seed)
    model = RobotModel(robot)
    motion = rng.normal(size=(3, samples, len(model.joints)))
    base = (
        BaseMotion(rng.normal(size=(samples, 4)), *rng.normal(size=(4, samples, 3)))
        if model.free_base
        else None
    )
    return Case(model, *motion, base)


@st.composite
def cases(draw: st.DrawFn, *, base: tuple[str, ...] = ("fixed", "free")) -> Case:
    kinds = draw(
        st.lists(st.sampled_from(["revolute", "revolute", "prismatic", "fixed"]), min_size=1, max_size=6)
    )
    if "revolute" not in kinds and "prismatic" not in kinds:
        kinds[-1] = "revolute"
    seed = draw(st.integers(0, 2**32 - 1))
    return random_case(random_robot(seed, base=draw(st.sampled_from(base)), kinds=kinds), seed + 1)
