"""Small robots with known motion."""

from __future__ import annotations

from typing import Any

from robot_model import Actuator, Base, Joint, Link, Reference, Robot

GRAVITY = (0.0, 0.0, -9.81)


def pendulum(**changes: Any) -> Robot:
    """A point-like mass of 2 kg at 0.5 m on a horizontal axis, hanging down at position 0."""
    given = {
        "name": "pendulum",
        "gravity": GRAVITY,
        "links": (Link(name="rod", mass=2.0, center_of_mass=(0.0, 0.0, -0.5), inertia=(0.1, 0.1, 0.0)),),
        "joints": (joint("hinge", axis=(0.0, 1.0, 0.0)),),
        "reference": Reference(duration=1.0, sample_rate=200.0),
    }
    return Robot.model_validate({**given, **changes})


def cart(**changes: Any) -> Robot:
    """A mass of 3 kg on a horizontal slide, without gravity."""
    given = {
        "name": "cart",
        "links": (Link(name="body", mass=3.0),),
        "joints": (joint("slide", kind="prismatic", child="body", axis=(1.0, 0.0, 0.0)),),
        "reference": Reference(duration=1.0, sample_rate=200.0),
    }
    return Robot.model_validate({**given, **changes})


def joint(name: str, **changes: Any) -> Joint:
    """A driven revolute joint from the base."""
    given = {"name": name, "parent": "base", "child": "rod", "actuator": Actuator()}
    return Joint.model_validate({**given, **changes})


def tumbling_robot(**changes: Any) -> Robot:
    """A free base with two skew joints, a slide among them, a welded part and a geared rotor."""
    given = {
        "name": "tumbler",
        "base": Base(
            kind="free",
            mass=40.0,
            inertia=(3.0, 4.0, 5.0, 0.2, -0.1, 0.3),
            center_of_mass=(0.1, 0.0, 0.05),
            position=(1.0, 2.0, 3.0),
            rpy=(0.3, -0.4, 0.5),
        ),
        "links": (
            Link(name="upper", mass=8.0, center_of_mass=(0.4, 0.02, 0.0), inertia=(0.1, 0.5, 0.5)),
            Link(
                name="lower",
                mass=6.0,
                center_of_mass=(0.3, 0.0, 0.03),
                inertia=(0.1, 0.4, 0.35, 0.01, 0.02, 0),
            ),
            Link(name="tool", mass=1.0, center_of_mass=(0.1, 0.0, 0.0), inertia=(0.01, 0.02, 0.02)),
            Link(name="rail", mass=2.0, inertia=(0.02, 0.02, 0.02)),
        ),
        "joints": (
            joint(
                "elbow",
                parent="upper",
                child="lower",
                origin=(0.8, 0.0, 0.0),
                rpy=(-0.3, 0.5, 0.1),
                axis=(1.0, 0.0, 1.0),
                initial_velocity=-3.0,
                initial_position=0.3,
            ),
            joint(
                "shoulder",
                child="upper",
                origin=(0.5, 0.0, 0.1),
                rpy=(0.3, 0.2, 0.1),
                axis=(0.0, 1.0, 1.0),
                initial_velocity=2.0,
                actuator=Actuator(rotor_inertia=1e-4, gear_ratio=50.0),
            ),
            joint(
                "weld",
                kind="fixed",
                parent="lower",
                child="tool",
                origin=(0.6, 0.1, 0.0),
                rpy=(0.2, 0.1, 0.0),
            ),
            joint(
                "slide",
                kind="prismatic",
                parent="tool",
                child="rail",
                axis=(0.0, 0.3, 1.0),
                initial_velocity=0.2,
            ),
        ),
        "reference": Reference(duration=1.0, sample_rate=100.0),
    }
    return Robot.model_validate({**given, **changes})
