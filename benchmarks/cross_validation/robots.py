"""Robots of the cross-validation: small, without symmetries that could hide a term."""

from __future__ import annotations

from typing import Any

from benchmarks.cross_validation.meshes import mesh_file
from robot_model import Actuator, Base, Beam, Bearing, EffectUse, Joint, Link, Reference, Robot
from robot_model.description.flexible import ModalBody, Rectangle, StrainGauge, TipBody, Tube

__all__ = [
    "EARTH",
    "ROBOTS",
    "ball_robot",
    "chain",
    "coupled",
    "flexible",
    "imported",
    "rigid",
    "round_robot",
    "slide_robot",
    "stiffening",
    "use",
]

#: Gravity of an arm on the ground [m/s^2]; not along any axis.
EARTH = (0.6, -0.4, -9.7)

BEARING = Bearing(radial_arm=0.05, axial_arm=0.04, span=0.2)
MOTOR = Actuator(gear_ratio=50.0, rotor_inertia=1e-4, torque_constant=0.05, resistance=0.5)
SECOND_MOTOR = Actuator(gear_ratio=30.0, rotor_inertia=2e-4, torque_constant=0.08, resistance=0.8)
FREE_BASE = Base(
    kind="free",
    mass=40.0,
    inertia=(3.0, 4.0, 5.0, 0.2, -0.1, 0.3),
    center_of_mass=(0.1, 0.02, 0.05),
    position=(0.3, -0.2, 0.5),
    rpy=(0.3, -0.4, 0.5),
)
FIXED_BASE = Base(position=(0.3, -0.2, 0.5), rpy=(0.3, -0.4, 0.5))
FLAT_BASE = Base(kind="free", mass=40.0, inertia=(3.0, 4.0, 5.0), center_of_mass=(0.1, 0.02, 0.0))
UPPER = Link(
    name="upper", mass=8.0, center_of_mass=(0.4, 0.02, 0.01), inertia=(0.1, 0.5, 0.55, 0.01, 0.02, 0.03)
)
LOWER = Link(
    name="lower", mass=5.0, center_of_mass=(0.3, 0.03, -0.02), inertia=(0.08, 0.4, 0.35, 0.01, 0.02, 0.01)
)
FLAT = {
    "upper": Link(name="upper", mass=8.0, center_of_mass=(0.4, 0.02, 0.0), inertia=(0.1, 0.5, 0.55)),
    "lower": Link(name="lower", mass=5.0, center_of_mass=(0.3, 0.03, 0.0), inertia=(0.08, 0.4, 0.35)),
}


def use(effect: str, at: str, **parameters: float) -> EffectUse:
    """An effect at a place."""
    return EffectUse.model_validate({"effect": effect, "at": at, **parameters})


def rigid(*, base: str = "free", geometry: str = "spatial", **changes: Any) -> Robot:
    """Two rigid links; on skew axes, or in a plane."""
    flat = geometry == "planar"
    links = (FLAT["upper"], FLAT["lower"]) if flat else (UPPER, LOWER)
    given: dict[str, Any] = {
        "name": f"rigid_{geometry}_{base}",
        "base": _base(base, flat),
        "gravity": EARTH if base == "fixed" and not flat else (0.0, -9.7 if base == "fixed" else 0.0, 0.0),
        "links": links,
        "joints": _joints("lower", flat),
        "reference": Reference(duration=0.1, sample_rate=100.0),
    }
    return Robot.model_validate({**given, **changes})


