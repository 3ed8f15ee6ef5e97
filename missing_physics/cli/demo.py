"""`missing-physics demo`: from nothing to the revealed truth.

An independent engine (Exudyn) moves a two-joint arm with one effect inside that the robot file does not
mention. The diagnosis runs in a process of its own and sees files only; which effect it was stays in this
process's memory until the diagnosis has ended.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from exudyn_model import simulate
from missing_physics.recordings import write_recording
from robot_model import EffectUse, InputError, MultiSine, Reference, Robot, load_robot, save_robot

__all__ = ["DEFAULT_SEED", "HIDEABLE", "hidden_effect", "register", "reveal", "validation_motion"]

ROBOT = "two_link_arm"

#: Seed of a demo that is given none.
DEFAULT_SEED = 1


@dataclass(frozen=True)
class Hideable:
    """An effect that a demo may hide, with the ranges its parameters are drawn from.

    Attributes:
        ranges: parameter to lower and upper bound, drawn with equal density per decade.
        torques: parameters that are torques or stiffnesses; the ranges are for a joint whose actuator gives
            100 N m at most, and scale with the actuator.
        signed: parameters whose sign is drawn too.
        ratio: parameter that is a multiple of another: name to (other, lower, upper).
    """

    ranges: Mapping[str, tuple[float, float]]
    torques: frozenset[str] = frozenset()
    signed: frozenset[str] = frozenset()
    ratio: Mapping[str, tuple[str, float, float]] = field(default_factory=dict)


#: Ranges credible for joint drives of this size; see the catalogue pages of the effects for their sources.
HIDEABLE: Mapping[str, Hideable] = MappingProxyType(
    {
        "coulomb_friction": Hideable({"torque": (1.0, 5.0)}, frozenset({"torque"})),
        "stribeck_friction": Hideable(
            {"coulomb_torque": (1.5, 4.0), "stribeck_velocity": (0.05, 0.15)},
            frozenset({"coulomb_torque"}),
            ratio={"static_torque": ("coulomb_torque", 1.4, 2.0)},
        ),
        "lugre_friction": Hideable(
            {
                "coulomb_torque": (2.0, 4.0),
                "stribeck_velocity": (0.05, 0.15),
                "bristle_stiffness": (300.0, 1500.0),
                "bristle_damping": (3.0, 15.0),
            },
            frozenset({"coulomb_torque", "bristle_stiffness", "bristle_damping"}),
            ratio={"static_torque": ("coulomb_torque", 1.4, 2.0)},
        ),
        "cable_spring": Hideable(
            {"stiffness": (1.0, 5.0), "torque_at_zero": (0.5, 2.0)},
            frozenset({"stiffness", "torque_at_zero"}),
            signed=frozenset({"torque_at_zero"}),
        ),
        "torque_ripple": Hideable(
            {"cosine": (0.5, 2.0), "sine": (0.5, 2.0), "order": (6.0, 24.0)},
            frozenset({"cosine", "sine"}),
            signed=frozenset({"cosine", "sine"}),
        ),
    }
)

#: An interval wider than this many times the estimate says that the data do not fix the parameter.
UNDETERMINED = 10.0


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(demo)


def demo(
    out: Annotated[Path, typer.Option("--out", help="folder for the case and the results")] = Path(
        "reports/demo"
    ),
    seed: Annotated[
        int, typer.Option(help="draws the hidden effect, its parameters and the noise")
    ] = DEFAULT_SEED,
) -> None:
    """Hide an effect in a simulated arm, diagnose the recordings, then reveal the truth.

    Writes the nominal robot and two recordings into OUT/case, and the results of the diagnosis into OUT.
    """
    console = Console()
    nominal = load_robot(ROBOT)
    truth = hidden_effect(nominal, seed=seed)
    console.print(
        f"Exudyn moves [bold]{ROBOT}[/bold] with one effect inside that its robot file does not mention "
        f"(seed {seed})."
    )
    case = _write_case(nominal, truth, out / "case", seed=seed)
    console.print(f"Robot file and two recordings are in {out / 'case'}. Diagnosing them:\n")
    _diagnose(case, out)
    reveal(truth, _finding(out), console)
    console.print(f"\nReport: {out / 'report.html'}")


def hidden_effect(robot: Robot, *, seed: int) -> EffectUse:
    """An effect of `HIDEABLE` at one of the joints, drawn with its parameters; the same for the same seed."""
    chance = np.random.default_rng(seed)
    name = sorted(HIDEABLE)[int(chance.integers(len(HIDEABLE)))]
    joint = robot.moving_joints[int(chance.integers(len(robot.moving_joints)))]
    hideable = HIDEABLE[name]
    values: dict[str, float] = {}
    limit = joint.actuator.torque_limit if joint.actuator and joint.actuator.torque_limit else 100.0
    for key, (lower, upper) in hideable.ranges.items():
        value = float(np.exp(chance.uniform(np.log(lower), np.log(upper))))
        value *= limit / 100.0 if key in hideable.torques else 1.0
        values[key] = -value if key in hideable.signed and chance.random() < 0.5 else value
    for key, (other, lower, upper) in hideable.ratio.items():
        values[key] = values[other] * float(chance.uniform(lower, upper))
    rounded = {key: float(f"{value:.3g}") for key, value in values.items()}
    return EffectUse.model_validate({"effect": name, "at": joint.name, **rounded})


def validation_motion(reference: Reference, *, seed: int) -> Reference:
    """Another motion of the same size: every sine's frequency and phase drawn anew."""
    chance = np.random.default_rng([seed, 1])
    joints = tuple(
        item.model_copy(
            update={
                "frequencies": tuple(float(f * chance.uniform(0.7, 1.2)) for f in item.frequencies),
                "phases": tuple(float(p) for p in chance.uniform(0, 2 * np.pi, len(item.frequencies))),
            }
        )
        if isinstance(item, MultiSine)
        else item
        for item in reference.joints
    )
    return reference.model_copy(update={"joints": joints})


