"""What a recording will and will not be able to tell, from its channels and its motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from missing_physics.recordings.estimates import resolution_of
from missing_physics.recordings.excitation import Excitation, excitation
from missing_physics.recordings.names import place_of, quantity_of
from robot_model import Recording

__all__ = ["outlook"]

#: A mode needs some samples per period to be seen.
SAMPLES_PER_PERIOD = 5.0
#: Speed levels (of ten) needed to tell a force that grows with speed from one that does not.
ENOUGH_LEVELS = 3
#: Reversals needed for anything that happens at a reversal.
ENOUGH_REVERSALS = 4


def outlook(
    recording: Recording, *, not_judged: Mapping[str, str] | None = None
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Two lists of sentences: what the recording can tell, and what it cannot and why.

    Args:
        recording: as read.
        not_judged: joints of which a diagnosis with a robot can tell nothing, with the sentence on why.
    """
    moves = excitation(recording)
    can: list[str] = []
    cannot = list(dict.fromkeys((not_judged or {}).values()))
    for move in moves:
        if move.place not in (not_judged or {}):
            can.extend(_can(recording, move))
            cannot.extend(_cannot(recording, move))
    cannot.extend(_everywhere(recording, moves))
    limit = recording.sample_rate / SAMPLES_PER_PERIOD
    can.append(f"vibration up to about {limit:.3g} Hz, at {SAMPLES_PER_PERIOD:g} samples per period.")
    return tuple(can), tuple(cannot)


def _force_channel(recording: Recording, place: str) -> str | None:
    names = (f"{place}.{quantity}" for quantity in ("torque", "current", "voltage"))
    return next((name for name in names if name in recording), None)


def _can(recording: Recording, move: Excitation) -> Iterator[str]:
    place, force = move.place, _force_channel(recording, move.place)
    if not move.moves or force is None:
        return
    yield f"{place}: what resists its motion, from {force} against the motion."
    if move.speed_levels >= ENOUGH_LEVELS and move.both_directions:
        yield (
            f"{place}: friction that grows with speed apart from friction that does not, and an "
            "offset apart from both."
        )
    if move.reversals >= ENOUGH_REVERSALS:
        yield f"{place}: what happens at reversals ({move.reversals} of them)."
    if f"{place}.position" in recording and f"{place}.motor_position" in recording:
        yield f"{place}: what lies between motor and joint (elasticity, backlash, transmission error)."


def _cannot(recording: Recording, move: Excitation) -> Iterator[str]:
    place = move.place
    if not move.moves:
        yield f"{place}: nothing, since it does not move beyond its noise."
        return
    if _force_channel(recording, place) is None:
        yield (
            f"{place}: masses and forces, since no torque, current or voltage is recorded; only "
            "their ratios show."
        )
    if not move.both_directions:
        yield f"{place}: an offset apart from dry friction, since it moves in one direction only."
    if move.speed_levels < ENOUGH_LEVELS:
        yield f"{place}: viscous apart from dry friction, since it moves at about one speed."
    if move.reversals < ENOUGH_REVERSALS:
        yield f"{place}: backlash, presliding and stiction, since it {_reverses(move.reversals)}."
    if not {f"{place}.position", f"{place}.motor_position"} <= set(recording):
        yield (
            f"{place}: what lies between motor and joint is seen only through resonance, since "
            "one side is recorded."
        )
    if f"{place}.temperature" not in recording:
        yield f"{place}: dependence on temperature, since none is recorded."
    step = resolution_of(recording, f"{place}.position") if f"{place}.position" in recording else 0.0
    if step:
        yield f"{place}: motion finer than {step:.3g}, the step of its position."


def _reverses(count: int) -> str:
    return {0: "never reverses", 1: "reverses only once", 2: "reverses only twice"}.get(
        count, f"reverses only {count} times"
    )


def _everywhere(recording: Recording, moves: tuple[Excitation, ...]) -> Iterator[str]:
    places = {place_of(name) for name in recording}
    quantities = {quantity_of(name) for name in recording}
    if not moves:
        yield "joint physics, since no joint's position is recorded."
    if "base" not in places:
        yield "motion of the base, since no base channel is recorded; a fixed base has to be believed."
    if not quantities & {"tip_acceleration", "tip_deflection", "strain"}:
        yield (
            "flexibility of the links beyond what reaches the joints, since no tip or strain "
            "sensor is recorded."
        )
