"""`missing-physics crosscheck`: differences of both engines for one robot, with friction and control."""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import StrEnum
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from missing_physics.cli.progress import Steps, steps
from missing_physics.cli.robots import ROBOT_HELP, OverlayOption, open_robot
from robot_model import (
    InputError,
    Recording,
    Reference,
    Robot,
    replacing_set,
    require_folder,
    write_atomically,
)

if TYPE_CHECKING:
    from exudyn_model import Flexible as FlexibleName
    from exudyn_model import Formulation as FormulationName

__all__ = ["Plan", "plan_of", "register"]

#: Tolerances of the reference run, below the step error of the other engine.
RTOL, ATOL = 1e-10, 1e-12
#: Factor on these in the reference's coarser run; the difference bounds the error of the finer run.
COARSER = 10.0
#: Factor on Exudyn's step in its coarser run; its local tolerance grows with the cube.
DOUBLE = 2
#: Range of Exudyn's default largest step [s], and the target number of steps of a motion.
STEPS, MOST_STEPS = (1e-3, 5e-3), 4000
#: Rounding of the number of steps in an interval.
ROUNDING = 1e-9


class Formulation(StrEnum):
    """How Exudyn describes the robot."""

    redundant = "redundant"
    tree = "tree"
    auto = "auto"


class Flexible(StrEnum):
    """How Exudyn bends flexible links."""

    modal = "modal"
    beam = "beam"


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(crosscheck)


def crosscheck(
    robot: Annotated[str, typer.Argument(help=ROBOT_HELP)],
    out: Annotated[
        Path, typer.Option(help="Folder for crosscheck.json and comparison.rrd.", show_default=True)
    ] = Path("crosscheck"),
    overlay: OverlayOption = None,
    step: Annotated[
        float | None,
        typer.Option(
            help="Largest time step of Exudyn, in seconds; by default 1 to 5 ms, so that a motion takes at "
            f"most {MOST_STEPS:,} steps where possible."
        ),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(help="Run this many seconds instead of the whole reference motion.")
    ] = None,
    formulation: Annotated[
        Formulation,
        typer.Option(
            help="Exudyn's coordinates: bodies with constraints, whose forces load the bearings; a tree, "
            "faster and without bearing loads, energy and momenta; auto: the tree unless something needs "
            "the bodies."
        ),
    ] = Formulation.redundant,
    flexible: Annotated[
        Flexible, typer.Option(help="Flexible links in Exudyn: by modes, or as geometrically exact beams.")
    ] = Flexible.modal,
    bounds: Annotated[
        bool, typer.Option(help="Run each engine once more with larger steps, to estimate its own error.")
    ] = True,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print crosscheck.json instead of the table.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing, not even on stderr.")] = False,
) -> None:
    """Run the robot's reference motion in both engines and compare every channel.

    Writes crosscheck.json and comparison.rrd into the folder of --out; docs/crosscheck.md explains them.
    """
    from missing_physics.reporting.crosscheck import compare, report, table, write_crosscheck

    require_folder(out)
    plan = plan_of(
        open_robot(robot, overlay, quiet=quiet),
        duration=duration,
        step=step,
        formulation=formulation.value,
        flexible=flexible.value,
    )
    plan.check()
    with steps(quiet=quiet) as log:
        ours, theirs = plan.reference(log), plan.exudyn(log)
        coarser = plan.coarser(log, ours, theirs) if bounds else []
        with log.step("comparing"):
            comparison = compare(plan.robot, ours, theirs, coarser)
            found = report(plan.robot, comparison, plan.settings(coarser=bool(coarser)))
            text = json.dumps(found, indent=1, allow_nan=False) + "\n"
            with replacing_set(out, ("comparison.rrd", "crosscheck.json")) as fresh:
                write_crosscheck(plan.robot, comparison, fresh / "comparison.rrd")
                write_atomically(fresh / "crosscheck.json", text)
    if not quiet:
        typer.echo(text if as_json else table(plan.robot, comparison), nl=not as_json)
        if not as_json:
            typer.echo(f"All numbers: {out / 'crosscheck.json'}   View: missing-physics view {out}")
            if found["samples_drawn"] < found["samples"]:
                typer.echo(
                    f"comparison.rrd draws {found['samples_drawn']} samples of each series, extremes kept."
                )


def plan_of(
    robot: Robot,
    *,
    duration: float | None = None,
    step: float | None = None,
    formulation: FormulationName = "redundant",
    flexible: FlexibleName = "modal",
) -> Plan:
    """How to run `robot` in both engines; raises `InputError` for an unusable `duration` [s]."""
    lasting = _lasting(robot, duration)
    return Plan(lasting, _usual_step(lasting) if step is None else step, formulation, flexible)


