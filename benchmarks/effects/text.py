"""Text of the page of `effects_study`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from benchmarks.effects.ranges import GEARS
from benchmarks.effects.runs import ATTEMPTS, Key, Row
from benchmarks.evidence import head, number, paragraph, percent, table
from missing_physics.challenge.scoring.information import IDENTIFIABLE
from missing_physics.challenge.scoring.shares import wilson
from missing_physics.wording.numbers import within_text
from reference_model.effects.catalogue import catalogue

__all__ = ["COMPANION", "absent", "companions", "covered", "finding_text", "page", "reason", "strangers"]

INTRODUCTION = f"""\
Each effect of the catalogue is left out, alone, of a shipped robot that was varied as in the blind
challenge (masses, lengths, rotors, friction, sensors, controller, motion). Exudyn moves the real robot;
its sensors add noise, resolution and their own faults; the diagnosis gets the robot file without the
effect and two recordings of other motions, one to fit and one that is only scored. Parameters are drawn
over credible ranges, {ATTEMPTS} times at most, until by the true model the effect is distinguishable in both
recordings from noise and from errors of the nominal robot of 30 % (by {IDENTIFIABLE:g}, twice a
log-likelihood, `missing_physics/challenge/scoring/information.py`). An effect with the same distance to every
rival that is no less simple is called identifiable; the others have a twin in the recorded channels, and can
only be listed together with it. Effects without regressors along a motion (links, base, contact), gears and
temperature must make the recordings differ from the nominal robot's simulations by as much; no rival is
considered. Robots with links that bend are drawn once, since they take long to simulate; effects of joints,
actuators and sensors on the free-flying one come last. A case whose effect is not distinguishable in both
recordings is also diagnosed, but not counted."""
COLUMNS = """\
*Place* is right where every hidden place has a finding or, with nothing named, a located mismatch; *name*
where the effect is named at its place, "in the set" where it is listed as an equally good explanation.
*Beside* lists wrong additional names. *Share* is the reduction of the held-out closed-loop error relative to
that of the true robot; "-" where the torques of nominal and true robot differ by less than 5 %, or where no
simulation of a robot file can reproduce the recording (warming)."""
#: A spring that the catalogue lets the flanks of a gear have of their own is named by its own effect.
COMPANION = dict.fromkeys(GEARS[1:], "joint_elasticity")
#: Words of a sentence of `could_not_tell`.
REFUSED = "is not named"


def page(rows: Sequence[Row], *, command: str, missing: Sequence[Key] = ()) -> str:
    """The complete page, in Markdown; `missing` are cases that have not been run."""
    parts = [head("Every effect, alone", command=command), INTRODUCTION, _seeds(rows), absent(missing)]
    parts += [_summary(rows), COLUMNS]
    parts += ["## Effect by effect", *(_section(effect, own) for effect, own in _by_effect(rows).items())]
    return "\n\n".join(part for part in parts if part) + "\n"


def _seeds(rows: Sequence[Row]) -> str:
    numbers = sorted(row.key.number for row in rows)
    commits = sorted({row.made_at for row in rows if row.made_at})
    made = f" The engine made the recordings at commit {', '.join(commits)}." if commits else ""
    return f"Seeds of the cases: {', '.join(map(str, numbers))}.{made}"


def absent(missing: Sequence[Key]) -> str:
    """Cases missing on the page."""
    if not missing:
        return ""
    names = ", ".join(f"{key.number} ({key.effect})" for key in sorted(missing, key=lambda key: key.number))
    return f"Without an answer, and not on this page: {names}."


def _by_effect(rows: Sequence[Row]) -> dict[str, list[Row]]:
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row.key.effect, []).append(row)
    return found


def _summary(rows: Sequence[Row]) -> str:
    """Counts over all cases in which the effect is observable."""
    shown = [row for row in rows if row.shown]
    able = [row for row in shown if row.identifiable]
    twins = [row for row in shown if not row.identifiable]
    intervals = [inside for row in shown for _, inside in covered(row) if inside is not None]
    confident = sum(any(f["probability"] > 0.9 for f in strangers(row)) for row in able)
    shares = [row.improvement for row in shown if row.improvement is not None and row.name_right]
    counts = [
        ["place right", _share(sum(row.place_right for row in shown), len(shown))],
        ["name right, identifiable", _share(sum(row.name_right for row in able), len(able))],
        ["named or in the stated set, not identifiable", _share(sum(r.in_set for r in twins), len(twins))],
        ["a wrong name above 0.9, identifiable", _share(confident, len(able))],
        ["true parameters inside their 95 % intervals", _share(sum(intervals), len(intervals))],
        [
            "at least 80 % of the true model's improvement, named",
            _share(sum(s >= 0.8 for s in shares), len(shares)),
        ],
    ]
    failed = [effect for effect, own in _by_effect(able).items() if not all(r.name_right for r in own)]
    words = f"Identifiable and not named in every case: {', '.join(failed)}." if failed else ""
    unable = [f"{row.key.number} ({row.key.effect})" for row in rows if not row.shown]
    note = f"Not counted, for reasons that stand with each case: {', '.join(unable)}." if unable else ""
    return table(["", "cases (95 % interval):"], counts) + "\n\n" + paragraph(words, note)


def _share(hits: int, count: int) -> str:
    low, high = wilson(hits, count)
    return f"{hits} of {count} ({100 * low:.0f} to {100 * high:.0f} %)" if count else "-"


def _section(effect: str, rows: Sequence[Row]) -> str:
    headings = ["case", "robot, place", "true", "verdict", "place", "name", "probability:", "estimates"]
    headings += ["beside", "share:", "time:"]
    lines = [_line(row) for row in rows]
    reasons = [f"- {row.key.number}: {words}" for row in rows if (words := _remark(row))]
    return "\n\n".join(filter(None, [f"### {effect}", table(headings, lines), "\n".join(reasons)]))


def _line(row: Row) -> list[str]:
    own = _own(row)
    true = ", ".join(f"{name} {number(value)}" for name, value in row.truth.items() if value)
    beside = "; ".join(finding_text(finding) for finding in strangers(row))
    counted = "" if row.shown else ", not counted"
    return [
        str(row.key.number),
        f"{row.robot}, {row.place}",
        true,
        row.verdict,
        ("yes" if row.place_right else "no") + counted,
        ("yes" if row.name_right else "in the set" if row.in_set else "no") + counted,
        f"{own['probability']:.3g}" if own else "-",
        "; ".join(words for words, _ in covered(row)) or "-",
        beside or "-",
        percent(row.improvement, 0) if row.improvement is not None else "-",
        f"{row.seconds:.0f} s" if row.seconds else "-",
    ]


def _own(row: Row) -> Mapping[str, Any] | None:
    return next((f for f in row.findings if f"{f['effect']}@{f['location']}" == row.label), None)


def companions(row: Row) -> list[Mapping[str, Any]]:
    """Findings that name a part of the hidden effect separately."""
    name = COMPANION.get(row.key.effect)
    return [f for f in row.findings if (f["effect"], f["location"]) == (name, row.place)]


def strangers(row: Row) -> list[Mapping[str, Any]]:
    """Findings that are not hidden."""
    known = [_own(row), *companions(row)]
    return [finding for finding in row.findings if finding not in known]


def covered(row: Row) -> Iterator[tuple[str, bool | None]]:
    """Every estimate of the hidden effect in words, and whether the truth is inside its interval."""
    for finding in [f for f in (_own(row), *companions(row)) if f is not None]:
        for name, item in finding["parameters"].items():
            low, high = item["ci95"]
            true = row.truth.get(name)
            if true is None or low is None or high is None:
                yield f"{name} {number(item['value'])}", None
                continue
            inside = bool(low <= true <= high)
            note = "" if inside else ", truth outside"
            yield f"{name} {within_text(item['value'], (low, high))}{note}", inside


def finding_text(finding: Mapping[str, Any]) -> str:
    """Name, place, probability and equally possible effects."""
    rivals = ", ".join(finding["ambiguous_with"])
    words = f"{finding['effect']}@{finding['location']} {finding['probability']:.3g}"
    return f"{words} (or {rivals})" if rivals else words


def _kin(row: Row, finding: Mapping[str, Any]) -> bool:
    """Whether it is another law of the hidden one's family at the same place, on a lower rung."""
    true, named = catalogue()[row.key.effect], catalogue()[finding["effect"]]
    same = true.family is not None and true.family == named.family and finding["location"] == row.place
    return same and named.rung < true.rung


