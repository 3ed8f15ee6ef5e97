"""The robot without the effects for which recordings are corrected, and a robot file with them again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from reference_model.effects.base import GearEffect, SensorEffect, YieldingGear
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse, Recording, Robot

__all__ = ["left_aside", "restored", "stripped"]


def stripped(robot: Robot, recordings: Sequence[Recording]) -> Robot:
    """The robot without errors of sensors, and without gears but those whose twist follows from the torque.

    The twist of a yielding gear behind the only encoder is taken as the robot file says.
    """
    kept = tuple(use for use in robot.effects if not _is_known(use, recordings))
    return robot.model_copy(update={"effects": kept})


def restored(file: Robot, robot: Robot, recordings: Sequence[Recording]) -> Robot:
    """A robot file with the effects that `stripped` left out of `robot`.

    Where a sensor errs otherwise than `robot` says, the parameters are added: errors are small, so that one
    after the other is their sum to first order.
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


def left_aside(robot: Robot, recordings: Sequence[Recording]) -> Iterator[str]:
    """Sentences on gears of the robot file that the recordings do not show."""
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