def flexible(*, base: str = "free", geometry: str = "spatial", modes: int = 3, **changes: Any) -> Robot:
    """The same with a flexible second link: a rectangular section, a hub, and a body at the tip."""
    flat = geometry == "planar"
    beam = Beam(
        length=1.5,
        section=Rectangle(width=0.02, height=0.014),
        young=70e9,
        shear=27e9,
        density=2700.0,
        elements=6,
        modes=modes,
        damping_ratio=0.01,
        tip=TipBody(mass=1.5, inertia=(0.004, 0.003, 0.005)),
        gauges=(
            StrainGauge(place=0.125, normal=(1.0, 0.0), distance=0.007),
            StrainGauge(place=0.125, normal=(0.0, 1.0), distance=0.01),
        ),
    )
    center = (0.05, 0.01, 0.0) if flat else (0.05, 0.01, 0.005)
    lower = Link(name="lower", mass=1.0, center_of_mass=center, inertia=(0.01, 0.02, 0.02), beam=beam)
    given: dict[str, Any] = {
        "name": f"flexible_{geometry}_{base}",
        "base": _base(base, flat),
        "gravity": (0.06, -0.04, -0.5) if base == "fixed" and not flat else (0.0, 0.0, 0.0),
        "links": (FLAT["upper"] if flat else UPPER, lower),
        "joints": _joints("lower", flat),
        "reference": Reference(duration=0.1, sample_rate=100.0),
    }
    return Robot.model_validate({**given, **changes})


def slide_robot(**changes: Any) -> Robot:
    """A free base with two branches: a slide with a tool welded askew, and a hinge."""
    robot = rigid(**changes)
    tool = Link(name="tool", mass=1.0, center_of_mass=(0.1, 0.03, 0.0), inertia=(0.01, 0.02, 0.025))
    rail = Link(name="rail", mass=2.0, center_of_mass=(0.02, 0.0, 0.1), inertia=(0.03, 0.02, 0.02))
    more = (
        Joint(
            name="weld", kind="fixed", parent="rail", child="tool", origin=(0.6, 0.1, 0), rpy=(0.2, 0.1, 0)
        ),
        Joint(
            name="slide",
            kind="prismatic",
            parent="upper",
            child="rail",
            origin=(0.3, 0.1, -0.1),
            rpy=(0.4, -0.2, 0.7),
            axis=(0.0, 0.3, 1.0),
            actuator=Actuator(gear_ratio=20.0, rotor_inertia=1e-3),
            bearing=BEARING,
        ),
    )
    return robot.model_copy(
        update={
            "name": "branched_with_slide_free",
            "links": (*robot.links, tool, rail),
            "joints": (*robot.joints[::-1], *more),
        }
    )


def ball_robot() -> Robot:
    """A flexible link on a ball joint, free base."""
    robot = flexible()
    ball = robot.joints[1].model_copy(update={"kind": "spherical", "actuator": None, "bearing": None})
    return robot.model_copy(update={"name": "flexible_with_ball_free", "joints": (robot.joints[0], ball)})


def chain(*, inner: str = "clamped", outer: str = "clamped", place: float = 1.0, **changes: Any) -> Robot:
    """Two flexible links in a row, the second one's joint on a node of the first that moves and turns.

    Boundaries are those of the links' modes; with free ones the root moves in the link's frame, too.
    """
    robot = flexible(**changes)
    lower = robot.links[1]
    assert lower.beam is not None
    tip = TipBody(mass=0.5, inertia=(0.01, 0.012, 0.011))
    first = lower.beam.model_copy(update={"boundary": inner, "tip": tip})
    upper = UPPER.model_copy(update={"mass": 1.0, "inertia": (0.1, 0.2, 0.2), "beam": first})
    second = lower.beam.model_copy(update={"boundary": outer})
    joint = robot.joints[1].model_copy(update={"origin": (place, 0.0, 0.0)})
    return robot.model_copy(
        update={
            "name": f"two_flexible_{inner}_{outer}_{robot.base.kind}",
            "links": (upper, lower.model_copy(update={"beam": second})),
            "joints": (robot.joints[0], joint),
        }
    )


