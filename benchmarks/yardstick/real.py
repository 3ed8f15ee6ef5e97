"""Every real machine diagnosed: `reports/evidence/yardstick.md`.

    python -m benchmarks.yardstick.real [NAME...] [--again] [--label engine-1]

Settings are the same for all machines. Answers are kept under `reports/yardstick/LABEL/`, so that an
interrupted run goes on; the page is written from them.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from benchmarks.evidence import EVIDENCE, ROOT, command_line, head, number, table
from benchmarks.yardstick.machines import Known, Machine, machine, rows
from benchmarks.yardstick.run import Answer, answer, answers_folder

__all__ = ["main"]

COMMAND = "python -m benchmarks.yardstick.real"
#: An answer may predict held-out torque worse than the standard model by this much: what is not significant.
NO_WORSE = 1.02
#: And is clearly better where its error is lower by this part.
CLEARLY = 0.9


def main(arguments: Sequence[str] | None = None) -> None:
    """Diagnose all machines, or those that are named, and write the page."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Every real machine diagnosed.")
    parser.add_argument("names", nargs="*", help="rows of the table; all when left out")
    parser.add_argument("--again", action="store_true", help="diagnose rows that were answered before, too")
    parser.add_argument("--label", default="now", help="name of the folder that keeps the answers")
    given = parser.parse_args(arguments)
    folder = answers_folder(ROOT, given.label)
    chosen = [machine(name) for name in given.names] or rows()
    answers = []
    for row in chosen:
        print(f"{row.name} ...", file=sys.stderr, flush=True)
        answers.append(answer(row, folder, again=given.again))
    page = "\n\n".join(_page(command_line(parser, given, ["label"]), chosen, answers)) + "\n"
    if given.names:
        print(page)
    else:
        (EVIDENCE / "yardstick.md").write_text(page, "utf-8")


def _page(command: str, chosen: Sequence[Machine], answers: Sequence[Answer]) -> Iterator[str]:
    yield head("The yardstick: real machines", command=command)
    yield (
        "Each row is one diagnosis of a real machine with its runs to fit and to hold out "
        "(`benchmarks/yardstick/machines.toml`), with the same settings for all. Errors are rms of measured "
        "minus predicted torque on the held-out runs, in the same band for the nominal robot, the standard "
        "model (viscous and Coulomb friction, offset, rotor, base inertial parameters) and the answer."
    )
    yield _counts(chosen, answers)
    for row, found in zip(chosen, answers):
        yield from _row(row, found)


def _counts(chosen: Sequence[Machine], answers: Sequence[Answer]) -> str:
    judged = [errors for found in answers for _, errors in _channels(found)]
    ratios = [e["answer"] / e["standard"] for e in judged if _positive(e["answer"], e["standard"])]
    worse = sum(ratio > NO_WORSE for ratio in ratios)
    better = sum(ratio < CLEARLY for ratio in ratios)
    faults = sum(found.refused.startswith("FAULT") for found in answers)
    refused = sum(bool(found.refused) for found in answers) - faults
    return (
        f"{len(chosen)} rows; {len(ratios)} joints with an error of both the standard model and the answer: "
        f"the answer is worse than {NO_WORSE} times the standard model at {worse} of them and better by more "
        f"than 10 % at {better}. {refused} rows were refused in a sentence, {faults} ended in a fault."
    )


def _row(row: Machine, found: Answer) -> Iterator[str]:
    yield f"## {row.name}"
    if row.remark:
        yield row.remark
    yield _known(row.known)
    spent = f"{found.seconds:.0f} s of one processor, {found.megabytes:.0f} MB."
    if found.refused:
        yield f"Not diagnosed: {found.refused} {spent}"
        return
    assert found.diagnosis is not None
    named = [
        f"{f['effect']} at {f['location']} ({f['probability']:.2f}; {_values(f['parameters'])})"
        for f in found.diagnosis["findings"]
    ]
    yield f"Verdict **{found.diagnosis['verdict']}**. Named: {'; '.join(named) or 'nothing'}. {spent}"
    lines = [
        (
            channel,
            errors["unit"],
            *(_cell(errors[key]) for key in ("nominal", "standard", "answer", "noise")),
            _cell(errors["answer"] / errors["standard"]) if _positive(errors["standard"]) else "",
        )
        for channel, errors in _channels(found)
    ]
    headings = ("channel", "unit", "nominal:", "standard:", "answer:", "noise:", "answer / standard:")
    if lines:
        yield table(headings, lines)


def _known(known: Sequence[Known]) -> str:
    if not known:
        return "Nothing is known of what the description lacks."
    parts = []
    for item in known:
        values = ", ".join(f"{name} {number(value)}" for name, value in item.values.items())
        inside = "; ".join(part for part in (values, item.words, item.source) if part)
        parts.append(f"{item.effect} at {item.at} ({inside})")
    return "Known: " + "; ".join(parts) + "."


def _values(parameters: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {number(e['value'])} {e['unit']}" for name, e in parameters.items())


def _channels(found: Answer) -> Iterator[tuple[str, dict[str, Any]]]:
    """Held-out errors of each torque channel."""
    if found.diagnosis is None:
        return
    for channel, fit in found.diagnosis["fit"]["channels"].items():
        if not channel.endswith(".torque"):
            continue
        standard = fit.get("standard") or {}
        yield (
            channel,
            {
                "unit": fit["unit"],
                "nominal": fit["before"]["validation_rms"],
                "standard": standard.get("validation_rms"),
                "answer": fit["after"]["validation_rms"],
                "noise": fit["noise_floor"],
            },
        )


def _positive(*values: float | None) -> bool:
    return all(value is not None and math.isfinite(value) and value > 0.0 for value in values)


def _cell(value: float | None) -> str:
    return "" if value is None else number(value)


if __name__ == "__main__":
    main()
