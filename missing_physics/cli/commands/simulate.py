"""`missing-physics simulate`: run a robot's reference motion and write what its sensors record."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from missing_physics.cli.robots import ROBOT_HELP, OverlayOption, open_robot
from missing_physics.recordings import write_recording
from robot_model import Recording, Robot

__all__ = ["Engine", "register", "simulate"]


class Engine(StrEnum):
    """The two engines; they share only the robot's description."""

    reference = "reference"
    exudyn = "exudyn"


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(simulate)


def simulate(
    robot: Annotated[str, typer.Argument(help=ROBOT_HELP)],
    engine: Annotated[Engine, typer.Option(help="Which engine runs the motion.")] = Engine.reference,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Recording to write; its suffix chooses the format. By default ROBOT.parquet in this folder."
        ),
    ] = None,
    overlay: OverlayOption = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the sensor noise.")] = 0,
    truth: Annotated[bool, typer.Option("--truth", help="Write every channel, without errors.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing.")] = False,
) -> None:
    """Run the robot's reference motion; writes a recording."""
    description = open_robot(robot, overlay, quiet=quiet)
    recording = _run(description, engine, seed=seed, sensors=not truth)
    path = out or Path(f"{description.name}.parquet")
    write_recording(recording, path)
    if not quiet:
        typer.echo(
            f"{path}: {len(recording.channels)} channels, {len(recording)} samples, {recording.duration:g} s."
        )


def _run(robot: Robot, engine: Engine, *, seed: int, sensors: bool) -> Recording:
    """One simulation; an engine is imported only when it is asked for."""
    if engine is Engine.exudyn:
        import exudyn_model

        return exudyn_model.simulate(robot, seed=seed, sensors=sensors)
    from reference_model.simulation import simulate as run

    return run(robot, seed=seed, sensors=sensors)
