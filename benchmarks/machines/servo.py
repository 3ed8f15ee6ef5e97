"""Servo pendulum: the diagnosis from two gains, scored on a third."""

from __future__ import annotations

from benchmarks.evidence import (
    EXAMPLES,
    estimate,
    findings,
    fit_table,
    number,
    relative,
    table,
    told,
    values_of,
)
from benchmarks.machines.servo_pendulum import FITTED, HELD_OUT, diagnosis_of, load_logs
from missing_physics.recordings.datasets import fetch_dataset
from missing_physics.results.result import Estimate
from robot_model import load_robot

__all__ = ["section"]


def section() -> str:
    """The section, in Markdown."""
    logs = load_logs(fetch_dataset("servo_pendulum"))
    result = diagnosis_of(load_robot(EXAMPLES / "servo_pendulum" / "nominal.toml"), logs)
    diagnosis = result.diagnosis
    changes = [
        f"`{c.name}` from {number(c.nominal)} to {estimate(Estimate(c.estimate, c.ci95, c.unit))}"
        for c in diagnosis.nominal_parameters
    ]
    rows = [
        [
            str(place),
            ", ".join(label.split("@")[0] for label in stage.effects),
            "; ".join(f"{name} {estimate(e)}" for name, e in values_of(stage).items()),
            *relative(next(iter(stage.relative_error.values()), None)),
        ]
        for place, stage in enumerate(diagnosis.stages, start=1)
    ]
    gains = " and ".join(map(str, FITTED))
    parts = [
        "## Servo pendulum: position, PWM and voltage only",
        f"The logs of gains {gains} are fitted, those of gain {HELD_OUT} kept away from the diagnosis. "
        "Nominal robot: "
        "`examples/servo_pendulum/nominal.toml`, a pendulum with the published motor and no friction. There "
        "is no torque sensor: the torque is that of the motor's voltage equation, so the published torque "
        "constant and resistance enter every number.",
        f"Verdict: **{diagnosis.verdict}**, in {result.seconds:.1f} s. {diagnosis.summary}",
        findings(diagnosis.findings),
        fit_table(diagnosis.fit.channels),
        table(
            [
                "step",
                "effects",
                "all parameters then",
                "error of torque, then of position, fitted:",
                "held out:",
            ],
            rows,
        ),
        "Re-estimated numbers of the nominal robot:\n\n" + told(changes),
        "Could not tell:\n\n" + told(diagnosis.could_not_tell),
        "Notes:\n\n" + told(diagnosis.notes),
        "Position errors of the simulated servo, beside those of the authors' published models on the same "
        "logs, are in [servo_pendulum.md](servo_pendulum.md), made by "
        "`python -m benchmarks.machines.servo_pendulum`.",
    ]
    return "\n\n".join(parts)
