"""Hypothesis strategies for robots: trees of any shape, every key of the description used."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn, SearchStrategy
from scipy.spatial.transform import Rotation

from robot_model import (
    Actuator,
    Base,
    Beam,
    Bearing,
    Clearance,
    ComputedTorque,
    ConstantTemperature,
    Controller,
    Cycloid,
    EffectUse,
    GeneralSection,
    Hold,
    Joint,
    JointPD,
    JointReference,
    Link,
    ModalBody,
    Motor,
    MultiSine,
    NoController,
    Quintic,
    Rectangle,
    Reference,
    Robot,
    SelfHeating,
    Sensor,
    SlidingMode,
    SprungMass,
    StrainGauge,
    Table,
    TemperatureTable,
    Thermal,
    TipBody,
    Transmission,
    Tube,
    VoltageServo,
)

__all__ = ["beams", "robots", "trees"]

numbers = st.floats(-1e3, 1e3)
positive = st.floats(1e-3, 1e3)
not_negative = st.just(0.0) | positive
vectors = st.tuples(numbers, numbers, numbers)
#: Lengths of a robot whose joints leave it free to fold in every way: whether the lightest part of it moves
#: an inertia is distinguishable from rounding only if the rest is not kilometres away.
near = st.tuples(*[st.floats(-10, 10)] * 3)
texts = st.text(max_size=40)
words = st.from_regex(r"[A-Za-z][A-Za-z0-9_-]{0,8}", fullmatch=True)


def maybe(strategy: SearchStrategy) -> SearchStrategy:
    return st.none() | strategy


@st.composite
def moments(draw: DrawFn) -> tuple[float, ...]:
    """Inertia of some cloud of points: three or six numbers inside the triangle inequality."""
    a, b, c = (draw(st.floats(0.01, 10.0)) for _ in range(3))
    principal = np.array([b + c, c + a, a + b])
    if draw(st.booleans()):
        return tuple(map(float, principal))
    turn = Rotation.from_euler("xyz", [draw(st.floats(-3, 3)) for _ in range(3)]).as_matrix()
    matrix = turn @ np.diag(principal) @ turn.T
    return tuple(float(matrix[pair]) for pair in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))


axes = vectors.filter(lambda axis: max(map(abs, axis)) > 1e-6)
actuators = st.builds(
    Actuator,
    gear_ratio=positive,
    rotor_inertia=not_negative,
    torque_constant=maybe(positive),
    resistance=maybe(positive),
    torque_limit=maybe(positive),
    coulomb_friction=not_negative,
    viscous_friction=not_negative,
)
#: Over the thousand kelvin of the temperatures friction changes by a factor of e^10 at most [1/K].
rates = st.floats(-0.01, 0.01)
temperatures = st.one_of(
    st.builds(ConstantTemperature, value=positive),
    st.builds(
        TemperatureTable,
        times=st.just((0.0, 1.0, 2.5)),
        values=st.lists(positive, min_size=3, max_size=3).map(tuple),
    ),
    st.builds(SelfHeating, ambient=positive, initial=maybe(positive), capacity=positive, resistance=positive),
)
thermals = st.builds(
    Thermal, reference=positive, static_rate=rates, kinetic_rate=rates, temperature=temperatures
)
clearances = positive.flatmap(
    lambda radius: st.builds(
        Clearance,
        radial=st.floats(1e-3 * radius, 0.9 * radius),
        journal_radius=st.just(radius),
        stiffness=positive,
        restitution=st.floats(0.01, 1),
        friction=not_negative,
        transition=positive,
    )
)
bearings = st.builds(
    Bearing, radial_arm=not_negative, axial_arm=not_negative, bending_arm=positive, span=maybe(positive)
)
limits = st.tuples(st.floats(-10, -1), st.floats(1, 10))


fractions = st.floats(0, 0.99)
sections = st.one_of(
    st.builds(Tube, outer_diameter=st.floats(0.1, 1), inner_diameter=st.floats(0, 0.09)),
    st.builds(Rectangle, width=st.floats(0.01, 1), height=st.floats(0.01, 1)),
    st.builds(
        GeneralSection,
        area=st.floats(0.01, 1),
        torsion_constant=positive,
        second_moment_y=st.floats(1e-6, 1),
        second_moment_z=st.floats(1e-6, 1),
    ),
)


@st.composite
def kept_modes(draw: DrawFn, most: int) -> dict:
    """Keys that say how many modes a body keeps and how they are damped."""
    count = draw(st.integers(1, most))
    keys: dict = {"boundary": draw(st.sampled_from(["clamped", "free"]))}
    if draw(st.booleans()):
        keys["modes"] = count
    else:
        keys["highest_frequency"] = draw(positive)
    damping = st.lists(fractions, min_size=count, max_size=count).map(tuple)
    if draw(st.booleans()):
        return {**keys, "damping_ratio": draw(fractions | damping)}
    return {**keys, "rayleigh": (draw(not_negative), draw(not_negative))}


@st.composite
def tips(draw: DrawFn) -> TipBody:
    a, b, c = (draw(st.floats(0.01, 10.0)) for _ in range(3))
    return TipBody(
        mass=draw(not_negative), inertia=draw(st.just((0.0, 0.0, 0.0)) | st.just((b + c, c + a, a + b)))
    )


@st.composite
def beams(draw: DrawFn) -> Beam:
    """A straight beam along any direction, every key in use, of a weight like that of the other links."""
    elements = draw(st.integers(1, 20))
    length = draw(st.floats(0.1, 10))
    turn = Rotation.from_euler("xyz", [draw(st.floats(-3, 3)) for _ in range(3)]).as_matrix()
    normal = st.tuples(numbers, numbers).filter(lambda n: max(map(abs, n)) > 1e-6)
    place = st.floats(0, 1).map(lambda part: part * length)
    gauges = st.lists(st.builds(StrainGauge, place=place, normal=normal, distance=positive), max_size=2)
    return Beam(
        length=length,
        direction=tuple(map(float, draw(positive) * turn[:, 0])),
        section_y=tuple(map(float, draw(positive) * turn[:, 1])),
        section=draw(sections),
        young=draw(positive),
        shear=draw(positive),
        density=draw(st.floats(1, 100)),
        elements=elements,
        tip=draw(tips()),
        stiffening=draw(st.booleans()),
        gauges=tuple(draw(gauges)),
        **draw(kept_modes(6)),
    )


indices = st.integers(0, 99)
modal_bodies = kept_modes(6).flatmap(
    lambda keys: st.builds(
        ModalBody,
        file=words.map("parts/{}.npz".format),
        root=indices | st.lists(indices, min_size=1, max_size=3).map(tuple),
        tip=maybe(indices),
        **{key: st.just(value) for key, value in keys.items()},
    )
)


sprung_masses = st.builds(SprungMass, mass=positive, frequency=positive, damping_ratio=not_negative)


@st.composite
def bodies(draw: DrawFn, name: str, *, flexible: bool) -> Link:
    """A rigid link, or a flexible one with a hub where its modes allow it."""
    beam = draw(maybe(beams())) if flexible else None
    modal = draw(maybe(modal_bodies)) if flexible and beam is None else None
    rigid = beam is None and modal is None
    sprung = draw(maybe(sprung_masses)) if flexible and rigid else None
    deformable = beam or modal
    if deformable and deformable.boundary == "free":
        return Link(name=name, beam=beam, modal=modal)
    center = draw(near if flexible else vectors)
    hub = {"mass": draw(positive), "center_of_mass": center, "inertia": draw(moments())}
    return Link(name=name, beam=beam, modal=modal, sprung=sprung, **hub)


@st.composite
def trees(
    draw: DrawFn, most: int = 6, *, flexible: bool = False
) -> tuple[tuple[Link, ...], tuple[Joint, ...]]:
    """Links and as many joints, each link on the base or on an earlier one, in shuffled order.

    With `flexible`, some links deform and some joints are spherical.
    """
    names = draw(st.lists(words.filter(lambda word: word != "base"), unique=True, max_size=most))
    links, joints = [], []
    for index, name in enumerate(names):
        parent = draw(st.sampled_from(["base", *names[:index]]))
        links.append(draw(bodies(name, flexible=flexible)))
        beam = next((link.beam for link in links if link.name == parent), None)
        free = near if flexible else vectors
        origins = free if beam is None else st.sampled_from([tuple(map(float, n)) for n in beam.nodes])
        joints.append(draw(joint(name, parent, index, origins, spherical=flexible and draw(st.booleans()))))
    return tuple(draw(st.permutations(links))), tuple(draw(st.permutations(joints)))


def joint(
    child: str, parent: str, index: int, origins: SearchStrategy, *, spherical: bool
) -> SearchStrategy[Joint]:
    name = f"moves-{index}_{child}"[:64]
    placed = {"name": st.just(name), "parent": st.just(parent), "child": st.just(child), "origin": origins}
    if spherical:
        return st.builds(
            Joint, kind=st.just("spherical"), **placed, rpy=vectors, initial_angular_velocity=vectors
        )
    return st.sampled_from(["revolute", "prismatic", "fixed"]).flatmap(
        lambda kind: st.builds(
            Joint,
            kind=st.just(kind),
            **placed,
            rpy=vectors,
            axis=axes,
            initial_position=numbers,
            initial_velocity=numbers,
            position_limits=maybe(limits),
            velocity_limit=maybe(positive),
            actuator=maybe(actuators),
            bearing=maybe(bearings),
            thermal=maybe(thermals),
            clearance=maybe(clearances) if kind == "revolute" else st.none(),
        )
    )


def gains(count: int) -> SearchStrategy:
    several = st.lists(numbers, min_size=count, max_size=count).map(tuple)
    return numbers | several if count else numbers


@st.composite
def controllers(draw: DrawFn, moving: list[Joint], *, free: bool) -> Controller:
    """A controller of these joints; load-proportional friction only where a bearing gives the load."""
    kind = draw(st.sampled_from([NoController, JointPD, ComputedTorque, SlidingMode, VoltageServo]))
    if kind is NoController:
        return NoController()
    g = gains(len(moving))
    sample_time = draw(st.floats(0, 1))
    if kind is VoltageServo:
        return VoltageServo(gain=draw(g), supply=draw(positive), sample_time=sample_time)
    if kind is SlidingMode:
        given = {key: draw(positive) for key in ("slope", "rate", "boundary_layer")}
        reached = draw(st.sampled_from([{}, {"reaching": "exponential", "proportional": draw(positive)}]))
        return SlidingMode(**given, **reached, sample_time=sample_time)
    shares = tuple(draw(numbers) if joint.bearing else 0.0 for joint in moving)
    common = {
        "kp": draw(g),
        "kd": draw(g),
        "coulomb_feedforward": draw(g),
        "load_feedforward": shares or 0.0,
        "sample_time": sample_time,
    }
    if kind is JointPD:
        return JointPD(**common, ki=draw(g), gravity_feedforward=draw(st.booleans()))
    held = {"base_kp": draw(positive), "base_kd": draw(not_negative)} if free and draw(st.booleans()) else {}
    return ComputedTorque(**common, model=draw(st.sampled_from(["rigid", "full"])), **held)


@st.composite
def transmissions(draw: DrawFn, moving: list[Joint]) -> tuple[Transmission, ...]:
    """None, or one transmission of some of these joints, whose matrix is triangular and regular."""
    moved = draw(st.lists(st.sampled_from(moving), unique_by=id, max_size=3)) if moving else []
    if not moved:
        return ()
    count, part = len(moved), st.floats(-2, 2)
    matrix = [[draw(part) if column < row else 0.0 for column in range(count)] for row in range(count)]
    for row in range(count):
        matrix[row][row] = draw(st.sampled_from([1.0, -1.0, 0.5, -2.0]))
    kinds = st.sampled_from(["revolute", "prismatic"])
    motors = tuple(
        Motor(name=f"turns-{k}", kind=draw(kinds), **draw(actuators).model_dump()) for k in range(count)
    )
    names = tuple(joint.name for joint in moved)
    rows = tuple(map(tuple, draw(st.permutations(matrix))))
    return (Transmission(name=draw(words), joints=names, motors=motors, matrix=rows),)


@st.composite
def motions(draw: DrawFn, name: str) -> JointReference:
    """One reference motion of the joint of that name."""
    kind = draw(st.sampled_from([Hold, Cycloid, Quintic, MultiSine, Table]))
    if kind is Hold:
        return Hold(joint=name)
    if kind in (Cycloid, Quintic):
        return kind(joint=name, displacement=draw(numbers), start=draw(not_negative), duration=draw(positive))
    count = draw(st.integers(4, 7))
    column = st.lists(numbers, min_size=count, max_size=count).map(tuple)
    if kind is MultiSine:
        phases = draw(st.just(()) | column)
        return MultiSine(joint=name, amplitudes=draw(column), frequencies=draw(column), phases=phases)
    times = tuple(sorted(draw(st.lists(numbers, min_size=count, max_size=count, unique=True))))
    degree = draw(st.sampled_from([3, 5] if count > 5 else [3]))
    return Table(joint=name, times=times, positions=draw(column), degree=degree)


@st.composite
def references(draw: DrawFn, joints: list[str]) -> Reference:
    chosen = [name for name in joints if draw(st.booleans())]
    return Reference(
        duration=draw(positive),
        sample_rate=draw(positive),
        joints=tuple(draw(motions(name)) for name in chosen),
    )


@st.composite
def robots(draw: DrawFn) -> Robot:
    """A valid robot with any of its keys in use."""
    links, joints = draw(trees(flexible=True))
    base = draw(st.sampled_from(["fixed", "free"]))
    coupled = draw(transmissions([part for part in joints if part.kind in ("revolute", "prismatic")]))
    driven = [name for one in coupled for name in one.joints]
    joints = tuple(j.model_copy(update={"actuator": None}) if j.name in driven else j for j in joints)
    motors = [motor for one in coupled for motor in one.motors]
    places = ["base", *(part.name for part in (*links, *joints, *motors))]
    moving = [part for part in joints if part.kind in ("revolute", "prismatic")]
    channels = st.builds("{}.{}".format, st.sampled_from(places), st.sampled_from(["position", "torque"]))
    sensors = draw(st.lists(channels, unique=True, max_size=4))
    parameters = st.dictionaries(words.filter(lambda w: w not in ("effect", "at")), numbers, max_size=3)
    return Robot(
        name=draw(words),
        description=draw(texts),
        gravity=draw(vectors),
        base=Base(
            kind=base,
            mass=draw(positive),
            inertia=draw(moments()),
            center_of_mass=draw(near),
            position=draw(vectors),
            rpy=draw(vectors),
        ),
        links=links,
        joints=joints,
        transmissions=coupled,
        sensors=tuple(
            Sensor(channel=channel, noise=draw(not_negative), resolution=draw(not_negative))
            for channel in sensors
        ),
        controller=draw(controllers(moving, free=base == "free")),
        reference=draw(maybe(references([part.name for part in moving]))),
        effects=tuple(
            EffectUse(effect=draw(words), at=draw(st.sampled_from(places)), **draw(parameters))
            for _ in range(draw(st.integers(0, 3)))
        ),
        known=tuple(draw(st.lists(st.sampled_from(places).map("{}.mass".format), max_size=2))),
    )
