"""The catalogue as data: ids, units, bounds, references, users' own effects, checked uses."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace

import casadi as ca
import pytest
from effect_cases import named

from reference_model.effects import catalogue as module
from reference_model.effects.base import Effect, Extent, JointEffect, JointSignals, Parameter, Values
from reference_model.effects.catalogue import catalogue, get_effect, used_effects
from reference_model.effects.units import unit_at
from robot_model import EffectUse, InputError, Robot, load_robot

EFFECTS = list(catalogue().values())
KNOWN = set(catalogue())

FACTOR = re.compile(r"(N|m|rad|s|kg|K|channel)(\^(2|3|1\.5))?")


def _is_unit(unit: str) -> bool:
    parts = unit.split("/")
    return unit == "-" or (
        len(parts) <= 2
        and all(
            FACTOR.fullmatch(f) or (k == 0 and f == "1") for k, p in enumerate(parts) for f in p.split(" ")
        )
    )


def test_every_place_has_its_effects() -> None:
    """The ids that the interface promises, by place."""
    promised = {
        "link": {
            "link_flexibility",
            "modal_damping",
            "payload",
            "inertia",
            "centrifugal_stiffening",
            "contact",
        },
        "base": {"gravity", "base_motion", "slosh", "reaction_wheel"},
        "sensor": {"sensor_offset", "sensor_gain", "encoder_eccentricity", "sensor_delay", "clock_drift"},
    }
    for place, ids in promised.items():
        assert {effect.id for effect in EFFECTS if effect.place == place} == ids
    assert len(EFFECTS) == 35


@pytest.mark.parametrize("effect", EFFECTS, ids=named)
def test_every_effect_has_complete_metadata(effect: Effect) -> None:
    for text in (effect.title, effect.equation, effect.source, effect.signature, effect.experiment):
        assert text.strip() == text != ""
        assert not text.endswith(".")  # the page puts the full stop
    assert effect.confused_with
    assert set(effect.confused_with) <= KNOWN - {effect.id}
    assert set(effect.builds_on) | set(effect.simpler) <= KNOWN - {effect.id}
    names = [p.name for p in effect.parameters]
    assert len(set(names)) == len(names) > 0


@pytest.mark.parametrize("effect", EFFECTS, ids=named)
def test_parameters_are_consistent(effect: Effect) -> None:
    for p in effect.parameters:
        assert p.lower < p.upper
        assert p.lower <= p.typical <= p.upper
        assert p.absent is None or p.lower <= p.absent <= p.upper
        assert p.default is None or p.lower <= p.default <= p.upper
        assert p.estimated or p.default is not None
        assert _is_unit(p.unit), p.unit
        on_a_slide = unit_at(p.unit, prismatic=True, channel_unit="m")
        assert "rad" not in on_a_slide
        assert "channel" not in on_a_slide
        assert not re.search(r"\bN m\b", on_a_slide)
        assert _is_unit(on_a_slide)
    assert any(p.absent is not None for p in effect.estimated)


@pytest.mark.parametrize(
    ("unit", "slide"),
    [
        ("N m", "N"),
        ("N m s/rad", "N s/m"),
        ("N m/rad", "N/m"),
        ("rad/s", "m/s"),
        ("1/rad", "1/m"),
        ("kg m^2", "kg m^2"),
        ("-", "-"),
    ],
)
def test_units_on_a_prismatic_joint(unit: str, slide: str) -> None:
    assert unit_at(unit, prismatic=True) == slide
    assert unit_at(unit) == unit


def test_a_sensor_effect_takes_the_unit_of_its_channel() -> None:
    assert unit_at("channel", channel_unit="rad/s") == "rad/s"


EXTENTS = [
    Extent(
        position=(-0.5, 0.5),
        speed=1.0,
        slow=0.01,
        torque=10.0,
        residual=1.0,
        duration=20.0,
        sample_time=1e-3,
        gear_ratio=100.0,
        peak_torque=40.0,
        windows=((1.0, 2.0), (5.0, 5.1)),
        orders=(30.0, 101.0, 100.9, 7.0),
    ),
    # Nothing moves, nothing is measured: starts must still be usable.
    Extent(
        position=(0.3, 0.3), speed=0.0, slow=0.0, torque=0.0, residual=0.0, duration=0.0, sample_time=1e-3
    ),
]


@pytest.mark.parametrize("extent", EXTENTS, ids=["rich", "still"])
@pytest.mark.parametrize("effect", EFFECTS, ids=named)
def test_starts_are_few_and_inside_the_bounds(effect: Effect, extent: Extent) -> None:
    starts = effect.starts(extent)
    # Frequencies are apart by a quarter of a period over the recording, up to 1.5 Hz.
    assert 1 <= len(starts) <= max(12, 6 * extent.duration if "frequency" in effect.essential else 0)
    nonlinear = {p.name for p in effect.estimated if not p.linear}
    # LuGre inherits its two torques from the simpler law that it replaces.
    nonlinear -= {"coulomb_torque", "static_torque"}
    for start in starts:
        assert nonlinear <= set(start)
        for name, value in start.items():
            parameter = effect.parameter(name)
            assert parameter.lower <= value <= parameter.upper
    for name, (lower, upper) in effect.bounds(extent).items():
        parameter = effect.parameter(name)
        assert parameter.lower <= lower < upper <= parameter.upper


def test_pushes_start_inside_a_recording_that_does_not_begin_at_zero() -> None:
    effect = get_effect("external_torque")
    late = replace(EXTENTS[0], begin=100.0, windows=())
    low, high = effect.bounds(late)["start"]
    assert (low, high) == (100.0, 120.0)
    assert all(low <= start["start"] < high for start in effect.starts(late))
    # Times before zero are outside of the catalogue's range.
    assert effect.bounds(replace(late, begin=-5.0))["start"] == (0.0, 15.0)


def test_order_starts_prefer_residual_peaks_and_drop_duplicates() -> None:
    orders = [s["order"] for s in get_effect("torque_ripple").starts(EXTENTS[0])]
    # 101 and 100.9 and the gear ratio are one cycle pattern over a travel of 1 rad; joint turns (1, 2) do
    # not run through a cycle there.
    assert orders == [30.0, 101.0, 7.0, 200.0]


class Seal(JointEffect):
    """A user's own effect."""

    id = "shaft_seal"
    title = "Shaft seal"
    place = "joint"
    parameters = (Parameter("drag", "N m", "drag", 0.0, 10.0, 1.0, absent=0.0, linear=True),)
    equation = "T = -drag * tanh(qd)"
    source = "own measurement"
    signature = "drag"
    experiment = "take the seal off"

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        return -p["drag"] * ca.tanh(s.velocity)


