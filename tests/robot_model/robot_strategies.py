"""Hypothesis strategies for robots: trees of any shape, every key of the description used."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn, SearchStrategy
from scipy.spatial.transform import Rotation

from robot_model import (
    Actuator,
    Base,
    Bearing,
    ComputedTorque,
    Controller,
    Cycloid,
    EffectUse,
    Hold,
    Joint,
    JointPD,
    JointReference,
    Link,
    MultiSine,
    NoController,
    Quintic,
    Reference,
    Robot,
    Sensor,
    Table,
    VoltageServo,
)

__all__ = ["robots", "trees"]

numbers = st.floats(-1e3, 1e3)
positive = st.floats(1e-3, 1e3)
not_negative = st.just(0.0) | positive
vectors = st.tuples(numbers, numbers, numbers)
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
)
bearings = st.builds(Bearing, radial_arm=not_negative, axial_arm=not_negative, bending_arm=positive)
limits = st.tuples(st.floats(-10, -1), st.floats(1, 10))


@st.composite
def trees(draw: DrawFn, most: int = 6) -> tuple[tuple[Link, ...], tuple[Joint, ...]]:
    """Links and as many joints, each link on the base or on an earlier one, in shuffled order."""
    names = draw(st.lists(words.filter(lambda word: word != "base"), unique=True, max_size=most))
    links, joints = [], []
    for index, name in enumerate(names):
        parent = draw(st.sampled_from(["base", *names[:index]]))
        links.append(
            Link(name=name, mass=draw(positive), center_of_mass=draw(vectors), inertia=draw(moments()))
        )
        joints.append(draw(joint(name, parent, index)))
    return tuple(draw(st.permutations(links))), tuple(draw(st.permutations(joints)))


def joint(child: str, parent: str, index: int) -> SearchStrategy[Joint]:
    return st.builds(
        Joint,
        name=st.just(f"moves-{index}_{child}"[:64]),
        kind=st.sampled_from(["revolute", "prismatic", "fixed"]),
        parent=st.just(parent),
        child=st.just(child),
        origin=vectors,
        rpy=vectors,
        axis=axes,
        initial_position=numbers,
        initial_velocity=numbers,
        position_limits=maybe(limits),
        velocity_limit=maybe(positive),
        actuator=maybe(actuators),
        bearing=maybe(bearings),
    )


def gains(count: int) -> SearchStrategy:
    several = st.lists(numbers, min_size=count, max_size=count).map(tuple)
    return numbers | several if count else numbers


def controllers(count: int) -> SearchStrategy[Controller]:
    g = gains(count)
    return st.one_of(
        st.just(NoController()),
        st.builds(JointPD, kp=g, kd=g, ki=g, gravity_feedforward=st.booleans(), sample_time=st.floats(0, 1)),
        st.builds(ComputedTorque, kp=g, kd=g, sample_time=st.floats(0, 1)),
        st.builds(VoltageServo, gain=g, supply=positive, sample_time=st.floats(0, 1)),
    )


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
    return Table(joint=name, times=times, positions=draw(column))


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
    links, joints = draw(trees())
    places = ["base", *(part.name for part in (*links, *joints))]
    moving = [part.name for part in joints if part.kind != "fixed"]
    channels = st.builds("{}.{}".format, st.sampled_from(places), st.sampled_from(["position", "torque"]))
    sensors = draw(st.lists(channels, unique=True, max_size=4))
    parameters = st.dictionaries(words.filter(lambda w: w not in ("effect", "at")), numbers, max_size=3)
    return Robot(
        name=draw(words),
        description=draw(texts),
        gravity=draw(vectors),
        base=Base(
            kind=draw(st.sampled_from(["fixed", "free"])),
            mass=draw(positive),
            inertia=draw(moments()),
            center_of_mass=draw(vectors),
            position=draw(vectors),
            rpy=draw(vectors),
        ),
        links=links,
        joints=joints,
        sensors=tuple(
            Sensor(channel=channel, noise=draw(not_negative), resolution=draw(not_negative))
            for channel in sensors
        ),
        controller=draw(controllers(len(moving))),
        reference=draw(maybe(references(moving))),
        effects=tuple(
            EffectUse(effect=draw(words), at=draw(st.sampled_from(places)), **draw(parameters))
            for _ in range(draw(st.integers(0, 3)))
        ),
        known=tuple(draw(st.lists(st.sampled_from(places).map("{}.mass".format), max_size=2))),
    )
