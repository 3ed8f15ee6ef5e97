"""Compiled C against CasADi's own evaluation: same results, safe caching, and a note if unavailable."""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from random_robots import random_robot

from reference_model.codegen import batched as batches
from reference_model.codegen import compiled as module
from reference_model.codegen.batched import BLOCK, SHARE, Batched
from reference_model.codegen.c_pieces import in_pieces
from reference_model.codegen.code_cache import FOLDER_VARIABLE
from reference_model.codegen.compiled import EARNS_AFTER, SWITCH, compiled, compiler
from reference_model.effects import scan
from reference_model.effects.scan import Scan
from reference_model.evaluation.model import RobotModel
from reference_model.passive import marching
from reference_model.plant.closed_loop import Plant
from reference_model.simulation import simulate
from robot_model import Robot, load_robot

needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler on the path")


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Compiling switched on, with an empty cache of its own."""
    folder = tmp_path / "code"
    monkeypatch.setenv(FOLDER_VARIABLE, str(folder))
    monkeypatch.setenv(SWITCH, "on")
    return folder


def example(name: str = "example") -> ca.Function:
    """Every kind of line that CasADi writes: functions, branches, constants, sparse and empty outputs."""
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y")
    branch = ca.if_else(x[0] > 0, ca.atan2(x[1], y), ca.fabs(x[2]) ** 1.5)
    smooth = ca.tanh(x / 1e-4) + ca.exp(-(y**2)) * ca.sin(x) + ca.fmax(x, y) * 2.5 - ca.sign(x) / 3
    matrix = ca.diag(x * y)
    return ca.Function(name, [x, y], [branch, smooth, matrix, ca.SX(0, 1)], {"cse": True})


def values(function: ca.Function) -> list[np.ndarray]:
    rng = np.random.default_rng(3)
    points = [(rng.normal(size=3), rng.normal()) for _ in range(20)]
    return [np.concatenate([out.full().ravel() for out in function(*point)]) for point in points]


def entries(folder: Path) -> list[Path]:
    return sorted(folder.iterdir()) if folder.exists() else []


@needs_compiler
def test_compiled_functions_give_the_same_results(cache: Path) -> None:
    code = compiled([example("one"), example("two")])
    assert "compiled by" in code.note
    for function in code.functions:
        assert function.is_a("External")
        # the same operations in the same order; libm's and CasADi's elementary functions are the same ones
        np.testing.assert_allclose(values(function), values(example()), rtol=4e-16, atol=0)
    assert len(entries(cache)) == 1


@needs_compiler
def test_code_in_pieces_gives_the_same_results(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = random_robot(5, base="free", kinds=["revolute", "prismatic", "revolute"])
    plant = Plant(robot)
    time, state = ca.SX.sym("t"), ca.SX.sym("x", plant.layout.size)
    still = ca.SX.zeros(plant.layout.joints)
    rate = plant.rate(time, state, still, ca.SX.zeros(plant.commands))
    function = ca.Function("slopes", [time, state], [rate, ca.jacobian(rate, state)])
    assert function.n_instructions() > 1000
    monkeypatch.setattr(module, "in_pieces", lambda source, whole: in_pieces(source, whole=50, size=37))
    code = compiled([function])
    assert "compiled by" in code.note
    for row in np.random.default_rng(4).normal(size=(5, plant.layout.size)):
        for found, wanted in zip(code.functions[0](0.0, row), function(0.0, row)):
            # four roundings of the largest entry: gcc keeps the order of operations
            np.testing.assert_allclose(found.full(), wanted.full(), atol=1e-15 * np.abs(wanted.full()).max())


def test_pieces_pass_values_to_later_pieces() -> None:
    head = "static int casadi_f0(const casadi_real** arg, casadi_real** res, casadi_int* iw, "
    head += "casadi_real* w, int mem) {"
    body = ["  casadi_real a0, a1;", "  a0=arg[0]? arg[0][0] : 0;", "  a1=(2.*a0);", "  a0=(a0+a1);"]
    body += ["  if (res[0]!=0) res[0][0]=a0;", "  return 0;", "}"]
    cut = in_pieces("\n".join([head, *body]), whole=3, size=2)
    assert cut.count("noinline") == 2
    for line in ("  s[0]=a0;", "  a0=s[0];", "  s[1]=a1;", "  a1=s[1];", "  casadi_real s[2];"):
        assert cut.split("\n").count(line) == 1
    assert in_pieces("\n".join([head, *body]), whole=4, size=2) == "\n".join([head, *body])
    other = "\n".join([head, *body[:2], "  casadi_fill(w, 3, 0.);", *body[2:]])
    assert in_pieces(other, whole=1, size=1) == other  # not only assignments


@needs_compiler
def test_a_second_call_uses_the_cache(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compiled([example()])
    monkeypatch.setattr(module, "_made", lambda *_: pytest.fail("compiled again"))
    assert "compiled by" in compiled([example()]).note
    monkeypatch.setattr(module, "FLAGS", (*module.FLAGS, "-g0"))
    with pytest.raises(pytest.fail.Exception):
        compiled([example()])  # other flags make another entry


@needs_compiler
@pytest.mark.parametrize("damage", [b"", b"not a library", None])
def test_a_damaged_entry_is_made_again(cache: Path, damage: bytes | None) -> None:
    compiled([example("damaged")])
    (kept,) = entries(cache)
    content = kept.read_bytes()
    kept.unlink()  # a file in use is replaced, not written over, as a cache on disk is damaged between runs
    kept.write_bytes(content[: len(content) // 2] if damage is None else damage)
    code = compiled([example("damaged")])
    assert "compiled by" in code.note
    (again,) = entries(cache)
    assert again.name == kept.name or again.read_bytes() != damage


@needs_compiler
def test_two_processes_at_once(cache: Path) -> None:
    script = (
        "import casadi as ca; from reference_model.codegen.compiled import compiled; x = ca.SX.sym('x');"
        "c = compiled([ca.Function('f', [x], [ca.sin(x) + 1])]); print(c.note, float(c.functions[0](0)))"
    )
    runs = [
        subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) for _ in range(2)
    ]
    for run in runs:
        output, _ = run.communicate()
        assert "compiled by" in output
        assert output.strip().endswith("1.0")
    assert len([path for path in entries(cache) if path.suffix == ".so"]) >= 1
    assert not [path for path in entries(cache) if path.is_dir()]


def test_the_environment_switches_it_off(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SWITCH, "off")
    own = example()
    code = compiled([own])
    assert code.functions == (own,)
    assert SWITCH in code.note
    assert not entries(cache)


def test_without_a_compiler_casadi_evaluates(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(cache))
    own = example()
    code = compiled([own])
    assert code.functions == (own,)
    assert "no C compiler" in code.note


@pytest.mark.skipif(sys.platform == "win32", reason="a POSIX shell script")
def test_a_compiler_that_fails_is_noted(cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = tmp_path / "bin" / "gcc"
    broken.parent.mkdir()
    answers = "case $1 in -*ersion|-dumpmachine) echo old;; *) echo 'error: no' >&2; exit 1;; esac"
    broken.write_text(f"#!/bin/sh\n{answers}\n")
    broken.chmod(0o755)
    monkeypatch.setenv("PATH", str(broken.parent))
    own = example()
    code = compiled([own])
    assert code.functions == (own,)
    assert "error: no" in code.note
    assert not [path for path in entries(cache) if path.suffix == ".so"]


@needs_compiler
@pytest.mark.skipif(not hasattr(os, "getuid"), reason="POSIX permissions")
def test_code_is_not_loaded_from_folders_writable_by_others(cache: Path, tmp_path: Path) -> None:
    cache.mkdir(mode=0o700)
    cache.chmod(0o777)
    assert "not this user's alone" in compiled([example()]).note
    cache.chmod(0o700)
    tmp_path.chmod(stat.S_IRWXU | stat.S_IRWXG | stat.S_IRWXO)
    assert "others can replace" in compiled([example()]).note
    tmp_path.chmod(0o700)
    assert "compiled by" in compiled([example()]).note
    (kept,) = entries(cache)
    kept.chmod(0o666)
    assert "not this user's alone" in compiled([example()]).note


@needs_compiler
@pytest.mark.parametrize("longest", [0, module.MOST_IN_LOOPS], ids=["by itself", "with its loop"])
def test_long_recordings_are_evaluated_by_compiled_code(
    cache: Path, monkeypatch: pytest.MonkeyPatch, longest: int
) -> None:
    monkeypatch.setattr(module, "MOST_IN_LOOPS", longest)
    x = ca.SX.sym("x", 2)
    function = ca.Function("lengthy", [x], [ca.vertcat(ca.sin(x[0]) * x[1], x[0] ** 2)])
    batched, plain = Batched(function), Batched(function)
    points = np.random.default_rng(1).normal(size=(EARNS_AFTER // 2 + BLOCK + 3, 2))
    (first,) = batched(points)
    assert "virtual machine" in batched.note
    (second,) = batched(points)
    assert "compiled by" in batched.note
    np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(plain(points[:5])[0], second[:5])


@pytest.mark.parametrize("as_c", [False, pytest.param(True, marks=needs_compiler)])
def test_long_calls_are_distributed_over_processors(
    cache: Path, monkeypatch: pytest.MonkeyPatch, as_c: bool
) -> None:
    """Every sample is what it is without them, those of the rest and those of a common row too."""
    monkeypatch.setattr(batches, "EARNS_AFTER", 0 if as_c else np.inf)
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y", 3)
    function = ca.Function("lengthy", [x, y], [ca.vertcat(ca.sin(x[0]) * y[1], y[2]), x[1] ** 2 + y[0]])
    common = np.array([0.3, -1.2, 0.7])
    for samples in (1, 3 * SHARE, 7 * SHARE + BLOCK + 5):
        points = np.random.default_rng(3).normal(size=(samples, 2))
        found = []
        for count in (1, 3):
            monkeypatch.setattr(batches, "_processors", lambda count=count: count)
            batched = Batched(function)
            found.append(batched(points, common))
            assert ("compiled by" in batched.note) == as_c
        (first, second), shared = found
        np.testing.assert_allclose(first[:, 0], np.sin(points[:, 0]) * common[1], rtol=1e-15)
        np.testing.assert_array_equal(first[:, 1], common[2])
        np.testing.assert_allclose(second[:, 0], points[:, 1] ** 2 + common[0], rtol=1e-15, atol=1e-15)
        for alone, together in zip((first, second), shared):
            np.testing.assert_array_equal(alone, together)


@needs_compiler
def test_long_chains_are_run_by_compiled_code(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of both ways of a step, each from when it pays; the first and the later calls give the same."""
    x, begin, end, constants = (ca.SX.sym(name, size) for name, size in zip("xbec", (2, 2, 2, 1)))
    sure = ca.vertcat(ca.cos(x[1]) * constants, ca.sin(x[0]) + end[0] - begin[0])
    inputs = [x, begin, end, constants]
    step = ca.Function("step", inputs, [sure])
    easy = ca.Function("easy", inputs, [ca.if_else(begin[1] > 0, sure, 7.0), begin[1] > 0])
    rows = np.random.default_rng(4).normal(size=(1000, 2)) + np.array([0.0, 1.5])
    given = np.array([0.3, -0.2]), rows, np.array([0.9])
    expected = Scan(step)(*given)
    assert not entries(cache)
    monkeypatch.setattr(scan, "EARNS_AFTER", 800)
    chain = Scan(step, easy)
    for made in (1, 2):
        np.testing.assert_array_equal(chain(*given), expected)
        libraries = [entry for entry in entries(cache) if entry.suffix == ".so"]
        assert len(libraries) == made


