"""Small robots with a beam."""

from __future__ import annotations

from typing import Any

from exudyn_robots import joint

from robot_model import Base, Beam, EffectUse, Joint, Link, Reference, Robot
from robot_model.description.flexible import StrainGauge, TipBody, Tube

__all__ = ["beam", "free_robot", "mast", "torque"]


def beam(**changes: Any) -> Beam:
    """An aluminium tube of 2 m with 3 kg at its tip."""
    given = {
        "length": 2.0,
        "section": Tube(outer_diameter=0.03, inner_diameter=0.026),
        "young": 70e9,
        "shear": 27e9,
        "density": 2700.0,
        "elements": 8,
        "modes": 2,
        "tip": TipBody(mass=3.0, inertia=(0.02, 0.01, 0.012)),
        "gauges": (StrainGauge(place=0.125, normal=(1.0, 0.0), distance=0.015),),
    }
    return Beam.model_validate({**given, **changes})


def mast(**changes: Any) -> Robot:
    """A beam welded to the ground, level, in a weak field across it."""
    given = {
        "name": "mast",
        "gravity": (0.0, 0.0, -0.02),
        "links": (Link(name="pole", beam=beam()),),
        "joints": (Joint(name="foot", kind="fixed", parent="base", child="pole", origin=(0.3, 0.1, 0.2)),),
        "reference": Reference(duration=0.25, sample_rate=200.0),
    }
    return Robot.model_validate({**given, **changes})


def free_robot(**changes: Any) -> Robot:
    """A free base, a rigid link and a beam on skew axes, with a hub on the beam's root."""
    given = {
        "name": "floater",
        "base": Base(kind="free", mass=60.0, inertia=(6.0, 7.0, 8.0), rpy=(0.1, -0.2, 0.3)),
        "links": (
            Link(name="upper", mass=4.0, center_of_mass=(0.5, 0.0, 0.0), inertia=(0.05, 0.4, 0.4)),
            Link(
                name="boom",
                mass=1.0,
                center_of_mass=(0.05, 0.01, 0.0),
                inertia=(0.01, 0.02, 0.02),
                beam=beam(),
            ),
        ),
        "joints": (
            joint("shoulder", child="upper", origin=(0.4, 0.0, 0.1), initial_velocity=0.2),
            joint(
                "elbow",
                parent="upper",
                child="boom",
                origin=(1.0, 0.0, 0.0),
                rpy=(0.2, 0.0, 0.1),
                axis=(0.0, 0.6, 0.8),
                initial_position=0.4,
            ),
        ),
        "reference": Reference(duration=0.15, sample_rate=100.0),
    }
    robot = Robot.model_validate({**given, **changes})
    return robot.with_effects(torque("shoulder", 1.5), torque("elbow", -1.0))


def torque(at: str, size: float) -> EffectUse:
    """A constant torque."""
    parameters = {"torque": size, "start": 0.0, "duration": 100.0}
    return EffectUse.model_validate({"effect": "external_torque", "at": at, **parameters})
