"""Time and memory of whole diagnoses, and the time of their stages.

    python -m benchmarks.speed.diagnosis_time [--case NAME] [--out FILE]

Simulated chains of six and seven joints with hidden friction, and real machines whose recordings are here.
Each diagnosis runs in a process of its own, one at a time; reading and simulating are not timed.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.evidence import EVIDENCE, head, paragraph, peak_memory, table
from benchmarks.speed.chains import chain
from benchmarks.yardstick.loading import load
from benchmarks.yardstick.machines import machine
from missing_physics.diagnosis import Options, diagnose
from missing_physics.recordings.datasets import find_dataset
from reference_model.simulation import simulate
from robot_model import EffectUse, MultiSine, Recording, Reference, Robot, write_atomically

__all__ = ["CASES", "Case", "Stages", "main", "measured", "page", "recorded_chain"]

COMMAND = "python -m benchmarks.speed.diagnosis_time"
PAGE = EVIDENCE / "diagnosis_time.md"
#: Goal for the peak of memory [MB].
MEMORY = 1000.0
#: Motion of simulated joints: amplitudes [rad], frequencies [Hz].
AMPLITUDES, FREQUENCIES = (0.6, 0.25), (0.11, 0.37)
#: Stage by the beginning of the phrase that starts it; other phrases belong to the running stage.
STAGES = {
    "estimating motion": "motion and torque in the band of the motion",
    "checking the channels": "contradictions of channels, coverage of joints",
    "fitting the standard model": "standard model",
    "weighing hypotheses on the transmissions": "hypotheses on transmissions",
    "weighing hypotheses on the rates": "hypotheses on the base",
    "weighing hypotheses": "rows, screening and fits of hypotheses",
    "comparing effects with their rivals": "rivals of the named effects, and further rounds",
    "searching for forces": "unnamed forces, guard, bodies, findings",
    "designing motions": "design of experiments",
    "locating the mismatch": "location of the mismatch, robot file",
    "comparing with the standard model": "comparison on the same samples, verdict",
    "weighing waves": "waves above the band of the motion",
}
#: Time before the first phrase.
FIRST = "checks of robot and recordings"


@dataclass
class Stages:
    """Times the stages of a diagnosis by the phrases of its progress."""

    clock: Callable[[], float] = time.monotonic
    seconds: dict[str, float] = field(default_factory=dict)
    running: str = FIRST

    def __post_init__(self) -> None:
        self._since = self.clock()

    def __call__(self, phrase: str) -> None:
        """End the running stage if `phrase` begins another one."""
        for beginning, stage in STAGES.items():
            if phrase.startswith(beginning):
                self.end(stage)
                return

    def end(self, following: str = "") -> None:
        """Add the time since the last stage began to the running one."""
        now = self.clock()
        self.seconds[self.running] = self.seconds.get(self.running, 0.0) + now - self._since
        self.running, self._since = following, now


@dataclass(frozen=True)
class Case:
    """A diagnosis to be timed: title, goal [s] (None without one), and how robot and recordings are made."""

    title: str
    goal: float | None
    made: Callable[[], tuple[Robot, list[Recording], list[Recording]]]


def recorded_chain(
    joints: int, seconds: float, rate: float
) -> tuple[Robot, list[Recording], list[Recording]]:
    """A chain whose joints have friction that its file lacks, and its recording by the reference model."""
    motion = tuple(
        MultiSine(
            joint=f"joint{k}",
            amplitudes=AMPLITUDES,
            frequencies=tuple(f * (1 + 0.13 * k) for f in FREQUENCIES),
            phases=(0.3 + k, 1.1 - k),
            ramp=1.0,
        )
        for k in range(1, joints + 1)
    )
    nominal = chain(joints).model_copy(
        update={"reference": Reference(duration=seconds, sample_rate=rate, joints=motion)}
    )
    hidden = [
        EffectUse.model_validate({"effect": "coulomb_friction", "at": "joint2", "torque": 4.0}),
        EffectUse.model_validate({"effect": "viscous_friction", "at": "joint2", "coefficient": 2.0}),
        EffectUse.model_validate({"effect": "coulomb_friction", "at": f"joint{joints - 1}", "torque": 1.5}),
    ]
    return nominal, [simulate(nominal.with_effects(*hidden), seed=1)], []


def _machine(name: str) -> tuple[Robot, list[Recording], list[Recording]]:
    loaded = load(machine(name))
    return loaded.robot, list(loaded.fit), list(loaded.held_out)


#: Cases of real machines; their names are those of their datasets.
REAL = ("emps", "kuka_kr300", "kinova_gen3")
#: Every case by its name.
CASES = {
    "six": Case("simulated, 6 joints, 60 s at 100 Hz", 30.0, lambda: recorded_chain(6, 60.0, 100.0)),
    "seven": Case("simulated, 7 joints, 60 s at 100 Hz", 30.0, lambda: recorded_chain(7, 60.0, 100.0)),
    "seven_fast": Case("simulated, 7 joints, 20 s at 1 kHz", 60.0, lambda: recorded_chain(7, 20.0, 1000.0)),
    "emps": Case("EMPS, 1 joint, 50 s at 1 kHz", 10.0, lambda: _machine("emps")),
    "kuka_kr300": Case("KUKA KR300, 6 joints, 20 s at 250 Hz", 30.0, lambda: _machine("kuka_kr300")),
    "kinova_gen3": Case("Kinova Gen3, 7 joints, 48 s at 1 kHz", 60.0, lambda: _machine("kinova_gen3")),
}


def measured(name: str) -> dict[str, Any]:
    """One diagnosis in this process: seconds of the whole and of its stages, peak of memory [MB], answer."""
    robot, fitted, held_out = CASES[name].made()
    stages = Stages()
    began, worked = time.monotonic(), time.process_time()
    result = diagnose(robot, fitted, held_out, options=Options(experiments=False), progress=stages)
    stages.end()
    return {
        "case": name,
        "wall": time.monotonic() - began,
        "processor": time.process_time() - worked,
        "megabytes": peak_memory(),
        "samples": sum(len(one) for one in (*fitted, *held_out)),
        "duration": float(sum(one.time[-1] - one.time[0] for one in (*fitted, *held_out))),
        "stages": stages.seconds,
        "verdict": result.diagnosis.verdict,
        "named": [f"{f.effect}@{f.location}" for f in result.diagnosis.findings],
    }


def page(found: Sequence[dict[str, Any]], skipped: Sequence[str]) -> str:
    """The evidence page."""
    rows = []
    for one in found:
        case = CASES[one["case"]]
        goal = f"{case.goal:g}" if case.goal is not None else ""
        rows.append(
            [
                case.title,
                f"{one['duration']:.0f}",
                f"{one['samples']}",
                f"{one['wall']:.1f}",
                f"{one['processor']:.1f}",
                goal,
                f"{one['megabytes']:.0f}",
                f"`{one['verdict']}`",
                str(len(one["named"])),
            ]
        )
    heads = ["case", "recorded [s]:", "samples:", "wall [s]:", "processor [s]:", "goal [s]:", "memory [MB]:"]
    stages = [s for s in (FIRST, *STAGES.values()) if any(s in one["stages"] for one in found)]
    parts = [[s, *(f"{one['stages'].get(s, 0.0):.2f}" for one in found)] for s in stages]
    missed = [
        CASES[one["case"]].title
        for one in found
        if (goal_ := CASES[one["case"]].goal) is not None and one["wall"] > goal_
    ]
    heavy = [CASES[one["case"]].title for one in found if one["megabytes"] > MEMORY]
    return "\n\n".join(
        [
            head("Time and memory of a diagnosis", command=COMMAND),
            paragraph(
                "One diagnosis in a process of its own, without reading, report and designed motions. Linear",
                "algebra runs on one thread. Simulated chains have Coulomb and viscous friction at one joint",
                "and Coulomb friction at another that their files lack.",
                f"Goals are wall times on two cores, and {MEMORY:g} MB of memory.",
            ),
            table([*heads, "verdict", "named:"], rows),
            f"- Goals of time missed: {'; '.join(missed) or 'none'}.\n"
            f"- Goal of memory missed: {'; '.join(heavy) or 'none'}.",
            "## Where the time goes [s]",
            table(["stage", *(f"{CASES[one['case']].title}:" for one in found)], parts),
            *([f"Not here, so not timed: {', '.join(skipped)}."] if skipped else []),
        ]
    )


def _apart(name: str) -> dict[str, Any]:
    """Run one case in a process of its own."""
    words = [sys.executable, "-m", "benchmarks.speed.diagnosis_time", "--case", name]
    finished = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True)
    answer: dict[str, Any] = json.loads(finished.stdout.splitlines()[-1])
    return answer


def main(arguments: Sequence[str] | None = None) -> None:
    """Time every case and write the page, or time one case and print it."""
    parser = argparse.ArgumentParser(prog=COMMAND, description=__doc__.splitlines()[0])
    parser.add_argument("--case", choices=sorted(CASES), help="print this case's times as JSON; no page")
    parser.add_argument("--out", type=Path, default=PAGE)
    options = parser.parse_args(arguments)
    if options.case:
        print(json.dumps(measured(options.case)))
        return
    here = [name for name in CASES if name not in REAL or find_dataset(name) is not None]
    found = [_apart(name) for name in here]
    skipped = [CASES[name].title for name in CASES if name not in here]
    write_atomically(options.out, page(found, skipped).rstrip() + "\n")


if __name__ == "__main__":
    main()
