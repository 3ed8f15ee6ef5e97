"""Effects of links and base in both engines: trajectories converge with the square of the step."""

from __future__ import annotations

import numpy as np
import pytest
from exudyn_robots import joint
from quick_ones import quick_names

from exudyn_model import simulate
from exudyn_model.effects.build import MOUNT as MOUNT_EFFECT
from exudyn_model.effects.build import PUSHES
from exudyn_model.effects.links.pushes import Mount
from exudyn_model.effects.links.structure import PARAMETERS, as_is
from reference_model.effects.catalogue import get_effect
from reference_model.plant.truth import truth_of
from reference_model.simulation import simulate as reference_simulate
from robot_model import (
    Base,
    Beam,
    EffectUse,
    InputError,
    Joint,
    JointPD,
    Link,
    Recording,
    Reference,
    Robot,
    Tube,
    load_robot,
)

#: Integration errors of the reference, beside the differences below.
PRECISE = {"rtol": 1e-11, "atol": 1e-13}


def effect(name: str, at: str, **parameters: float) -> EffectUse:
    return EffectUse.model_validate({"effect": name, "at": at, **parameters})


def craft(**changes: object) -> Robot:
    """A free base with a driven arm on a skew axis, swinging."""
    given = {
        "name": "craft",
        "base": Base(
            kind="free",
            mass=40.0,
            inertia=(5.0, 6.0, 7.0, 0.2, -0.1, 0.3),
            center_of_mass=(0.1, 0.0, 0.05),
            rpy=(0.2, -0.1, 0.3),
        ),
        "links": (Link(name="arm", mass=5.0, center_of_mass=(0.6, 0.1, 0.0), inertia=(0.1, 0.8, 0.8)),),
        "joints": (
            joint(
                "shoulder", child="arm", origin=(0.4, 0.0, 0.2), axis=(0.0, 0.6, 0.8), initial_velocity=1.2
            ),
        ),
        "controller": JointPD(kp=40.0, kd=12.0, sample_time=0.0),
        "reference": Reference(duration=0.2, sample_rate=100.0),
    }
    return Robot.model_validate({**given, **changes})


def grounded() -> Robot:
    """The same arm on a fixed base, in gravity."""
    return craft(base=Base(position=(0.3, -0.2, 0.1), rpy=(0.2, -0.1, 0.3)), gravity=(0.0, 1.0, -9.0))


SLOW = craft(
    joints=(
        joint("shoulder", child="arm", origin=(0.4, 0.0, 0.2), axis=(0.0, 0.6, 0.8), initial_velocity=0.05),
    )
)

BLADE = craft(
    links=(
        Link(
            name="arm",
            mass=5.0,
            inertia=(1.0, 1.0, 1.0),
            beam=Beam(
                length=2.0,
                section=Tube(outer_diameter=0.02, inner_diameter=0.018),
                young=70e9,
                shear=27e9,
                density=2700.0,
                elements=6,
                modes=2,
                damping_ratio=0.01,
            ),
        ),
    ),
    joints=(
        joint("shoulder", child="arm", origin=(0.4, 0.0, 0.2), axis=(0.0, 0.6, 0.8), initial_velocity=3.0),
    ),
    reference=Reference(duration=0.2, sample_rate=100.0),
)

WALL = {"x": 1.2, "normal_y": -1.0, "normal_z": 0.3, "offset": -0.45, "stiffness": 2e4, "damping": 0.3}
PLACE = {"x": 0.3, "y": -0.2, "z": 0.4}
SPIN = {"momentum_x": 3.0, "torque_z": 0.2, "drag": 0.3, "imbalance": 1e-3, "rotor_inertia": 0.05}

