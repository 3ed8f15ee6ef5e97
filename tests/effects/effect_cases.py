"""Shared parts of the tests of effects: motions, parameter values, evaluation at a point."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.effects.base import (
    BodyEffect,
    Effect,
    GearEffect,
    JointEffect,
    JointSignals,
    SensorEffect,
)
from reference_model.effects.catalogue import catalogue

Array = NDArray[np.float64]

JOINT = [e for e in catalogue().values() if isinstance(e, JointEffect)]
SENSOR = [e for e in catalogue().values() if isinstance(e, SensorEffect)]
GEAR = [e for e in catalogue().values() if isinstance(e, GearEffect)]
BODY = [e for e in catalogue().values() if isinstance(e, BodyEffect)]

#: Radial and axial arm [m] of a bearing for tests.
ARMS = (0.05, 0.08)


def named(effect: Effect) -> str:
    """Test id."""
    return effect.id


def typical(effect: Effect, **changes: float) -> dict[str, float]:
    """Defaults, or typical values where there is none."""
    values = {p.name: p.typical if p.default is None else p.default for p in effect.parameters}
    # Windows and stops of the size of the motion below, so that they act within it.
    values.update({"external_torque": {"start": 0.7}, "end_stop": {"position": 0.3}}.get(effect.id, {}))
    return {**values, **changes}


def at_point(
    effect: JointEffect,
    parameters: Mapping[str, float],
    *,
    states: tuple[float, ...] = (),
    transition: float = 1e-4,
    **signals: float,
) -> float:
    """Contribution at one instant; signals left out are zero."""
    values = {name: ca.SX(signals.get(name, 0.0)) for name in JointSignals.CHANNELS}
    s: Any = JointSignals(**values, gear_ratio=100.0, bearing_arms=ARMS, transition=transition)
    return float(ca.evalf(ca.SX(effect.torque(s, {**effect.defaults(), **parameters}, ca.SX(list(states))))))


def motion(samples: int = 400, duration: float = 2.0, seed: int = 1) -> Array:
    """Signals along a smooth motion with reversals, shape (samples, 11)."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, duration, samples)
    phases = rng.uniform(0, 2 * np.pi, 3)
    rates = 2 * np.pi * np.array([0.5, 1.3, 2.1])
    sizes = np.array([0.5, 0.1, 0.02])
    signals = np.zeros((samples, len(JointSignals.CHANNELS)))
    signals[:, 0] = t
    signals[:, 1] = np.sin(np.outer(t, rates) + phases) @ sizes
    signals[:, 2] = np.cos(np.outer(t, rates) + phases) @ (sizes * rates)
    signals[:, 3] = -np.sin(np.outer(t, rates) + phases) @ (sizes * rates**2)
    signals[:, 4] = 10 * signals[:, 3] + 3 * np.sin(signals[:, 1])
    signals[:, 5] = -5 * np.tanh(signals[:, 2] / 1e-3)
    signals[:, 6:10] = 20 + rng.normal(size=4) * np.abs(signals[:, 3:4])
    signals[:, 10] = 293.15 + 20 * t / duration
    return signals