@needs_compiler
def test_a_long_motion_of_flexible_links_is_followed_by_compiled_code(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = load_robot("flexible_space_robot_planar")
    model, time = RobotModel(robot), np.arange(300) * 2e-3
    wave = np.column_stack([np.sin(3 * time), np.cos(2 * time) - 1.0])
    joints = wave, np.gradient(wave, time, axis=0), np.gradient(np.gradient(wave, time, axis=0), time, axis=0)
    plain = model.reconstruct_passive(time, *joints)
    assert not entries(cache)
    monkeypatch.setattr(marching, "EARNS_AFTER", 1000)
    code = model.reconstruct_passive(time, *joints)
    assert entries(cache)
    for one, other in zip(plain, code):
        assert one is not None
        assert other is not None
        for part, same in zip(vars(one).values(), vars(other).values()):
            np.testing.assert_array_equal(part, same)


@needs_compiler
@pytest.mark.parametrize("sample_time", [0.0, 0.01])
def test_a_compiled_simulation_gives_the_same_recording(cache: Path, sample_time: float) -> None:
    robot = load_robot("two_link_arm")
    assert robot.reference is not None
    data = robot.model_dump()
    data["reference"] |= {"duration": 1.0}
    data["controller"] |= {"sample_time": sample_time}
    robot = Robot.model_validate(data)
    plain, code = simulate(robot, sensors=False), simulate(robot, sensors=False, compile_code=True)
    assert entries(cache)
    for channel in plain:
        # rounding, which a second of motion does not enlarge beyond the integrator's own steps
        scale = 1 + np.abs(plain[channel]).max()
        np.testing.assert_allclose(code[channel], plain[channel], atol=1e-10 * scale, err_msg=channel)
    shutil.rmtree(cache)


@needs_compiler
def test_tuned_code_gives_the_same_results_under_another_key(cache: Path) -> None:
    plain, tuned = compiled([example()]), compiled([example()], tuned=True)
    assert plain.library != tuned.library
    for one, other in zip(values(plain.functions[0]), values(tuned.functions[0])):
        np.testing.assert_array_equal(one, other)


@needs_compiler
def test_tuned_code_of_another_processor_is_not_used(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = compiled([example()], tuned=True).library
    monkeypatch.setattr(module, "_processor", lambda path: "another")
    second = compiled([example()], tuned=True).library
    assert first is not None
    assert second is not None
    assert first.name[:32] != second.name[:32]


@needs_compiler
def test_a_compiler_without_tuning_flags_still_compiles(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "TUNED", ("-march=no-such-processor",))
    module._processor.cache_clear()
    code = compiled([example()], tuned=True)
    module._processor.cache_clear()
    assert code.library == compiled([example()]).library