def _write_case(nominal: Robot, truth: EffectUse, folder: Path, *, seed: int) -> tuple[Path, Path, Path]:
    """Robot file, recording to fit and recording to validate; nothing in them tells the truth."""
    if nominal.reference is None:
        raise InputError(f"robot '{nominal.name}' has no reference motion.")
    robot, first, second = (folder / name for name in ("robot.toml", "recording.csv", "validation.csv"))
    real = nominal.with_effects(truth)
    other = real.model_copy(update={"reference": validation_motion(nominal.reference, seed=seed)})
    recordings = simulate(real, seed=seed), simulate(other, seed=seed + 1)
    save_robot(nominal, robot)
    for recording, path in zip(recordings, (first, second)):
        write_recording(recording, path)
    return robot, first, second


def _diagnose(case: tuple[Path, Path, Path], out: Path) -> None:
    """The public command, in a process of its own; ends the demo with its exit code when it fails."""
    robot, recording, validation = (str(path) for path in case)
    command = [sys.executable, "-m", "missing_physics", "diagnose", robot, recording]
    sys.stdout.flush()
    done = subprocess.run([*command, "--validate", validation, "--out", str(out)], check=False)
    if done.returncode != 0:
        raise typer.Exit(done.returncode)


def _finding(out: Path) -> list[dict[str, Any]]:
    findings: list[dict[str, Any]] = json.loads((out / "diagnosis.json").read_text("utf-8"))["findings"]
    return findings


def reveal(truth: EffectUse, findings: list[dict[str, Any]], console: Console) -> None:
    """Print the truth beside what was found.

    Args:
        truth: what was hidden.
        findings: of diagnosis.json.
        console: where to.
    """
    # The finding that answers the truth best: the right effect before the right place before any other.
    ranked = sorted(findings, key=lambda f: (f["effect"] != truth.effect, f["location"] != truth.at))
    nothing: dict[str, Any] = {"effect": "", "location": "", "parameters": {}}
    best = ranked[0] if ranked else nothing
    console.print("\n[bold]The truth, and what was found[/bold]")
    console.print(f"hidden: {truth.effect} at {truth.at}")
    console.print(f"found:  {_named(best, truth)}")
    table = Table(box=SIMPLE_HEAD)
    for heading in ("parameter", "truth", "found", "95 % interval", "agrees"):
        table.add_column(heading, no_wrap=True)
    estimates: Mapping[str, Any] = best["parameters"]
    for name in [*truth.parameters, *(name for name in estimates if name not in truth.parameters)]:
        found = estimates.get(name, {})
        label = f"{name} [{found['unit']}]" if found.get("unit", "-") != "-" else name
        cells = _estimate(found, truth.parameters.get(name))
        table.add_row(escape(label), *cells)  # rich would read a unit in brackets as markup
    console.print(table)
    for other in ranked[1:]:
        console.print(
            f"also found: {other['effect']} at {other['location']} [red](not hidden by the demo)[/red]"
        )


def _named(finding: Mapping[str, Any], truth: EffectUse) -> str:
    """Effect and place of a finding, and whether each is right."""
    if not finding["location"]:
        return "nothing"
    right = _mark(finding["effect"] == truth.effect), _mark(finding["location"] == truth.at)
    return f"{finding['effect']} at {finding['location']} (effect: {right[0]}, place: {right[1]})"


def _estimate(found: Mapping[str, Any], truth: float | None) -> tuple[str, str, str, str]:
    """Cells of one parameter: truth, value, interval, and whether the interval holds the truth."""
    shown = "-" if truth is None else f"{truth:.4g}"
    value, (low, high) = found.get("value"), found.get("ci95") or (None, None)
    if value is None:
        return shown, "-", "", ""
    if low is None or high is None or high - low > UNDETERMINED * abs(value):
        return shown, f"{value:.4g}", "not determined", ""
    agrees = "" if truth is None else _mark(low <= truth <= high)
    return shown, f"{value:.4g}", f"{low:.4g} to {high:.4g}", agrees


def _mark(right: bool) -> str:
    return "[green]yes[/green]" if right else "[red]no[/red]"
