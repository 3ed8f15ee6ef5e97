"""The Dockerfile is complete, and the command that it runs exists."""

from __future__ import annotations

import fnmatch
import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
TEXT = re.sub(r"\\\n", " ", (ROOT / "Dockerfile").read_text("utf-8"))
STEPS = [tuple(line.split(maxsplit=1)) for line in TEXT.splitlines() if line and not line.startswith("#")]


def only(instruction: str) -> str:
    """The argument of the only step of this kind."""
    (found,) = [words for name, words in STEPS if name == instruction]
    return found


def ignored(path: str) -> bool:
    """Whether .dockerignore excludes a path from the build, by its patterns without exceptions."""
    patterns = (ROOT / ".dockerignore").read_text("utf-8").split()
    parts = Path(path).parts
    above = ["/".join(parts[: k + 1]) for k in range(len(parts))]
    return any(
        fnmatch.fnmatch(one, pattern.removeprefix("**/"))
        for pattern in patterns
        for one in (*above, *parts[1:])
    )


def test_the_image_has_a_supported_python() -> None:
    version = re.fullmatch(r"python:(\d+)\.(\d+)-slim", only("FROM"))
    assert version
    low, high = re.fullmatch(r">=3\.(\d+),<3\.(\d+)", PROJECT["project"]["requires-python"]).groups()
    assert version[1] == "3"
    assert int(low) <= int(version[2]) < int(high)


def test_the_build_context_contains_the_complete_package() -> None:
    assert only("COPY") == ". /source"
    project = PROJECT["project"]
    packages = [one.rstrip("*") for one in PROJECT["tool"]["setuptools"]["packages"]["find"]["include"]]
    needed = ["pyproject.toml", "constraints.txt", project["readme"], *project["license-files"]]
    needed += [f"{package}/__init__.py" for package in packages]
    needed += [
        path.relative_to(ROOT).as_posix()
        for package, patterns in PROJECT["tool"]["setuptools"]["package-data"].items()
        for pattern in patterns
        for path in (ROOT / package).glob(pattern)
    ]
    assert [path for path in needed if not (ROOT / path).is_file()] == []
    assert [path for path in needed if ignored(path)] == []


def test_it_installs_existing_extras_and_starts_an_existing_command() -> None:
    (install,) = [words for name, words in STEPS if name == "RUN" and "pip install" in words]
    extras = re.search(r'-c /source/constraints\.txt "/source\[(.+?)\]"', install)
    assert extras
    assert set(extras[1].split(",")) <= PROJECT["project"]["optional-dependencies"].keys()
    (command,) = re.fullmatch(r'\["(.+)"\]', only("ENTRYPOINT")).groups()
    assert command in PROJECT["project"]["scripts"]