def imported(mesh: str, *, boundary: str = "clamped", base: str = "free", modes: int = 4) -> Robot:
    """The arm whose second link comes from a file of finite elements, with a light tool on a node."""
    robot = flexible(base=base)
    roots: int | tuple[int, ...] = (0, 1, 2, 3) if mesh == "lattice" and boundary == "clamped" else 0
    place, tip = ((0.75, 0.2, 0.25), 18) if mesh == "lattice" else ((1.0, 0.0, 0.0), 8)
    body = ModalBody(
        file=mesh_file(mesh), modes=modes, boundary=boundary, damping_ratio=0.01, root=roots, tip=tip
    )
    lower = robot.links[1].model_copy(update={"beam": None, "modal": body})
    tool = Link(name="tool", mass=0.4, center_of_mass=(0.1, 0.03, 0.0), inertia=(0.002, 0.004, 0.005))
    wrist = Joint(name="wrist", parent="lower", child="tool", origin=place, rpy=(0.2, 0.1, 0.3))
    return robot.model_copy(
        update={
            "name": f"imported_{mesh}_{boundary}_{base}",
            "links": (robot.links[0], lower, tool),
            "joints": (*robot.joints, wrist),
        }
    )


def stiffening(robot: Robot) -> Robot:
    """The robot with beams that stiffen."""
    links = tuple(
        link.model_copy(update={"beam": link.beam.model_copy(update={"stiffening": True})})
        if link.beam
        else link
        for link in robot.links
    )
    return robot.model_copy(update={"name": f"{robot.name}_stiffening", "links": links})


def round_robot() -> Robot:
    """The flexible arm with a tube, whose modes come in pairs of equal frequency."""
    robot = flexible(modes=4)
    lower = robot.links[1]
    assert lower.beam is not None
    tube = Tube(outer_diameter=0.02, inner_diameter=0.014)
    beam = lower.beam.model_copy(update={"section": tube, "tip": TipBody(mass=1.5)})
    links = (robot.links[0], lower.model_copy(update={"beam": beam}))
    return robot.model_copy(update={"name": "flexible_tube_free", "links": links})


def _base(kind: str, flat: bool) -> Base:
    if kind == "free":
        return FLAT_BASE if flat else FREE_BASE
    return Base(position=(0.3, -0.2, 0.5)) if flat else FIXED_BASE


def coupled(robot: Robot) -> Robot:
    """The robot with `shoulder` and `elbow` on two motors, `one` and `two`, that each move both."""
    text = robot.model_dump()
    motors = []
    for joint, name in zip(text["joints"], ("one", "two")):
        motors.append({**joint["actuator"], "name": name})
        joint["actuator"] = None
    matrix = ((0.6, 0.5), (-0.4, 0.9))
    both = {"name": "gears", "joints": ("shoulder", "elbow"), "motors": motors, "matrix": matrix}
    return Robot.model_validate({**text, "name": f"{robot.name}_coupled", "transmissions": [both]})


def _joints(child: str, flat: bool) -> tuple[Joint, ...]:
    first = {"origin": (0.5, 0.05, 0.0), "axis": (0.0, 0.0, 1.0)}
    second = {"origin": (0.8, 0.0, 0.0), "axis": (0.0, 0.0, 1.0)}
    if not flat:
        first |= {"origin": (0.5, 0.05, 0.1), "rpy": (0.3, 0.2, 0.1), "axis": (0.0, 1.0, 1.0)}
        second |= {"origin": (0.8, 0.02, 0.03), "rpy": (-0.3, 0.5, 0.1), "axis": (1.0, 0.0, 1.0)}
    return (
        Joint(name="shoulder", parent="base", child="upper", actuator=MOTOR, bearing=BEARING, **first),
        Joint(name="elbow", parent="upper", child=child, actuator=SECOND_MOTOR, bearing=BEARING, **second),
    )


#: Robots whose equations are compared at random states.
ROBOTS: tuple[Robot, ...] = (
    *(
        rigid(base=base, geometry=geometry)
        for base in ("fixed", "free")
        for geometry in ("planar", "spatial")
    ),
    slide_robot(),
    *(flexible(base=base, geometry=geo) for base in ("fixed", "free") for geo in ("planar", "spatial")),
    round_robot(),
    ball_robot(),
    chain(),
    chain(base="fixed", inner="free", outer="free", place=1.5),
    stiffening(flexible(base="fixed")),
    stiffening(chain()),
    imported("frame"),
    imported("frame", boundary="free", base="fixed"),
    imported("lattice"),
    imported("lattice", boundary="free"),
)
