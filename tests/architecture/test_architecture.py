"""Packages import each other in one direction; every module defines `__all__`; no data runs as code."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("robot_model", "reference_model", "exudyn_model", "missing_physics")

#: Project packages that a package may import besides itself; a module belongs to the longest matching prefix.
#: The engines share the robot description only, since agreement between two uses of one function would
#: prove nothing.
KNOWS: dict[str, tuple[str, ...]] = {
    "robot_model": (),
    "reference_model": ("robot_model",),
    "exudyn_model": ("robot_model",),
    "missing_physics.wording": (),
    "missing_physics.bodies": ("robot_model", "reference_model"),
    # Checks fits independently, so it shares no code with them.
    "missing_physics.evaluation": (
        "robot_model",
        "reference_model",
        "missing_physics.recordings",
        "missing_physics.checks",
    ),
    # Reads a file in a separate process.
    "missing_physics.isolation": ("robot_model",),
    "missing_physics.recordings": ("robot_model", "missing_physics.isolation"),
    "missing_physics.checks": ("robot_model", "missing_physics.recordings"),
    "missing_physics.unnamed": ("reference_model",),
    "missing_physics.hypotheses": (
        "robot_model",
        "reference_model",
        "missing_physics.unnamed",
        "missing_physics.plausibility",
        "missing_physics.bodies",
    ),
    "missing_physics.inference": (
        "robot_model",
        "reference_model",
        "missing_physics.hypotheses",
        "missing_physics.unnamed",
        "missing_physics.plausibility",
        "missing_physics.evaluation",
        "missing_physics.standard",
    ),
    "missing_physics.answer": (
        "robot_model",
        "reference_model",
        "missing_physics.bodies",
        "missing_physics.checks",
        "missing_physics.hypotheses",
        "missing_physics.unnamed",
        "missing_physics.inference",
        "missing_physics.plausibility",
        "missing_physics.results",
        "missing_physics.standard",
        "missing_physics.evaluation",
        "missing_physics.wording",
    ),
    # The baseline for every answer: independent of how the answer is found.
    "missing_physics.standard": (
        "robot_model",
        "reference_model",
        "missing_physics.bodies",
        "missing_physics.recordings",
        "missing_physics.checks",
        "missing_physics.evaluation",
    ),
    "missing_physics.plausibility": ("robot_model", "reference_model"),
    "missing_physics.results": ("robot_model", "missing_physics.evaluation", "missing_physics.standard"),
    # Motion and dynamics along a recording, for what is checked and compared before torques are fitted.
    "missing_physics.motion": (
        "robot_model",
        "reference_model",
        "missing_physics.recordings",
        "missing_physics.checks",
        "missing_physics.evaluation",
        "missing_physics.standard",
    ),
    # Which joints a diagnosis can judge; shared by the commands.
    "missing_physics.coverage": (
        "missing_physics.motion",
        "missing_physics.answer",
        "missing_physics.hypotheses",
        "missing_physics.inference",
        "missing_physics.results",
        "robot_model",
        "missing_physics.recordings",
        "missing_physics.checks",
        "missing_physics.standard",
        "missing_physics.evaluation",
    ),
    "missing_physics.diagnosis": (
        "missing_physics.coverage",
        "missing_physics.motion",
        "missing_physics.answer",
        "missing_physics.hypotheses",
        "missing_physics.inference",
        "missing_physics.results",
        "missing_physics.plausibility",
        "robot_model",
        "reference_model",
        "missing_physics.recordings",
        "missing_physics.checks",
        "missing_physics.standard",
        "missing_physics.bodies",
        "missing_physics.evaluation",
        "missing_physics.wording",
    ),
    # Premises of a diagnosis, tested before it.
    "missing_physics.premises": (
        "robot_model",
        "reference_model",
        "missing_physics.recordings",
        "missing_physics.checks",
        "missing_physics.standard",
    ),
    # Results, and the catalogue for the names and equations of the effects in them.
    "missing_physics.reporting": (
        "robot_model",
        "missing_physics.results",
        "missing_physics.challenge",
        "missing_physics.wording",
        "reference_model.effects",
    ),
    # It calls the diagnosis as a user does, through the command line, so that it cannot leak a key. One
    # engine makes the recordings; the other decides identifiability by the true model, and runs the answers.
    "missing_physics.challenge": (
        "robot_model",
        "exudyn_model",
        "reference_model",
    ),
    # Rates guesses by the first checks of a diagnosis.
    "missing_physics.drafting": (
        "robot_model",
        "reference_model",
        "missing_physics.recordings",
        "missing_physics.diagnosis",
        "missing_physics.results",
    ),
    # From a robot's description to files of other simulators, independent of the diagnosis.
    "missing_physics.export": ("robot_model", "reference_model"),
    # For scripts and notebooks; the corresponding commands use it.
    "missing_physics.api": (
        "robot_model",
        "reference_model",
        "exudyn_model",
        "missing_physics.recordings",
        "missing_physics.checks",
        "missing_physics.diagnosis",
        "missing_physics.drafting",
        "missing_physics.premises",
        "missing_physics.results",
        "missing_physics.reporting",
    ),
    "missing_physics.cli": PACKAGES,
    "missing_physics": ("missing_physics.cli", "missing_physics.api", "robot_model"),
}

#: Packages of the diagnosis, from recorded data upwards: each may import those before it.
DIAGNOSIS = (
    "known",
    "comparison",
    "further",
    "ripple",
    "gear",
    "gear_file",
    "base",
)
KNOWS |= {
    f"missing_physics.diagnosis.{room}": (
        *KNOWS["missing_physics.diagnosis"],
        *(f"missing_physics.diagnosis.{other}" for other in DIAGNOSIS[:place]),
    )
    for place, room in enumerate(DIAGNOSIS)
}

#: Libraries that only one package may import, so that an engine or a front end is replaced in one place.
HOMES: dict[str, tuple[str, ...]] = {
    "exudyn": ("exudyn_model",),
    "typer": ("missing_physics.cli",),
    "rerun": ("missing_physics.reporting",),
    "plotly": ("missing_physics.reporting",),
    "plotext": ("missing_physics.reporting",),
    "jinja2": ("missing_physics.reporting",),
    "h5py": ("missing_physics.recordings",),
    "pyarrow": ("missing_physics.recordings", "missing_physics.challenge"),
    "cryptography": ("missing_physics.challenge",),
    "distributed": ("missing_physics.challenge",),
    "pysindy": ("missing_physics.challenge",),
    "rosbags": ("missing_physics.recordings.readers.bags",),
    "pint": ("missing_physics.recordings.maps",),
    "narwhals": ("missing_physics.recordings",),
    "pooch": ("missing_physics.recordings",),
    "defusedxml": ("robot_model.formats",),
    "simpleeval": ("robot_model.formats.xacro",),
    "xacro": ("robot_model.formats.xacro",),
    "yaml": ("robot_model.formats.xacro",),
}

#: Modules that turn data into running code.
CODE_FROM_DATA = {"pickle", "cPickle", "marshal", "shelve", "dill", "cloudpickle", "joblib"}
CALLS_FROM_DATA = {"eval", "exec", "compile", "__import__"}


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


SOURCES = {
    module_name(path): path
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob("*.py"))
    if "__pycache__" not in path.parts
}


def every_module(check: Callable[[str], None]) -> Callable[[], None]:
    """One test for all modules; a parameter for each of hundreds would cost more than the check."""

    def test() -> None:
        for module in SOURCES:
            check(module)

    test.__name__, test.__doc__ = check.__name__, check.__doc__
    return test


@cache
def syntax(module: str) -> ast.Module:
    return ast.parse(SOURCES[module].read_text("utf-8"))


@cache
def imported(module: str) -> tuple[str, ...]:
    """Full names of all imports of a module, type-checking blocks included."""
    return tuple(_imported(module))


def _imported(module: str) -> Iterator[str]:
    package = module if SOURCES[module].name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(syntax(module)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            origin = ".".join([*above, *([node.module] if node.module else [])])
            yield from (f"{origin}.{alias.name}" for alias in node.names)


def is_within(name: str, room: str) -> bool:
    return name == room or name.startswith(f"{room}.")


def room_of(module: str) -> str:
    return max((room for room in KNOWS if is_within(module, room)), key=len)


@every_module
def test_imports_follow_the_allowed_dependencies(module: str) -> None:
    room = room_of(module)
    allowed = (room, *KNOWS[room])
    for name in imported(module):
        if any(is_within(name, package) for package in PACKAGES):
            assert any(is_within(name, other) for other in allowed), f"{module} imports {name}"


def test_every_package_of_the_diagnosis_is_in_the_order() -> None:
    rooms = {path.parent.name for path in (ROOT / "missing_physics" / "diagnosis").glob("*/__init__.py")}
    assert rooms == set(DIAGNOSIS)


@every_module
def test_packages_do_not_import_the_parent_package(module: str) -> None:
    """`missing_physics` is above its packages, so that only the program's entry point may import it."""
    if room_of(module) != "missing_physics":
        names = [name for name in imported(module) if room_of_ours(name) == "missing_physics"]
        assert not names, f"{module} imports {names}"


