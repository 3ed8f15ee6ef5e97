"""`missing-physics datasets`: public real recordings."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from missing_physics.recordings.datasets import DATASETS, fetch_dataset

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the command with its two verbs to `app`."""
    group = typer.Typer(
        no_args_is_help=True,
        help="Public real recordings: list them, or fetch one by commit and checksum. "
        "MISSING_PHYSICS_DATA names a folder to look in first, MISSING_PHYSICS_CACHE where downloads go.",
    )
    group.command("list")(list_datasets)
    group.command("fetch")(fetch)
    app.add_typer(group, name="datasets")


def list_datasets() -> None:
    """What there is."""
    table = Table(box=None)
    for title in ("name", "what", "files", "source", "licence"):
        table.add_column(title)
    for dataset in DATASETS.values():
        source = f"github {dataset.repository} at {dataset.commit[:10]}"
        table.add_row(dataset.name, dataset.what, str(len(dataset.files)), source, dataset.licence)
    Console().print(table)


def fetch(
    name: Annotated[str, typer.Argument(help="name of the dataset, see `missing-physics datasets list`")],
    quiet: Annotated[bool, typer.Option("--quiet", help="no progress on stderr")] = False,
) -> None:
    """Get a dataset, verify its checksums, and print the path of each of its files."""
    folder = fetch_dataset(name, progress=False)
    if not quiet:
        Console(stderr=True).print(f"{name}: {len(DATASETS[name].files)} files, checksums as published.")
    for file in DATASETS[name].files:
        print(folder / file.name)
