"""`missing-physics datasets`: public real recordings."""

from __future__ import annotations

from typing import Annotated

import typer

from missing_physics.recordings.datasets import DATASETS, Dataset, dataset_files, fetch_dataset
from missing_physics.reporting.terminal.console import PlainConsole, styled

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the command with its two subcommands to `app`."""
    group = typer.Typer(
        no_args_is_help=True,
        help="Public real recordings: list them, or fetch one by commit and checksum. "
        "MISSING_PHYSICS_DATA names a folder to look in first, MISSING_PHYSICS_CACHE where downloads go.",
    )
    group.command("list")(list_datasets)
    group.command("fetch")(fetch)
    app.add_typer(group, name="datasets")


def list_datasets() -> None:
    """What there is: machine, source, licence, whom to cite."""
    console = PlainConsole()
    for dataset in DATASETS.values():
        console.print(styled((dataset.name, "bold"), f"  {dataset.what}"), soft_wrap=True)
        for line in _particulars(dataset):
            console.print(f"  {line}", soft_wrap=True)


def _particulars(dataset: Dataset) -> tuple[str, ...]:
    published = dataset.in_layout("published")
    source = f"{len(published)} files of github {dataset.repository} at {dataset.commit[:10]}"
    notes = []
    if any(file.copies for file in dataset.files):
        notes.append("copies with fewer columns or digits")
    if "prepared" in dataset.layouts:
        prepared = sum(file.layout == "prepared" for file in dataset.files)
        notes.append(f"{prepared} prepared file{'s' if prepared > 1 else ''} in another layout")
    also = (f"also accepted from a folder of yours: {'; '.join(notes)}",) if notes else ()
    return (source, f"licence: {dataset.licence}", f"cite: {dataset.citation}", *also)


def fetch(
    name: Annotated[str, typer.Argument(help="name of the dataset, see `missing-physics datasets list`")],
    quiet: Annotated[bool, typer.Option("--quiet", help="no progress on stderr")] = False,
) -> None:
    """Get a dataset, verify its checksums, and print the path of each of its files."""
    folder = fetch_dataset(name, progress=False)
    files = dataset_files(name, folder)
    if not quiet:
        PlainConsole(stderr=True).print(f"{name}: {len(files)} files, checksums verified.")
    for file in files:
        print(folder / file.name)