def room_of_ours(name: str) -> str | None:
    return room_of(name) if any(is_within(name, package) for package in PACKAGES) else None


@every_module
def test_libraries_are_imported_only_in_their_package(module: str) -> None:
    for name in imported(module):
        homes = HOMES.get(name.split(".")[0])
        assert homes is None or any(is_within(module, home) for home in homes), f"{module} imports {name}"


def test_allowed_dependencies_have_no_cycle() -> None:
    waiting = {
        room: {room_of(other) for other in known} - {room}
        for room, known in KNOWS.items()
        if room not in ("missing_physics", "missing_physics.cli")  # entry points import all
    }
    while waiting:
        free = [room for room, known in waiting.items() if not known & waiting.keys()]
        assert free, f"a cycle among {sorted(waiting)}"
        waiting = {room: known for room, known in waiting.items() if room not in free}


@every_module
def test_every_module_defines_all(module: str) -> None:
    last = module.split(".")[-1]
    if last.startswith("_") or not defines_names(module):
        return
    offered = [node for node in syntax(module).body if isinstance(node, ast.Assign) and assigns_all(node)]
    assert len(offered) == 1, f"{module} has no `__all__`"
    names = ast.literal_eval(offered[0].value)
    assert len(names) == len(set(names)), module
    assert set(names) <= top_level_names(module), module