CASES = {
    "flexibility": (SLOW, (effect("link_flexibility", "arm", period=0.6, damping_ratio=0.05, modes=2.0),)),
    "damping": (
        SLOW,
        (
            effect("link_flexibility", "arm", period=0.6, modes=2.0),
            effect("modal_damping", "arm", damping_ratio=0.2),
        ),
    ),
    "stiffening": (
        BLADE,
        (effect("centrifugal_stiffening", "arm", strength=0.7),),
    ),
    "slosh": (craft(), (effect("slosh", "base", mass=6.0, frequency=0.8, damping_ratio=0.03, **PLACE),)),
    "wheel": (craft(), (effect("reaction_wheel", "base", **SPIN),)),
    "contact": (craft(), (effect("contact", "arm", **WALL),)),
    "mount": (grounded(), (effect("base_motion", "base", compliance=1e-4, mass=60.0, inertia=8.0),)),
    "mounted tank and wheel": (
        grounded(),
        (
            effect("base_motion", "base", compliance=1e-3, mass=60.0, inertia=8.0),
            effect("slosh", "base", mass=6.0, frequency=0.8, **PLACE),
            effect("reaction_wheel", "base", momentum_y=4.0),
        ),
    ),
}


def worst(one: Recording, other: Recording) -> float:
    """Largest difference of any channel, relative to the largest of its vector."""
    common = [name for name in one.channels if name in other.channels]
    wanted = {"robot.energy", "robot.angular_momentum.x", "shoulder.bending_moment", "base.position.x"}
    assert wanted <= set(common)
    sizes: dict[str, float] = {}
    for name in common:
        vector = name.rsplit(".", 1)[0] if name.count(".") == 2 else name
        sizes[vector] = max(sizes.get(vector, 0.0), float(np.abs(one[name]).max()))
    gaps = []
    for name in common:
        vector = name.rsplit(".", 1)[0] if name.count(".") == 2 else name
        # below 1e-3 a channel is zero in both engines, as momentum is without a wall
        gaps.append(float(np.abs(one[name] - other[name]).max()) / max(sizes[vector], 1e-3))
    return max(gaps)


@pytest.mark.parametrize("case", quick_names(CASES, "flexibility", "slosh", "contact", "mount"))
def test_the_engines_converge_with_the_square_of_the_step(case: str) -> None:
    robot, uses = CASES[case]
    robot = robot.with_effects(*uses)
    exact = reference_simulate(robot, sensors=False, **PRECISE)
    runs = [simulate(robot, sensors=False, step=h, integrator="trapezoidal") for h in (2e-3, 1e-3)]
    # All channels, accelerations and bearing loads too. The trapezoidal rule errs by (w h)^2/12 a radian:
    # 1e-3 a radian of a wall of some hundred rad/s.
    gaps = [worst(exact, run) for run in runs]
    assert gaps[1] < 5e-3
    # A clean second order is four; a wall is hit between two steps, which leaves some scatter.
    assert gaps[0] / gaps[1] == pytest.approx(4.0, abs=1.5 if case == "contact" else 0.6)


