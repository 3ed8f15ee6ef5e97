"""The inference core on the real machines: what it finds beyond the standard model, and what that is worth.

    python -m benchmarks.yardstick.inference [NAME...]

Writes `reports/evidence/inference.md`, or prints the rows that are named. The diagnosis does not use this
core yet; the page is how it is compared until it does. Settings are the same for all machines.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.evidence import EVIDENCE, head, number, table
from benchmarks.yardstick.loading import load
from benchmarks.yardstick.machines import Machine, machine, rows
from missing_physics.inference import Data, Posterior, search, weighed
from missing_physics.standard import StandardModel, fit_standard
from robot_model import InputError

__all__ = ["main"]

COMMAND = "python -m benchmarks.yardstick.inference"
#: An error larger by this factor is worse; one smaller by that factor is clearly better.
WORSE, BETTER = 1.02, 0.9
#: Probability from which an effect is listed.
LISTED = 0.5


def main(arguments: Sequence[str] | None = None) -> None:
    """Diagnose every machine, or those that are named."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="The inference core on real machines.")
    parser.add_argument("names", nargs="*", help="rows of the table; all when left out")
    given = parser.parse_args(arguments)
    lines: list[tuple[str, ...]] = []
    notes: list[str] = []
    for row in [machine(name) for name in given.names] or rows():
        print(f"{row.name} ...", file=sys.stderr, flush=True)
        try:
            with threadpool_limits(limits=1, user_api="blas"):
                lines += _lines(row)
        except InputError as error:
            notes.append(f"- {row.name}: {error}")
    page = "\n\n".join(_page(lines, notes)) + "\n"
    if given.names:
        print(page)
    else:
        (EVIDENCE / "inference.md").write_text(page, "utf-8")


def _page(lines: Sequence[tuple[str, ...]], notes: Sequence[str]) -> Iterator[str]:
    yield head("The inference core on real machines", command=COMMAND)
    ratios = np.array([float(line[5]) for line in lines if line[5]])
    yield (
        "rms of measured minus predicted torque of held-out recordings, in the band of the motion "
        f"[N m or N]. Of {ratios.size} joints the answer is worse than {WORSE} times the standard model at "
        f"{np.sum(ratios > WORSE)}, and more than {1.0 - BETTER:.0%} better at {np.sum(ratios < BETTER)}. "
        "The standard model is not yet chosen where it is better. Held-out recordings weigh the hypotheses, "
        "though not their numbers, so that these errors are a little optimistic. `effects` lists those "
        "with a probability above one half."
    )
    yield table(
        ("machine", "joint", "nominal:", "standard:", "answer:", "ratio:", "noise:", "effects", "seconds:"),
        lines,
    )
    if notes:
        yield "Not diagnosed:"
        yield "\n".join(notes)


def _lines(row: Machine) -> list[tuple[str, ...]]:
    loaded, began = load(row), time.process_time()
    standard = fit_standard(loaded.robot, loaded.fit)
    data = Data.of(standard, loaded.fit, loaded.held_out)
    known = weighed(search(data))
    seconds = time.process_time() - began
    return list(_joints(row, standard, data, known, loaded.held_out, seconds))


def _joints(
    row: Machine,
    standard: StandardModel,
    data: Data,
    known: Posterior,
    held_out: Sequence[object],
    seconds: float,
) -> Iterator[tuple[str, ...]]:
    best, unseen = known.answer, ~data.seen
    errors = standard.errors(held_out)  # type: ignore[arg-type]
    counts = data.counts
    for k, joint in enumerate(errors):
        if not counts[data.seen, k].any():
            continue
        rows_of_joint = counts[unseen, k].sum()
        answer = float(np.sqrt(best.errors[unseen, k].sum() / rows_of_joint)) if rows_of_joint else np.nan
        before = errors[joint]
        ratio = answer / before.standard
        effects = [
            f"{term.effect.id} {known.probability(term.key):.2f}"
            for term in best.hypothesis.terms
            if term.at.split(".")[0] in (joint, "base") and known.probability(term.key) > LISTED
        ]
        numbers = [number(v) for v in (before.nominal, before.standard, answer)]
        ratio_text = f"{ratio:.2f}" if np.isfinite(ratio) else ""
        late = best.number(f"{joint}.timing") * data.runs[0].motion.rate
        words = "; ".join([*effects, *([f"timing {late:.1f} samples"] if abs(late) > 1.5 else [])])
        yield (row.name, joint, *numbers, ratio_text, number(before.noise), words, f"{seconds:.1f}")


if __name__ == "__main__":
    main()
