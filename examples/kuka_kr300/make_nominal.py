"""Make `nominal.toml` and `published.toml` of the KUKA KR300 R2500 Ultra from the published figures.

Run ``python examples/kuka_kr300/make_nominal.py`` in the repository; it writes beside itself.

Source: J. Weigand, G. Kanagalingam, S. Harttig, University of Kaiserslautern,
github.com/JonasWeigand/Robot_Identification, commit 9e403c07d9dadbb391a9f3921e8d219f714636a8,
``robot_model/model_KUKA_Quantec_Ultra_KR300.m`` (figures) and ``ident_functions/robot_dynamics.m``
(start pose, signs). They describe the arm by standard Denavit-Hartenberg parameters, whose link frame i sits
at the link's far end:

    T_i = RotZ(q_i + offset_i) TransZ(d_i) TransX(a_i) RotX(alpha_i)

Here a link's frame sits at its own joint, after RotZ(q_i). So joint i+1 has its origin at [a_i, 0, d_i] and
is turned by RotX(alpha_i) RotZ(offset_{i+1}) in the frame of link i; a centre of mass r_i and an inertia
tensor I_i of the far frame become [a_i, 0, d_i] + RotX(alpha_i) r_i and RotX(alpha_i) I_i RotX(alpha_i)^T.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from robot_model import Actuator, Base, EffectUse, Joint, Link, Robot, save_robot

__all__ = ["AXES", "Axis", "main", "robot"]

#: Payload and the sixth link, each with its centre of mass along the sixth frame's z [kg, m].
PAYLOAD = (200.0, 0.100)
SIXTH_LINK = (17.78, -0.050)

#: Digits kept in the robot files.
DIGITS = 10


@dataclass(frozen=True)
class Axis:
    """Published figures of one axis, in SI units.

    Attributes:
        d, a, alpha, offset: Denavit-Hartenberg parameters [m, m, rad, rad].
        mass: of the link [kg].
        centre: its centre of mass in the far frame [m].
        inertia: about it, xx yy zz xy yz xz, in the far frame's axes [kg m^2].
        rotor: motor inertia [kg m^2], motor side.
        gear: motor turns per joint turn.
        viscous: viscous friction [N m s/rad], motor side.
        coulomb: Coulomb friction [N m], motor side.
        limits: lowest and highest position [rad].
        start: position at the start of the recordings [rad].
    """

    d: float
    a: float
    alpha: float
    offset: float
    mass: float
    centre: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]
    rotor: float
    gear: float
    viscous: float
    coulomb: float
    limits: tuple[float, float]
    start: float


def _sixth_centre() -> float:
    (payload, at), (own, own_at) = PAYLOAD, SIXTH_LINK
    return (payload * at + own * own_at) / (payload + own)


AXES = (
    Axis(
        d=-0.675,
        a=0.350,
        alpha=pi / 2,
        offset=0.0,
        mass=395.40,
        centre=(-0.353, 0.174, -0.004),
        inertia=(16.733765, 29.799119, 32.814954, -1.703664, 0.129384, 4.404062),
        rotor=0.00923,
        gear=1798 / 7,
        viscous=0.001476346,
        coulomb=0.73192436,
        limits=(radians(-147), radians(147)),
        start=0.0,
    ),
    Axis(
        d=-0.189,
        a=1.15,
        alpha=0.0,
        offset=0.0,
        mass=339.12,
        centre=(-0.709, -0.001, 0.023),
        inertia=(7.507819, 88.886691, 88.673761, 0.430046, 0.173157, -4.396607),
        rotor=0.0118,
        gear=1872 / 7,
        viscous=0.010681832,
        coulomb=1.832264957,
        limits=(radians(-140), radians(-5)),
        start=-pi / 2,
    ),
    Axis(
        d=0.189,
        a=0.041,
        alpha=-pi / 2,
        offset=pi / 2,
        mass=105.21,
        centre=(-0.018, -0.018, -0.076),
        inertia=(10.783798, 10.186135, 1.943179, 0.118474, -0.606384, -0.101950),
        rotor=0.0118,
        gear=757 / 3,
        viscous=0.08398663,
        coulomb=1.862615588,
        limits=(radians(-112), radians(153)),
        start=pi / 2,
    ),
    Axis(
        d=-1.0,
        a=0.0,
        alpha=pi / 2,
        offset=0.0,
        mass=35.80,
        centre=(0.0, 0.236, 0.001),
        inertia=(0.425035, 0.217993, 0.428465, -0.000004, -0.011353, -0.000027),
        rotor=0.00173,
        gear=221.0,
        viscous=0.001916077,
        coulomb=0.447963801,
        limits=(radians(-350), radians(350)),
        start=0.0,
    ),
    Axis(
        d=0.0,
        a=0.0,
        alpha=-pi / 2,
        offset=0.0,
        mass=31.46,
        centre=(0.0, -0.080, -0.009),
        inertia=(0.283826, 0.229562, 0.258266, -0.000004, -0.019521, -0.000120),
        rotor=0.00173,
        gear=5032 / 21,
        viscous=0.001629877,
        coulomb=0.413155803,
        limits=(radians(-122.5), radians(122.5)),
        start=0.0,
    ),
    Axis(
        d=-0.24,
        a=0.0,
        alpha=pi,
        offset=0.0,
        mass=PAYLOAD[0] + SIXTH_LINK[0],
        centre=(0.0, 0.0, _sixth_centre()),
        inertia=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        rotor=0.00173,
        gear=206793 / 1340,
        viscous=0.002205322,
        coulomb=0.372594817,
        limits=(radians(-350), radians(350)),
        start=0.0,
    ),
)


def robot(*, friction: bool) -> Robot:
    """The arm with its 200 kg payload, standing on the ground; with or without the published friction."""
    return Robot(
        name="kuka_kr300_published" if friction else "kuka_kr300_nominal",
        description=(
            "KUKA KR300 R2500 Ultra with 200 kg payload, figures of Weigand, Kanagalingam and Harttig, "
            + ("friction included; " if friction else "rigid and without friction; ")
            + "the hydraulic counterbalance of axis 2 is not in it"
        ),
        gravity=(0.0, 0.0, -9.81),
        base=Base(rpy=(pi, 0.0, 0.0)),
        links=tuple(_link(index) for index in range(len(AXES))),
        joints=tuple(_joint(index) for index in range(len(AXES))),
        effects=tuple(_friction()) if friction else (),
    )


def _link(index: int) -> Link:
    axis = AXES[index]
    turn = Rotation.from_euler("x", axis.alpha).as_matrix()
    xx, yy, zz, xy, yz, xz = axis.inertia
    tensor = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
    centre = np.array([axis.a, 0.0, axis.d]) + turn @ np.array(axis.centre)
    return Link(
        name=f"link{index + 1}",
        mass=axis.mass,
        center_of_mass=_vector(centre),
        inertia=_rounded(tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]),
    )


def _joint(index: int) -> Joint:
    axis = AXES[index]
    inboard = AXES[index - 1] if index else None
    turn = Rotation.from_euler("z", axis.offset)
    if inboard is not None:
        turn = Rotation.from_euler("x", inboard.alpha) * turn
    return Joint(
        name=f"joint{index + 1}",
        parent=f"link{index}" if index else "base",
        child=f"link{index + 1}",
        origin=(inboard.a, 0.0, inboard.d) if inboard is not None else (0.0, 0.0, 0.0),
        rpy=_vector(turn.as_euler("xyz")),
        initial_position=axis.start,
        position_limits=axis.limits,
        actuator=Actuator(gear_ratio=axis.gear, rotor_inertia=axis.rotor),
    )


def _friction() -> list[EffectUse]:
    """Motor-side friction at the joint: torque grows by the gear ratio, a coefficient by its square."""
    uses = []
    for number, axis in enumerate(AXES, start=1):
        viscous, coulomb = axis.viscous * axis.gear**2, axis.coulomb * axis.gear
        laws = {"viscous_friction": {"coefficient": viscous}, "coulomb_friction": {"torque": coulomb}}
        for law, parameters in laws.items():
            rounded = {name: round(value, DIGITS) for name, value in parameters.items()}
            uses.append(EffectUse.model_validate({"effect": law, "at": f"joint{number}", **rounded}))
    return uses


def _vector(values: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = _rounded(values)
    return x, y, z


def _rounded(values: NDArray[np.float64]) -> tuple[float, ...]:
    return tuple(round(float(value), DIGITS) + 0.0 for value in values)  # + 0.0 makes -0.0 positive


def main() -> None:
    """Write both robot files beside this script."""
    here = Path(__file__).parent
    save_robot(robot(friction=False), here / "nominal.toml")
    save_robot(robot(friction=True), here / "published.toml")


if __name__ == "__main__":
    main()
