"""The section on other formats and overlays of the page of robot files."""

from __future__ import annotations

__all__ = ["other_formats"]

#: Content of a URDF or MJCF file, and its counterpart in the robot.
ROWS = (
    (
        "links fixed to one another (fixed joints, bodies without joints)",
        "one link, named after the one that moves",
    ),
    (
        "root link, ground, `worldbody`",
        "`base`; a `floating` joint of the root or a `freejoint` makes it a free base",
    ),
    ("several joints in one body", "massless links between them, named `JOINT_link`"),
    (
        "link without `<inertial>`, unless fixed to one that has mass",
        "an error that names the link; an overlay may give its mass",
    ),
    (
        "inertia that no body can have",
        "an error with the nearest possible inertia, ready for an overlay",
    ),
    (
        "mass that MuJoCo would compute from a mesh",
        "an error that names the body; an overlay may give its mass",
    ),
    (
        "`damping`, `friction` or `frictionloss`, `stiffness` with `springref`",
        "effects that the robot already has: `viscous_friction`, `coulomb_friction`, `cable_spring`",
    ),
    (
        "`armature`",
        "`rotor_inertia` at the joint side; converted to the motor side if an overlay gives a `gear_ratio`",
    ),
    (
        "`<limit>`, `range`, `effort`, `forcerange`, `ctrlrange` of motors",
        "`position_limits`, `velocity_limit`, `torque_limit`",
    ),
    ("`mechanicalReduction` of a transmission", "`gear_ratio`"),
    (
        "`DifferentialTransmission` and `FourBarLinkageTransmission` of ros_control and ros2_control",
        "a transmission; its actuators are motors, their reductions `gear_ratio`",
    ),
    ("joints of an MJCF file without an actuator, where others have one", "passive joints"),
    ("mimic joints, joints coupled by an equality", "held at their initial position"),
    (
        "fixed tendons with one actuator each, as many as their joints, which nothing else drives",
        "a transmission; the tendons are its motors' motion behind their gears",
    ),
    ("other equalities and tendons, servo gains, `gravcomp`, fluid forces", "ignored"),
    ("`planar`, `ball` and inner floating joints, `attach`, `replicate`, `composite`", "an error"),
)

INTRODUCTION = """\
## URDF, xacro and MJCF files, and overlays

A robot may also be a URDF, xacro or MJCF (MuJoCo) file. It is read as the tree of rigid bodies that it
describes; its dynamics agree with those of Pinocchio and MuJoCo to rounding. Links and joints keep their
names, and channels are named after them: `shoulder_pan_joint.position`. Assumptions, changed names and
ignored content are reported once on stderr.

Meshes are never opened, so that missing ones and `package://` addresses cause no errors. Declared XML
entities are refused. An MJCF file may include others inside its own folder; a xacro file may read others
inside its package and packages that it finds (`$(find NAME)`: around the file, or in folders listed in
`ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH`). Expressions of xacro are computed without Python's `eval`.

A URDF gives no gravity: 9.81 m/s^2 along -z of the root link is assumed, and a fixed base.
"""

OVERLAYS = """\
Values that a format cannot hold go into an overlay, a TOML file with the keys of this page. `--overlay FILE`
names it; without that, `arm.overlay.toml` next to `arm.urdf` is used if it exists. An overlay can be applied
to a TOML file or a shipped robot in the same way.

```toml
gravity = [0.0, 0.0, -9.81]

[[joints]]
name = "shoulder_pan_joint"
actuator = { gear_ratio = 101.0, rotor_inertia = 1.1e-5, torque_constant = 0.07 }
bearing = { radial_arm = 0.03 }

[[joints]]
name = "finger_joint"
kind = "fixed"            # held at initial_position: not recorded
initial_position = 0.02

[[joints]]
name = "wheel_joint"
passive = true            # nothing drives it

[[links]]
name = "wrist_link"
mass = 0.35               # changes this value only

[[sensors]]
channel = "shoulder_pan_joint.position"
noise = 1e-5

[controller]
kind = "pd"
kp = 400.0
kd = 20.0

[reference]
duration = 5.0
```

Arguments of a xacro file are given in a separate table:

```toml
[xacro]
ur_type = "ur5e"
name = "ur"
```

Tables of `links` and `joints` are matched by name, either that of the file or that of the robot, and their
keys are merged; so are those of `[base]`. An entry of `sensors` replaces the one of the same channel, one of
`effects` the one of the same effect and place, or else is added; `effects = []` drops all effects of the
file. Every other key replaces the existing one. A name that the robot does not have is an error.
"""


def other_formats() -> str:
    """The section in Markdown."""
    table = [
        "| in the file | in the robot |",
        "|---|---|",
        *(f"| {there} | {here} |" for there, here in ROWS),
    ]
    return "\n".join([INTRODUCTION, *table, "", OVERLAYS])