def defines_names(module: str) -> bool:
    return bool(top_level_names(module))


def assigns_all(node: ast.Assign) -> bool:
    return any(isinstance(target, ast.Name) and target.id == "__all__" for target in node.targets)


def top_level_names(module: str) -> set[str]:
    """Names that the module defines or imports at its top level, `annotations` left out."""
    found: set[str] = set()
    body = syntax(module).body
    later = [node for test in body if isinstance(test, ast.If) for node in test.body]  # for type checkers
    for node in [*body, *later]:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            found |= {alias.asname or alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found |= {
                name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)
            }
    return found - {"annotations", "__all__"}


@every_module
def test_every_module_has_a_docstring(module: str) -> None:
    if syntax(module).body:
        assert ast.get_docstring(syntax(module)), f"{module} has no docstring"


@every_module
def test_no_module_runs_data_as_code(module: str) -> None:
    assert not {name.split(".")[0] for name in imported(module)} & CODE_FROM_DATA, module
    for node in ast.walk(syntax(module)):
        if isinstance(node, ast.Call):
            called = node.func.id if isinstance(node.func, ast.Name) else ""
            assert called not in CALLS_FROM_DATA, f"{module}, line {node.lineno}"
            assert not any(word.arg == "allow_pickle" and is_true(word.value) for word in node.keywords), (
                module
            )


def is_true(value: ast.expr) -> bool:
    return not (isinstance(value, ast.Constant) and value.value is False)


def test_the_checks_find_all_packages() -> None:
    """A check that finds no files would always pass."""
    assert set(PACKAGES) <= SOURCES.keys()
    assert all((ROOT / package / "py.typed").is_file() for package in PACKAGES)
    assert len(SOURCES) > 50
