"""A diagnosis, and its answer for scripts and notebooks."""

from __future__ import annotations

import html
import io
import sys
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from missing_physics.api.loading import (
    MapLike,
    PathLike,
    RobotLike,
    load_recording,
    load_robot,
    map_of,
    several,
)
from missing_physics.api.thinning import thinned
from missing_physics.checks.transmissions import on_both_sides
from missing_physics.diagnosis import ContradictionError, Options
from missing_physics.diagnosis import diagnose as run_diagnosis
from missing_physics.premises import require_premises
from missing_physics.recordings import SIZE_LIMIT
from missing_physics.recordings import Finding as Problem
from missing_physics.reporting import PlainConsole, figure_of, print_summary, write_outputs
from missing_physics.reporting.elements.verdicts import TITLE, named_text
from missing_physics.results.result import Finding, Result
from robot_model import Recording, Robot, require_folder, robot_from_toml

if TYPE_CHECKING:
    from missing_physics.reporting.pages.plot import Figure

__all__ = ["Answer", "diagnose", "with_doubts"]


@dataclass(frozen=True, repr=False)
class Answer:
    """The result of a diagnosis.

    Attributes:
        result: everything from which reports are made; ``result.diagnosis.to_dict()`` is `diagnosis.json`.
        nominal: the given robot.
        recordings: those that were fitted, then those that were only scored.
    """

    result: Result
    nominal: Robot
    recordings: tuple[Recording, ...]

    @property
    def verdict(self) -> str:
        """One of `missing_physics.results.result.Verdict`, such as ``explained`` or ``not_enough_data``."""
        return self.result.diagnosis.verdict

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The missing effects, each with effect, location, probability and parameters (value, ci95, unit)."""
        return self.result.diagnosis.findings

    @property
    def robot(self) -> Robot:
        """The robot with the findings, as in `robot.augmented.toml`."""
        return robot_from_toml(self.result.augmented_robot_toml)

    def summary(self, *, width: int = 100) -> str:
        """The output of the command, as text with `width` characters per line."""
        console = PlainConsole(file=io.StringIO(), width=width, color_system=None)
        print_summary(self.result, console)
        text = console.file.getvalue()  # type: ignore[attr-defined]
        return "\n".join(line.rstrip() for line in text.rstrip().splitlines())

    def plot(self, channel: str | None = None) -> Figure:
        """Recorded, nominal and augmented series over time, and their residuals, as a Plotly figure.

        Args:
            channel: such as ``joint1.torque``; by default the most informative one.

        Raises:
            InputError: nothing was compared, or not that channel.
        """
        return figure_of(self.result, self.nominal, channel)

    def save(self, out: PathLike) -> None:
        """Write diagnosis.json, report.html, comparison.rrd and robot.augmented.toml into the folder `out`.

        Files of an earlier diagnosis are replaced, all or none; other files are kept.

        Raises:
            InputError: the folder cannot be written.
        """
        from pathlib import Path

        require_folder(Path(out))
        write_outputs(self.result, self.nominal, Path(out), recordings=self.recordings)

    def __repr__(self) -> str:
        diagnosis = self.result.diagnosis
        return f"<Answer on {self.nominal.name}: {TITLE[diagnosis.verdict].lower()}, {named_text(diagnosis)}>"

    def _repr_html_(self) -> str:
        """The summary, for a notebook."""
        return f"<pre>{html.escape(self.summary())}</pre>"


def diagnose(
    robot: RobotLike,
    recordings: Any,
    validate: Any = (),
    *,
    overlay: PathLike | None = None,
    map: MapLike | None = None,
    cutoff: float | None = None,
    as_recorded: bool = False,
    seed: int = 0,
    size_limit: float = SIZE_LIMIT,
    rate: float | None = None,
    progress: bool | Callable[[str], None] = False,
) -> Answer:
    """Locate, name, model and prove the physics that a robot leaves out of recordings.

    Args:
        robot: as for `load_robot`.
        recordings: to fit; one or a list, each as for `load_recording`.
        validate: only scored, never fitted; one or a list. By default stretches of `recordings` are held out.
        overlay: as for `load_robot`.
        map: for recordings that are given as files or tables, as for `load_recording`.
        cutoff: of the low-pass filter [Hz]; found from the data when None.
        as_recorded: continue even if channels contradict each other or the motion.
        seed: of all random numbers.
        size_limit: of each file's variables in memory [bytes].
        rate: sampling rate to which recordings are decimated, with an anti-alias filter [Hz]; when None,
            only recordings with too many samples for a diagnosis are decimated, with a `UserWarning`.
        progress: True prints the current step to stderr; a function is called with a phrase for each step.

    Returns:
        The answer, which is the same for the same inputs and seed.

    Raises:
        InputError: what is wrong with an input, where, and how to correct it; channels that contradict each
            other, the motion or a premise of the diagnosis (`missing_physics.premises`). Mere doubts about a
            premise are `UserWarning`s.
        OutOfMemoryError: the machine has too little memory.
    """
    nominal, mapping = load_robot(robot, overlay=overlay), map_of(map)
    fitted, scored = (
        [
            load_recording(one, map=mapping, robot=nominal, check=not as_recorded, size_limit=size_limit)
            for one in several(sources)
        ]
        for sources in (recordings, validate if validate is not None else ())
    )
    options = Options(cutoff=cutoff, seed=seed, as_recorded=as_recorded)
    show = progress if callable(progress) else _print if progress else _silent
    every = thinned(nominal, (*fitted, *scored), rate=rate, tell=_warn)
    every = [on_both_sides(nominal, one) for one in every]
    fitted, scored = every[: len(fitted)], every[len(fitted) :]
    doubts = require_premises(nominal, every, mapping, as_recorded=as_recorded)
    for doubt in doubts:
        warnings.warn(f"{doubt.sentence}.", UserWarning, stacklevel=2)
    try:
        result = run_diagnosis(nominal, fitted, scored, options=options, progress=show)
    except ContradictionError as found:
        raise ContradictionError(found.recording, found.findings, mapping) from None
    return Answer(with_doubts(result, doubts), nominal, tuple(every))


def with_doubts(result: Result, doubts: Sequence[Problem]) -> Result:
    """A result whose diagnosis lists doubts about its premises, without notes."""
    sentences = (f"{doubt.sentence}." for doubt in doubts if doubt.severity != "note")
    diagnosis = result.diagnosis
    return replace(
        result, diagnosis=replace(diagnosis, could_not_tell=(*sentences, *diagnosis.could_not_tell))
    )


def _warn(sentence: str) -> None:
    warnings.warn(sentence, UserWarning, stacklevel=4)


def _print(phrase: str, *_: object) -> None:
    print(phrase, file=sys.stderr)


def _silent(phrase: str, *_: object) -> None:
    """Ignore progress."""
