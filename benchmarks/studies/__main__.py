"""The page of all studies.

    python -m benchmarks.studies

Writes `reports/evidence/paper_systems.md`. Takes some minutes.
"""

from __future__ import annotations

from time import process_time

from benchmarks.evidence import EVIDENCE, head
from benchmarks.studies import (
    clearance,
    energy,
    fixed_steps,
    ground_orbit,
    hinges,
    network,
    sliding,
    stiffness,
    temperature,
)
from robot_model import write_atomically

__all__ = ["main"]

COMMAND = "python -m benchmarks.studies"
NAME = "paper_systems"
SECTIONS = (
    *(temperature.section, ground_orbit.section, energy.section, fixed_steps.section, hinges.section),
    *(network.section, sliding.section, clearance.section, stiffness.section),
)

INTRODUCTION = """\
Liu, Li, Wang, Cai, *Dynamics analysis of flexible space robot with joint friction*, Aerospace Science and
Technology 47 (2015) 164-176, cite in their introduction works on friction in space robots. Each section
studies one of them, with that work's system as far as its publication, or literature on it, describes it.
**Definitions and values that are this project's own are marked in the section; no number here is another
author's result.**"""


def main() -> None:
    """Simulate and write."""
    began = process_time()
    parts = [head("Systems of the paper's introduction", command=COMMAND), INTRODUCTION]
    parts += [section() for section in SECTIONS]
    took = f"The studies took {process_time() - began:.0f} s of one processor."
    write_atomically(EVIDENCE / f"{NAME}.md", "\n\n".join([*parts, took]) + "\n")


if __name__ == "__main__":
    main()
