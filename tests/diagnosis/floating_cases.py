"""A free-floating rigid arm for the tests of base sensors."""

from __future__ import annotations

from robot_model import Robot

GYRO = ("base.angular_velocity.x", "base.angular_velocity.y", "base.angular_velocity.z")


def flyer(duration: float = 30.0, *, joints: int = 2, base: tuple[float, float] = (300.0, 70.0)) -> Robot:
    """A free base (mass, inertia) with an arm of rigid links, multi-sines at its joints, noisy sensors."""
    links = ("link1", "link2")[:joints]
    return Robot.model_validate(
        {
            "name": "flyer",
            "base": {"kind": "free", "mass": base[0], "inertia": [base[1]] * 3},
            "links": [
                {
                    "name": "link1",
                    "mass": 30.0,
                    "center_of_mass": [1.5, 0.0, 0.0],
                    "inertia": [1.0, 20.0, 20.0],
                },
                {
                    "name": "link2",
                    "mass": 20.0,
                    "center_of_mass": [2.5, 0.1, 0.0],
                    "inertia": [1.0, 30.0, 30.0],
                },
            ][:joints],
            "joints": [
                {
                    "name": f"joint{k + 1}",
                    "parent": parent,
                    "child": link,
                    "origin": origin,
                    "axis": axis,
                    "actuator": {"gear_ratio": 100.0, "rotor_inertia": 2e-5},
                }
                for k, (parent, link, origin, axis) in enumerate(
                    zip(
                        ("base", "link1"),
                        links,
                        ([1.0 if joints > 1 else 0.0, 0.0, 0.3], [3.0, 0.0, 0.0]),
                        ([0, 0, 1.0], [0, 0.6, 0.8]),
                    )
                )
            ],
            "sensors": [
                *({"channel": f"joint{k + 1}.position", "noise": 2e-6} for k in range(joints)),
                *({"channel": f"joint{k + 1}.torque", "noise": 0.02} for k in range(joints)),
                *({"channel": channel, "noise": 2e-6} for channel in GYRO),
            ],
            "effects": [
                {"effect": "viscous_friction", "at": f"joint{k + 1}", "coefficient": 4.0}
                for k in range(joints)
            ],
            "controller": {
                "kind": "pd",
                "kp": [4000.0] * joints,
                "kd": [800.0] * joints,
            },
            "reference": {
                "duration": duration,
                "sample_rate": 100.0,
                "joints": [
                    {
                        "joint": f"joint{k + 1}",
                        "kind": "multisine",
                        "amplitudes": [0.5, 0.15],
                        "frequencies": [0.11 + 0.04 * k, 0.31 + 0.05 * k],
                    }
                    for k in range(joints)
                ],
            },
        }
    )
