"""Removes from a robot the effects for which recordings are corrected, and restores them in a robot file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from reference_model.effects.base import GearEffect, SensorEffect, YieldingGear
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse, Recording, Robot

__all__ = ["ignored_gears", "restored", "stripped"]


def stripped(robot: Robot, recordings: Sequence[Recording]) -> Robot:
    """The robot without sensor errors, and without gear effects except twist that follows from the torque.

    The twist of a compliant gear behind the only encoder is kept as in the robot file.
    """
    kept = tuple(use for use in robot.effects if not _is_known(use, recordings))
    return robot.model_copy(update={"effects": kept})


def restored(file: Robot, robot: Robot, recordings: Sequence[Recording]) -> Robot:
    """A robot file with the effects that `stripped` removed from `robot`.

    If a further error of the same sensor was found, the parameters are added: small errors in sequence add up
    to first order.
    """
    more = list(file.effects)
    for use in robot.effects:
        if not _is_known(use, recordings):
            continue
        same = next((k for k, o in enumerate(more) if (o.effect, o.at) == (use.effect, use.at)), None)
        if same is None:
            more.append(use)
            continue
        own, linear = more[same], {p.name for p in get_effect(use.effect).parameters if p.absent == 0.0}
        sums = {name: v + use.parameters[name] * (name in linear) for name, v in own.parameters.items()}
        more[same] = EffectUse(effect=use.effect, at=use.at, **sums)
    return file.model_copy(update={"effects": tuple(more)})


def ignored_gears(robot: Robot, recordings: Sequence[Recording]) -> Iterator[str]:
    """Sentences on gear effects of the robot file that were ignored."""
    for use in robot.effects:
        effect = get_effect(use.effect)
        if (
            isinstance(effect, GearEffect)
            and _is_known(use, recordings)
            and not _has_both(use.at, recordings)
        ):
            yield (
                f"{use.at}: the {effect.title.lower()} of its gear in the robot file was not taken into "
                "account; that requires encoders on both sides of the gear."
            )


def _is_known(use: EffectUse, recordings: Sequence[Recording]) -> bool:
    effect = get_effect(use.effect)
    if isinstance(effect, YieldingGear) and not any(f"{use.at}.position" in r for r in recordings):
        return False
    return isinstance(effect, SensorEffect | GearEffect)


def _has_both(joint: str, recordings: Sequence[Recording]) -> bool:
    return all(f"{joint}.{q}" in r for r in recordings for q in ("position", "motor_position"))
