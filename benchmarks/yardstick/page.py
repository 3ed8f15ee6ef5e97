"""The page of the real machines: answers compared with known effects, joint by joint."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import PurePath
from typing import Any

from benchmarks.evidence import head, number, percent, table
from benchmarks.yardstick.machines import Known, Machine
from benchmarks.yardstick.run import Answer
from missing_physics.plausibility import implausible
from robot_model import Robot

__all__ = ["impossible", "page", "worse"]

#: Insignificant factor by which an answer may predict held-out torque worse than the standard model.
NO_WORSE = 1.02
#: An answer is clearly better if its error is lower by this fraction.
CLEARLY = 0.9
#: Number of re-estimated parameters listed for each row, those farthest beyond their prior.
MOST = 3
HEADINGS = ("joint", "unit", "nominal:", "standard:", "answer:", "noise:", "answer / standard:")


def page(command: str, chosen: Sequence[Machine], answers: Sequence[Answer], robots: Sequence[Robot]) -> str:
    """The complete page.

    Args:
        command: that makes it.
        chosen: rows.
        answers: of each row.
        robots: nominal robot of each row.
    """
    parts = [head("The yardstick: real machines", command=command), INTRODUCTION]
    parts.append(_counts(answers, robots))
    parts.append(_overview(answers))
    for row, found in zip(chosen, answers):
        parts += _row(row, found)
    return "\n\n".join(parts) + "\n"


INTRODUCTION = (
    "Each row is one diagnosis of a real machine with its runs to fit and to hold out "
    "(`benchmarks/yardstick/machines.toml`), with the same settings for all; no machine is recognised. "
    "Errors are rms of measured minus predicted torque on the held-out runs (on stretches that were left "
    "out of the fit where there are none), on the same samples in the same band for the nominal "
    "robot file, the standard model (viscous and Coulomb friction, offset, rotor, base inertial "
    "parameters) and the robot file that was written (answer). Noise is what the sensors' noise leaves in "
    "it."
)


def _counts(answers: Sequence[Answer], robots: Sequence[Robot]) -> str:
    judged = [(found.machine, joint, e) for found in answers for joint, e in _joints(found)]
    ratios = [e["answer"] / e["standard"] for *_, e in judged if _positive(e["answer"], e["standard"])]
    behind = [f"{joint} of {name} ({ratio:.2f})" for name, joint, ratio in worse(answers)]
    beyond = [
        f"{joint} of {name} ({e['answer'] / e['nominal']:.2f})"
        for name, joint, e in judged
        if _positive(e["answer"], e["nominal"]) and e["answer"] > NO_WORSE * max(e["nominal"], e["noise"])
    ]
    better = sum(ratio < CLEARLY for ratio in ratios)
    faults = sum(found.refused.startswith("FAULT") for found in answers)
    refused = sum(bool(found.refused) for found in answers) - faults
    odd = [what for found, robot in zip(answers, robots) for what in impossible(found, robot)]
    diagnosed = [found for found in answers if found.diagnosis]
    silent = [f"{joint} of {a.machine}" for a in diagnosed for joint in (a.diagnosis or {})["not_judged"]]
    commits = ", ".join(sorted({found.commit for found in answers}))
    lines = [
        f"{len(answers)} rows, {refused} of them refused in a sentence and {faults} ended in a fault; "
        f"answered by the program at {commits}.",
        f"{len(ratios)} joints with an error of both the standard model and the answer: the answer is "
        f"worse than {NO_WORSE} times the standard model at {_listed(behind)}, better by more than 10 % at "
        f"{better}.",
        f"Joints at which the answer is worse than {NO_WORSE} times the nominal robot file: "
        f"{_listed(beyond)}.",
        f"Statements beyond what machines can be (`missing_physics.plausibility`): {_listed(odd)}.",
        f"Joints that could not be judged: {_listed(silent)}.",
    ]
    return "\n".join(f"- {line}" for line in lines)


def _overview(answers: Sequence[Answer]) -> str:
    """Verdict, residual, and cost, one line for each row."""
    rows = []
    for found in answers:
        verdict = "refused" if found.diagnosis is None else found.diagnosis["verdict"]
        left = [_left(e) for _, e in _joints(found)]
        known = [part for part in left if part is not None]
        rows.append(
            (
                found.machine,
                verdict,
                percent(max(known), 1) if known else "",
                "" if found.diagnosis is None else str(len(found.diagnosis["findings"])),
                f"{found.seconds:.0f}",
                f"{found.megabytes:.0f}",
            )
        )
    return table(("machine", "verdict", "left at the worst joint:", "named:", "s:", "MB:"), rows) + (
        "\n\nLeft: held-out mismatch energy beyond the noise under the answer, in parts of that under the "
        "nominal robot file."
    )


def _left(errors: Mapping[str, Any]) -> float | None:
    noise = errors["noise"] or 0.0
    if not _positive(errors["nominal"], errors["answer"]) or errors["nominal"] <= noise:
        return None
    before, after = (max(errors[key] ** 2 - noise**2, 0.0) for key in ("nominal", "answer"))
    return float(after / before)


def worse(answers: Sequence[Answer]) -> Iterator[tuple[str, str, float]]:
    """Machine, joint and ratio where the answer predicts worse than the standard model beyond the noise."""
    for found in answers:
        for joint, errors in _joints(found):
            if not _positive(errors["answer"], errors["standard"]):
                continue
            ratio = errors["answer"] / errors["standard"]
            if ratio > NO_WORSE and errors["answer"] > (errors["noise"] or 0.0):
                yield found.machine, joint, ratio


def impossible(found: Answer, robot: Robot) -> Iterator[str]:
    """Named effects of one machine with values that no machine has."""
    for finding in found.diagnosis["findings"] if found.diagnosis else ():
        values = {name: e["value"] for name, e in finding["parameters"].items() if e["value"] is not None}
        if finding["effect"] != "torque_saturation" or "limit" in values:
            why = implausible(finding["effect"], finding["location"], values, robot)
            if why:
                yield f"{finding['effect']} at {finding['location']} of {found.machine} ({why})"


def _row(row: Machine, found: Answer) -> Iterator[str]:
    yield f"## {row.name}"
    if row.remark:
        yield row.remark
    yield _known(row.known)
    spent = f"{found.seconds:.0f} s of one processor, {found.megabytes:.0f} MB, at {found.commit}."
    if found.diagnosis is None:
        yield f"Not diagnosed: {found.refused} {spent}"
        return
    diagnosis = found.diagnosis
    named = [
        f"{f['effect']} at {f['location']} ({f['probability']:.2f}; {_values(f['parameters'])})"
        for f in diagnosis["findings"]
    ]
    sentences = [
        f"Verdict **{diagnosis['verdict']}**. Named: {'; '.join(named) or 'nothing'}.",
        *_moved(diagnosis),
    ]
    if diagnosis["comparison"]["words"]:
        sentences.append(diagnosis["comparison"]["words"])
    if diagnosis["unnamed"]:
        sentences.append("Forces without a name: " + " ".join(one["words"] for one in diagnosis["unnamed"]))
    timing = list(_timing(diagnosis["timing"]))
    if timing:
        sentences.append(f"Delay of the torque: {'; '.join(timing)}.")
    yield " ".join([*sentences, spent])
    lines = [
        *_lines(found),
        *((joint, "", "not judged", "", "", "", "") for joint in diagnosis["not_judged"]),
    ]
    if lines:
        yield table(HEADINGS, lines)


def _lines(found: Answer) -> Iterator[tuple[str, ...]]:
    for joint, errors in _joints(found):
        ratio = _positive(errors["answer"], errors["standard"])
        yield (
            joint,
            errors["unit"],
            *(_cell(errors[key]) for key in ("nominal", "standard", "answer", "noise")),
            f"{errors['answer'] / errors['standard']:.2f}" if ratio else "",
        )


def _moved(diagnosis: Mapping[str, Any]) -> Iterator[str]:
    """Parameters of the robot file with estimates outside their credible range."""
    moved = [
        f"{c['name']} {number(c['estimate'])} {c['unit']} (file {number(c['nominal'])})"
        for c in diagnosis["nominal_changes"]
        if None not in c["prior95"] and not c["prior95"][0] <= c["estimate"] <= c["prior95"][1]
    ]
    if moved:
        more = f" and {len(moved) - MOST} more" if len(moved) > MOST else ""
        yield f"Numbers beyond what was credible: {', '.join(moved[:MOST])}{more}."


def _timing(timing: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    for one in timing:
        if abs(one["samples"]) < 0.005:  # none in two digits
            continue
        where = PurePath(one["recording"]).name or "all recordings"
        undone = ", undone" if one["undone"] else ""
        yield f"{one['samples']:.2f} samples in {where} ({one['channel']}{undone})"


def _known(known: Sequence[Known]) -> str:
    if not known:
        return "Nothing is known of what the description lacks."
    alike: dict[tuple[str, str], list[str]] = {}
    for item in known:
        values = ", ".join(f"{name} {number(value)}" for name, value in item.values.items())
        inside = "; ".join(part for part in (values, item.words, item.source) if part)
        alike.setdefault((item.effect, inside), []).append(item.at)
    parts = [f"{effect} at {', '.join(places)} ({inside})" for (effect, inside), places in alike.items()]
    return "Known: " + "; ".join(parts) + "."


def _values(parameters: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {_cell(e['value'])} {e['unit']}" for name, e in parameters.items())


def _joints(found: Answer) -> Iterator[tuple[str, dict[str, Any]]]:
    """Held-out errors of each joint whose torque is compared."""
    if found.diagnosis is None:
        return
    silent = set(found.diagnosis["not_judged"])
    for channel, fit in found.diagnosis["fit"]["channels"].items():
        joint, _, quantity = channel.rpartition(".")
        if quantity != "torque" or joint in silent:
            continue
        yield (
            joint,
            {
                "unit": fit["unit"],
                "nominal": fit["before"]["validation_rms"],
                "standard": (fit.get("standard") or {}).get("validation_rms"),
                "answer": fit["after"]["validation_rms"],
                "noise": fit["noise_floor"],
            },
        )


def _listed(items: Sequence[str]) -> str:
    return f"{len(items)} ({'; '.join(items)})" if items else "none"


def _positive(*values: float | None) -> bool:
    return all(value is not None and math.isfinite(value) and value > 0.0 for value in values)


def _cell(value: float | None) -> str:
    return "" if value is None else number(value)
