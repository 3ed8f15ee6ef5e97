"""Speed of the reference model compared with MuJoCo and Pinocchio; one round is a loop of many evaluations.

    make bench ARGS="-k speed"

A round's wall time, which the first table shows, also holds the making of the peer's model from its file;
ratios in the table at the end are of the processor time of one evaluation alone.
`python -m benchmarks.speed.study` writes the page.
"""

from __future__ import annotations

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

pytest.importorskip("mujoco", reason="needs the extra [peers]")
pytest.importorskip("pinocchio", reason="needs the extra [peers]")

from benchmarks.speed import cases as cases
from benchmarks.speed.loops import REPEATS, Loop, agreement, own_loop
from benchmarks.speed.study import SHIPPED
from reference_model.codegen.compiled import compiler
from robot_model import load_robot

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler on the path")

ENGINES = (
    *("reference model", "reference model, masses as inputs", "MuJoCo mj_forward", "Pinocchio aba"),
    *("reference model, from Python", "MuJoCo mj_forward, from Python", "Pinocchio aba, from Python"),
)
#: Lengths of the benchmarked chains.
LINKS = (2, 8, 32)
#: Accelerations of one state by three algorithms differ by rounding, amplified by a heavy base and a light
#: wrist.
SAME = 1e-11


def timed(benchmark: BenchmarkFixture, loop: Loop) -> None:
    found: list[float] = []
    benchmark.pedantic(lambda: found.append(loop()), rounds=REPEATS, warmup_rounds=1)
    if found:
        benchmark.extra_info["microseconds_per_evaluation"] = 1e6 * min(found)
        benchmark.extra_info["seconds"] = min(found)


@pytest.mark.parametrize("robot", SHIPPED)
def test_the_engines_agree(robot: str) -> None:
    assert max(agreement(load_robot(robot))) < SAME


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("robot", SHIPPED)
def test_forward_dynamics(benchmark: BenchmarkFixture, robot: str, engine: str) -> None:
    benchmark.group = f"speed: forward dynamics of {robot}{', from Python' if 'Python' in engine else ''}"
    if not engine.startswith("reference model"):
        benchmark.extra_info["peer"] = engine.removesuffix(", from Python")
    elif "masses" not in engine:
        benchmark.extra_info["ours"] = True
    timed(benchmark, cases.forward_loops(robot)[engine])


@pytest.mark.benchmark(group="speed: state derivative of the flexible space robot")
@pytest.mark.parametrize("friction", ["none", "LuGre from bearing loads"])
def test_state_derivative(benchmark: BenchmarkFixture, friction: str) -> None:
    robot = cases.frictionless_robot() if friction == "none" else cases.loaded_robot()
    plant, columns = cases.derivative_columns(robot)
    timed(benchmark, own_loop(plant.rate, columns))


@pytest.mark.benchmark(group="speed: state derivative against the number of links")
@pytest.mark.parametrize("links", LINKS)
@pytest.mark.parametrize("kind", ["rigid", "flexible"])
def test_chain(benchmark: BenchmarkFixture, kind: str, links: int) -> None:
    function, columns = cases.chain_rate(links, flexible=kind == "flexible")
    timed(benchmark, own_loop(function, columns, evaluations=max(200, 40_000 // links)))


@pytest.mark.benchmark(group="speed: the manoeuvre with LuGre friction")
@pytest.mark.parametrize("compiled", [True, False])
def test_manoeuvre(benchmark: BenchmarkFixture, compiled: bool) -> None:
    timed(benchmark, cases.integration(compiled)[0])


@pytest.mark.benchmark(group="speed: a step of 1 ms")
def test_fixed_step(benchmark: BenchmarkFixture) -> None:
    timed(benchmark, cases.fixed_steps())


@pytest.mark.parametrize("method", ["inverse_dynamics", "joint_wrenches", "motion_jacobians"])
@pytest.mark.parametrize("robot", SHIPPED)
def test_recording(benchmark: BenchmarkFixture, robot: str, method: str) -> None:
    benchmark.group = f"speed: {cases.RECORDED} samples, {robot}"
    run = cases.recorded(robot)
    benchmark.pedantic(run, args=(method,), rounds=5, warmup_rounds=1)