def test_an_explicit_rotor_in_exudyn_equals_the_wheel_effect() -> None:
    """A body that spins on a joint in this engine, against the formula for momentum on board in the other."""
    inertia, speed = 0.3, 8.0
    base = Base(kind="free", mass=40.0, inertia=(5.0, 6.0, 7.0, 0.2, -0.1, 0.3))
    j = np.array(base.inertia) - [inertia / 2, 0.0, inertia / 2, 0.0, 0.0, 0.0]
    rotor = Link(name="rotor", mass=2.0, inertia=(inertia / 2, inertia, inertia / 2))
    axle = Joint(name="axle", parent="base", child="rotor", axis=(0.0, 1.0, 0.0), initial_velocity=speed)
    real = craft(
        base=base.model_copy(update={"mass": 38.0, "inertia": tuple(j.tolist())}),
        links=(*craft().links, rotor),
        joints=(*craft().joints, axle),
        controller=JointPD(kp=(40.0, 0.0), kd=(12.0, 0.0), sample_time=0.0),
    )
    found = simulate(real, sensors=False, step=5e-4, integrator="trapezoidal")
    use = effect("reaction_wheel", "base", momentum_y=inertia * speed)
    exact = reference_simulate(craft(base=base).with_effects(use), sensors=False, **PRECISE)
    for axis in "xyz":
        # Second order at half a millisecond, beside rates of 0.1 rad/s.
        name = f"base.angular_velocity.{axis}"
        np.testing.assert_allclose(found[name], exact[name], rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", ["two_link_arm", "flexible_space_robot", "six_joint_space_arm"])
def test_both_engines_convert_a_link_to_the_same_beam(name: str) -> None:
    robot = load_robot(name)
    for link in robot.links:
        if link.flexible:
            continue
        bent = robot.with_effects(effect("link_flexibility", link.name, period=0.2))
        mine, theirs = as_is(bent).link(link.name), truth_of(bent).robot.link(link.name)
        assert mine.beam is not None
        assert theirs.beam is not None
        for key in ("length", "direction", "section_y", "density", "damping_ratio", "modes", "elements"):
            assert getattr(mine.beam, key) == pytest.approx(getattr(theirs.beam, key), rel=1e-9)
        assert mine.beam.section.figures == pytest.approx(theirs.beam.section.figures, rel=1e-9)
        assert mine.beam.tip.mass == pytest.approx(theirs.beam.tip.mass, rel=1e-6)
        # What is left for the hub is a small difference of large figures.
        for key in ("mass", "center_of_mass", "inertia"):
            assert getattr(mine, key) == pytest.approx(getattr(theirs, key), rel=1e-6, abs=1e-9 * link.mass)


def hanging_ball() -> Robot:
    ball = Joint(name="ball", kind="spherical", parent="arm", child="lamp", origin=(1.0, 0.0, 0.0))
    robot = grounded()
    lamp = Link(name="lamp", mass=2.0, center_of_mass=(0.2, 0.0, -0.1), inertia=(0.1, 0.12, 0.11))
    return robot.model_copy(update={"links": (*robot.links, lamp), "joints": (*robot.joints, ball)})


def welded_tool() -> Robot:
    robot = craft()
    tool = Link(name="tool", mass=1.0, inertia=(0.1, 0.1, 0.1))
    weld = Joint(
        name="weld", kind="fixed", parent="arm", child="tool", origin=(1.0, 0.1, 0.0), rpy=(0.3, 0.5, 0.2)
    )
    return robot.model_copy(update={"links": (*robot.links, tool), "joints": (*robot.joints, weld)})


MOUNT = effect("base_motion", "base", compliance=1e-4, mass=60.0, inertia=8.0)


@pytest.mark.parametrize(
    ("robot", "uses"),
    [
        pytest.param(hanging_ball(), (MOUNT,), id="mount under a ball"),
        pytest.param(
            BLADE.model_copy(update={"base": grounded().base, "gravity": (0.0, 1.0, -0.5)}),
            (MOUNT, effect("payload", "arm", mass=0.6, x=1.0, y=0.1)),
            id="mount under a loaded beam",
            marks=pytest.mark.proof,
        ),
        pytest.param(
            welded_tool(),
            (effect("contact", "tool", **{**WALL, "x": 0.2}),),
            id="wall at a welded tool",
            marks=pytest.mark.proof,
        ),
    ],
)
def test_engines_agree_on_forces_at_fixed_and_welded_bodies(
    robot: Robot, uses: tuple[EffectUse, ...]
) -> None:
    moving = robot.model_copy(update={"reference": Reference(duration=0.1, sample_rate=100.0)})
    mine = simulate(moving.with_effects(*uses), sensors=False, step=5e-4)
    theirs = reference_simulate(moving.with_effects(*uses), sensors=False, **PRECISE)
    without = reference_simulate(moving, sensors=False)
    name = "shoulder.position"
    gap = float(np.abs(mine[name] - theirs[name]).max())
    # (w h)^2/12 of what rings; a mount that carries another weight begins by a jerk of 1e-3.
    assert gap < 2e-6
    assert float(np.abs(without[name] - theirs[name]).max()) > 20 * gap


@pytest.mark.parametrize("name", [*PARAMETERS, *PUSHES, MOUNT_EFFECT])
def test_parameters_and_defaults_are_those_of_the_catalogue(name: str) -> None:
    known = {p.name: p.default for p in get_effect(name).parameters}
    if name in PARAMETERS:
        assert dict(PARAMETERS[name]) == known
        return
    given = {p: 1.0 for p, default in known.items() if default is None}
    made = {**PUSHES, MOUNT_EFFECT: Mount}[name](**given)
    assert vars(made) == {**known, **given}


@pytest.mark.parametrize("name", ["link_flexibility", "slosh", "reaction_wheel", "contact", "base_motion"])
def test_absent_effects_change_nothing(name: str) -> None:
    robot, at = craft(), "base"
    known = get_effect(name).parameters
    values = {p.name: p.typical if p.default is None else p.default for p in known}
    values |= {p.name: p.absent for p in known if p.absent is not None}
    if name in ("link_flexibility", "contact"):
        at = "arm"
    with_it = simulate(robot.with_effects(effect(name, at, **values)), sensors=False)
    without = simulate(robot, sensors=False)
    assert set(with_it.channels) == set(without.channels)
    for channel in without.channels:
        np.testing.assert_array_equal(with_it[channel], without[channel])


@pytest.mark.parametrize(
    ("robot", "use", "sentence"),
    [
        (craft(), effect("base_motion", "base", compliance=1e-4), "the base is free already"),
        (grounded(), effect("base_motion", "base", compliance=1e-4), "give mass and inertia"),
        (craft(), effect("slosh", "base", mass=80.0, frequency=1.0), "has no 80 kg"),
        (craft(), effect("modal_damping", "arm", damping_ratio=0.1), "has no modes to damp"),
        (craft(), effect("centrifugal_stiffening", "arm", strength=1.0), "is not a beam"),
        (craft(), effect("link_flexibility", "base", period=0.1), "it can sit at arm"),
        (craft(), effect("link_flexibility", "arm", perod=0.1), "did you mean 'period'"),
        (craft(), effect("slosh", "arm", mass=1.0, frequency=1.0), "it can sit at base"),
        (craft(), effect("contact", "base", stiffness=1.0, offset=0.0), "it can sit at arm"),
    ],
)
def test_unsupported_effects_are_refused_by_name(robot: Robot, use: EffectUse, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        simulate(robot.with_effects(use))


def test_exact_beams_stiffen_like_the_effect() -> None:
    """A blade spinning at twice its first frequency in a weak field across it, by other elements."""
    beam = Beam(
        length=2.0,
        section=Tube(outer_diameter=0.02, inner_diameter=0.018),
        young=70e9,
        shear=27e9,
        density=2700.0,
        elements=12,
        modes=4,
    )
    robot = Robot(
        name="rotor",
        gravity=(0.0, 0.0, -1.0),
        links=(Link(name="blade", mass=1.0, inertia=(1e6, 1e6, 1e6), beam=beam),),
        joints=(Joint(name="hub", parent="base", child="blade", initial_velocity=12.0),),
        reference=Reference(duration=0.4, sample_rate=200.0),
    )
    whole = robot.with_effects(effect("centrifugal_stiffening", "blade", strength=1.0))
    found = simulate(whole, sensors=False, flexible="beam")["blade.tip_deflection.z"]
    stiff, soft = (reference_simulate(r, sensors=False)["blade.tip_deflection.z"] for r in (whole, robot))
    # Two modes in a plane leave some per cent of a deflection that the rotation bends as well; without
    # stiffening it is half as large again.
    size = float(np.abs(stiff).max())
    assert float(np.abs(found - stiff).max()) < 0.06 * size
    assert float(np.abs(found - soft).max()) > 0.5 * size


def test_exact_beams_refuse_partial_stiffening() -> None:
    robot = load_robot("flexible_space_robot")
    with pytest.raises(InputError, match=r"stiffens wholly, not by a share of 0\.5"):
        simulate(robot.with_effects(effect("centrifugal_stiffening", "link2", strength=0.5)), flexible="beam")
    with pytest.raises(InputError, match='use formulation = "redundant"'):
        simulate(craft().with_effects(effect("reaction_wheel", "base", momentum_x=1.0)), formulation="tree")