def _usual_step(robot: Robot) -> float:
    """Step with which a motion of the robot's length takes `MOST_STEPS`, within `STEPS` [s]."""
    length = 0.0 if robot.reference is None else robot.reference.duration
    return min(max(STEPS[0], length / MOST_STEPS), STEPS[1])


def _lasting(robot: Robot, duration: float | None) -> Robot:
    """The robot with a reference motion of `duration` [s], if given."""
    if duration is None or robot.reference is None:
        return robot
    if not duration > 0:
        raise InputError(f"--duration is {duration:g} s; it must be positive.")
    if duration * robot.reference.sample_rate < 1.0:
        raise InputError(
            f"--duration is {duration:g} s, less than one sample of {1.0 / robot.reference.sample_rate:g} s; "
            "give more."
        )
    if duration > robot.reference.duration:
        raise InputError(
            f"--duration is {duration:g} s, but the reference motion of '{robot.name}' ends after "
            f"{robot.reference.duration:g} s; give less, or lengthen reference.duration in the robot's file."
        )
    reference: Reference = robot.reference.model_copy(update={"duration": duration})
    return robot.model_copy(update={"reference": reference})


@dataclass(frozen=True)
class Plan:
    """The runs and their settings.

    Attributes:
        robot: with the reference motion that is run.
        step: largest of Exudyn [s].
        formulation, flexible: as for `exudyn_model.simulate`.
    """

    robot: Robot
    step: float
    formulation: FormulationName
    flexible: FlexibleName

    def check(self) -> None:
        """Raise `InputError` for a robot that Exudyn cannot simulate, before anything runs."""
        import exudyn_model

        exudyn_model.check(self.robot, step=self.step, formulation=self.formulation, flexible=self.flexible)

    def reference(self, log: Steps, *, factor: float = 1.0) -> Recording:
        """The reference run, with tolerances multiplied by `factor`."""
        from reference_model.simulation import simulate

        with log.step("reference" + (", larger tolerances" if factor > 1 else "")):
            return simulate(self.robot, sensors=False, rtol=factor * RTOL, atol=factor * ATOL)

    def exudyn(self, log: Steps, *, times: int = 1) -> Recording:
        """The run in Exudyn, with the step multiplied by `times`."""
        import exudyn_model

        fine = self.even_step
        robot = _sampled_at(self.robot, 1 / times) if self.thins else self.robot
        tolerance = exudyn_model.local_tolerance(self.robot, fine) * times**3
        assert robot.reference is not None
        name = f"Exudyn, steps of {1e3 * fine * times:.4g} ms"
        with log.step(name, total=robot.reference.duration) as progress:
            return exudyn_model.simulate(
                robot,
                sensors=False,
                step=fine * times,
                formulation=self.formulation,
                flexible=self.flexible,
                tolerance=tolerance,
                progress=progress,
            )

    @property
    def even_step(self) -> float:
        """Largest step up to `step` [s] whose double divides intervals and ticks of the coarser run."""
        assert self.robot.reference is not None
        interval = (DOUBLE if self.thins else 1) / self.robot.reference.sample_rate
        tick = getattr(self.robot.controller, "sample_time", 0.0)
        interval = min(interval, tick) if tick > 0 else interval
        return interval / (DOUBLE * ceil(interval / (DOUBLE * self.step) - ROUNDING))

    @property
    def thins(self) -> bool:
        """Whether a coarser run records only every other instant, since they are too dense."""
        assert self.robot.reference is not None
        return self.robot.reference.sample_rate * DOUBLE * self.step > 1 + ROUNDING

    def coarser(self, log: Steps, ours: Recording, theirs: Recording) -> list[tuple[Recording, Recording]]:
        """Each engine's recording paired with its coarser one; empty if a coarser run fails."""
        try:
            return [
                (ours, self.reference(log, factor=COARSER)),
                (theirs, self.exudyn(log, times=DOUBLE)),
            ]
        except InputError as error:
            log.note(f"no step error is given, since a coarser run fails: {error}")
            return []

    def settings(self, *, coarser: bool) -> dict[str, dict[str, Any]]:
        """How the engines were run, for crosscheck.json."""
        from importlib.metadata import version

        fine = self.even_step
        return {
            "reference": {"rtol": RTOL, "atol": ATOL, "coarser_rtol": COARSER * RTOL if coarser else None},
            "exudyn": {
                "version": version("exudyn"),
                "step": fine,
                "coarser_step": DOUBLE * fine if coarser else None,
                "formulation": self.formulation,
                "flexible": self.flexible,
            },
        }


def _sampled_at(robot: Robot, share: float) -> Robot:
    """The robot with its sample rate multiplied by a factor."""
    assert robot.reference is not None
    rate = {"sample_rate": robot.reference.sample_rate * share}
    return robot.model_copy(update={"reference": robot.reference.model_copy(update=rate)})
