"""The printed summary, readable in ten seconds."""

from __future__ import annotations

import math
from itertools import chain

from rich.console import Console
from rich.padding import Padding
from rich.text import Text

from missing_physics.reporting.elements.comparison import (
    EXPENDABLE,
    HEADINGS,
    NUMBERS,
    comparison_note,
    comparison_rows,
    timing_lines,
)
from missing_physics.reporting.elements.formatting import (
    finding_text,
    number,
    percent,
    plus_minus_text,
    probability_text,
    rival_text,
    undetermined_text,
)
from missing_physics.reporting.elements.verdicts import (
    ABSENT,
    MOVED,
    TITLE,
    by_place,
    improvement_text,
    located_first_to_last,
    meaning,
    moved_texts,
    named_text,
    not_judged_text,
)
from missing_physics.reporting.terminal.tables import number_table
from missing_physics.results.result import ChannelFit, Diagnosis, Mismatch, Result

__all__ = ["print_summary"]

STYLE = {
    "explained": "bold green",
    "partly_explained": "bold yellow",
    "ambiguous": "bold yellow",
    "unexplained": "bold red",
    "consistent": "bold cyan",
    "not_enough_data": "bold magenta",
}
#: Longer lists are cut here; the report has all of them.
MOST_LISTED = 8
INDENT = (0, 0, 0, 2)


def print_summary(result: Result, console: Console) -> None:
    """Print the answer, top down; plain text when `console` is not a terminal."""
    diagnosis = result.diagnosis
    _headline(diagnosis, console)
    _comparison(diagnosis, console)
    _list(MOVED, moved_texts(diagnosis), console)
    _mismatch(diagnosis, console)
    _findings(diagnosis, console)
    _list("Forces without a name", [item.words for item in diagnosis.unnamed], console)
    _fit(diagnosis, console)
    _list("Next experiment", [e.do for e in diagnosis.experiments], console)
    _list("Could not tell", list(diagnosis.could_not_tell), console)


def _headline(diagnosis: Diagnosis, console: Console) -> None:
    line = Text(TITLE[diagnosis.verdict].upper(), style=STYLE[diagnosis.verdict])
    named = named_text(diagnosis)
    line.append(f": {named}" if named != ABSENT else "", style="bold")
    console.print(line.append(not_judged_text(diagnosis), style="bold"))
    why_below = diagnosis.verdict == "not_enough_data" and bool(diagnosis.could_not_tell)
    explained_below = bool(diagnosis.mismatch or diagnosis.findings or diagnosis.unnamed or why_below)
    console.print(Text(meaning(diagnosis) if explained_below else diagnosis.summary))


def _comparison(diagnosis: Diagnosis, console: Console) -> None:
    """Held-out errors of nominal robot, standard model and answer, joint by joint."""
    rows, note = comparison_rows(diagnosis), comparison_note(diagnosis)
    if rows:
        _heading("Torque error on data that were not fitted (rms)", console)
        console.print(number_table(rows, console, headings=HEADINGS, right=NUMBERS, expendable=EXPENDABLE))
    for line in [*([note] if note else []), *timing_lines(diagnosis)]:
        console.print(Padding(Text(line), INDENT, expand=False) if rows else Text(line))


def _mismatch(diagnosis: Diagnosis, console: Console) -> None:
    if diagnosis.mismatch:
        _heading("Where model and recording differ", console)
    for item in located_first_to_last(diagnosis)[:MOST_LISTED]:
        console.print(Padding(Text(_mismatch_words(item)), INDENT, expand=False))


def _mismatch_words(item: Mismatch) -> str:
    return item.words or f"{item.channel}: {percent(item.share)} of the mismatch"


def _findings(diagnosis: Diagnosis, console: Console) -> None:
    if diagnosis.findings:
        _heading("What is missing", console)
    for finding in chain.from_iterable(by_place(diagnosis).values()):
        line = Text(finding_text(finding), style="bold")
        line.append(f"  {probability_text(finding.probability)}", style="not bold")
        if finding.ambiguous_with:
            rivals = ", ".join(rival_text(rival, finding.location) for rival in finding.ambiguous_with)
            line.append(f"  cannot be told apart from: {rivals}", style="not bold yellow")
        console.print(Padding(line, INDENT, expand=False))
        if finding.note:
            console.print(Padding(Text(finding.note), (0, 0, 0, 4), expand=False))
        narrowed = [(name, plus_minus_text(e)) for name, e in finding.parameters.items() if e.narrowed]
        if narrowed:
            console.print(number_table(narrowed, console, indent=4))
        if text := undetermined_text(finding):
            console.print(Padding(Text(text), (0, 0, 0, 4), expand=False))


def _fit(diagnosis: Diagnosis, console: Console) -> None:
    if not diagnosis.fit.channels:
        return
    gain = improvement_text(diagnosis)
    rows = []
    shown = diagnosis.comparison.channels
    for channel, fit in diagnosis.fit.channels.items():
        if channel in shown and fit.after == shown[channel].answer:
            continue  # in the first table
        rows.append((channel, _errors(fit), f"(noise {number(fit.noise_floor)})"))
    if rows or gain != ABSENT:
        _heading("On held-out data" + (f": error lower by {gain}" if gain != ABSENT else ""), console)
    if rows:
        console.print(number_table(rows, console, expendable=(2,)))


def _errors(fit: ChannelFit) -> str:
    before, after = fit.before.validation_rms, fit.after.validation_rms
    if math.isnan(before) or math.isnan(after):
        return "does not move in the held-out data"
    return f"{number(before)} -> {number(after)} {fit.unit} rms"


def _list(heading: str, items: list[str], console: Console) -> None:
    if not items:
        return
    _heading(heading, console)
    for item in items[:MOST_LISTED]:
        console.print(Padding(Text(f"- {item}"), INDENT, expand=False))
    if len(items) > MOST_LISTED:
        console.print(
            Padding(Text(f"- and {len(items) - MOST_LISTED} more, see the report"), INDENT, expand=False)
        )


def _heading(words: str, console: Console) -> None:
    console.print()
    console.print(Text(words, style="bold underline"))