@pytest.fixture
def with_seal(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    entry = SimpleNamespace(load=lambda: Seal)
    monkeypatch.setattr(
        module, "entry_points", lambda group: [entry] if group == module.ENTRY_POINT_GROUP else []
    )
    catalogue.cache_clear()
    yield
    monkeypatch.undo()
    catalogue.cache_clear()


@pytest.mark.usefixtures("with_seal")
def test_an_installed_package_adds_an_effect() -> None:
    assert isinstance(get_effect("shaft_seal"), Seal)
    robot = _robot(EffectUse(effect="shaft_seal", at="joint1", drag=2.0))
    assert used_effects(robot)[0].parameters == {"drag": 2.0}


def _robot(*effects: EffectUse) -> Robot:
    return load_robot("two_link_arm").model_copy(update={"effects": effects})


def falling(effect: str, **parameters: float) -> EffectUse:
    """A friction law at joint1 that falls from 3 N m at rest to 5 N m when sliding, which none does."""
    return EffectUse(
        effect=effect,
        at="joint1",
        **{"static_torque": 3.0, "coulomb_torque": 5.0, "stribeck_velocity": 0.01, **parameters},
    )


BELOW_SLIDING = (
    r"^robot 'two_link_arm', effect '\w+' at 'joint1': static_torque = 3 is below coulomb_torque = 5; "
    r"friction at rest is at least that of sliding\.$"
)


@pytest.mark.parametrize(
    ("use", "sentence"),
    [
        (EffectUse(effect="coulomb_fricton", at="joint1"), "did you mean 'coulomb_friction'"),
        (EffectUse(effect="coulomb_friction", at="joint9", torque=1.0), "it can sit at joint1, joint2"),
        (EffectUse(effect="coulomb_friction", at="base", torque=1.0), "it can sit at joint1, joint2"),
        (EffectUse(effect="gravity", at="link1", x=1.0), "it can sit at base"),
        (EffectUse(effect="payload", at="joint1", mass=1.0), "it can sit at base, link1, link2"),
        (EffectUse(effect="coulomb_friction", at="joint1", torqe=1.0), "did you mean 'torque'"),
        (EffectUse(effect="coulomb_friction", at="joint1"), r"'torque' \[N m\] is missing"),
        (EffectUse(effect="coulomb_friction", at="joint1", torque=-1.0), "outside 0 to 100000"),
        (falling("stribeck_friction"), BELOW_SLIDING),
        (
            falling(
                "stribeck_friction", static_torque=6.0, load_coefficient=0.2, load_static_coefficient=0.1
            ),
            "load_static_coefficient = 0.1 is below load_coefficient = 0.2",
        ),
        (falling("lugre_friction", bristle_stiffness=1e4, bristle_damping=1.0), BELOW_SLIDING),
        (
            EffectUse(effect="end_stop", at="joint1", stiffness=1.0, position=1.0, side=0.5),
            r"side = 0\.5 is neither 1 \(upwards\) nor -1 \(downwards\)",
        ),
        (EffectUse(effect="link_flexibility", at="link1", period=0.1, modes=1.5), "modes = 1.5 is not"),
        (
            EffectUse(effect="contact", at="link1", stiffness=1.0, offset=0.0, normal_z=0.0),
            "the normal has zero length",
        ),
    ],
)
def test_an_unusable_effect_is_refused_with_a_sentence(use: EffectUse, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence) as caught:
        used_effects(_robot(use))
    assert str(caught.value).endswith((".", "?"))
    assert "\n" not in str(caught.value)


PLACES = {"base": "base", "link": "link1", "sensor": "joint1.position"}
BOUNDED = [(effect, parameter) for effect in EFFECTS for parameter in effect.parameters]


@pytest.mark.parametrize(("effect", "parameter"), BOUNDED)
@pytest.mark.parametrize("below", [True, False])
def test_a_parameter_out_of_bounds_is_refused_with_its_value(
    effect: Effect, parameter: Parameter, below: bool
) -> None:
    """One by one, all others being typical: negative stiffness, no Stribeck velocity, a share above one."""
    wrong = parameter.lower - parameter.typical if below else parameter.upper + parameter.typical
    values = {other.name: other.typical for other in effect.parameters} | {parameter.name: wrong}
    use = EffectUse(effect=effect.id, at=PLACES.get(effect.place, "joint1"), **values)
    with pytest.raises(InputError) as caught:
        used_effects(_robot(use))
    message = f"{parameter.name} = {wrong:g} {parameter.unit} is outside {parameter.lower:g} to"
    assert message in str(caught.value)


def test_defaults_fill_omitted_parameters() -> None:
    (used,) = used_effects(
        _robot(EffectUse(effect="external_torque", at="joint2", torque=1.0, start=1.0, duration=2.0))
    )
    assert used.parameters["edge"] == get_effect("external_torque").parameter("edge").default