def _remark(row: Row) -> str:
    """The reason, and that the case is not counted where it is not."""
    words = reason(row)
    if row.shown or not words:
        return words
    return f"{'Named, but not counted' if row.name_right else 'Not counted'}: {words}"


def reason(row: Row) -> str:
    """Why a case is not right, according to the answer itself; empty if it is right."""
    if row.message:
        return row.message.strip().splitlines()[-1]
    missed = [words.split(" ")[0] for words, inside in covered(row) if inside is False]
    outside = f"The interval of {' and '.join(missed)} misses the truth." if missed else ""
    if not row.shown:
        faint = f"by the true model its strength in one of the two recordings is {number(row.strength)} only,"
        return paragraph(f"{faint} and {IDENTIFIABLE:g} is needed in both.", outside)
    if row.name_right and not strangers(row):
        return outside
    own = [s for s in row.left if REFUSED in s and row.place.split(".")[0] in s]
    if row.name_right:
        return paragraph("Named, and a wrong effect besides.", outside, *own[:1])
    if row.in_set:
        return "Listed among the explanations that fit alike; another one leads."
    if not row.identifiable:
        return "A twin in the recorded channels is named without it: the answer should list both."
    if any(_kin(row, finding) for finding in row.findings):
        return paragraph(
            "A simpler law of its family is named: the diagnosis found no need for more.", *own[:1]
        )
    if row.findings:
        return paragraph("Another effect is named.", *own[:1])
    return paragraph("Nothing is named.", *(own[:1] or row.left[:1]))
