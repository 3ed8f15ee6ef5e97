"""Reference tables: splines of any degree are exact and differentiable, at their knots too."""

from __future__ import annotations

from functools import cache
from typing import Literal

import casadi as ca
import numpy as np
import pytest
from scipy.interpolate import BSpline, make_interp_spline

from reference_model.codegen.compiled import SWITCH, compiler
from reference_model.control.motion import reference_function
from reference_model.simulation import simulate
from robot_model import Recording, Robot

Integrator = Literal["implicit", "explicit", "rosenbrock"]

DEGREES = (1, 2, 3, 4, 5)
#: Instants of the recording fall on knots of the tables.
TIMES = np.linspace(0.0, 0.1, 6)
PLACES = (0.0, 1e-3, 1.5e-3, 1e-3, 0.0, -1e-3)


def spline(degree: int) -> BSpline:
    return make_interp_spline(TIMES, PLACES, k=degree)


def along_tables() -> Robot:
    """Five carriages beside each other that follow tables of degree 1 to 5 under a continuous controller."""
    names = [f"degree{degree}" for degree in DEGREES]
    shared = {"kind": "prismatic", "parent": "base"}
    robot = Robot.model_validate(
        {
            "name": "carriages",
            "links": [{"name": f"{name}_carriage", "mass": 2.0} for name in names],
            "joints": [{"name": name, "child": f"{name}_carriage", **shared} for name in names],
            "controller": {"kind": "computed_torque", "kp": 400.0, "kd": 40.0},
            "reference": {
                "duration": TIMES[-1],
                "sample_rate": 50.0,
                "joints": [
                    {"joint": name, "kind": "table", "times": tuple(TIMES), "positions": PLACES}
                    for name in names
                ],
            },
        }
    )
    assert robot.reference is not None
    tables = [  # files take degrees 3 and 5 alone
        table.model_copy(update={"degree": degree}) for table, degree in zip(robot.reference.joints, DEGREES)
    ]
    reference = robot.reference.model_copy(update={"joints": tuple(tables)})
    return robot.model_copy(update={"reference": reference})


@pytest.mark.parametrize("degree", DEGREES)
def test_a_table_and_its_derivatives_match_the_spline_at_and_between_knots(degree: int) -> None:
    """Integrators with exact slopes differentiate the acceleration by time as well."""
    reference = reference_function(along_tables())
    time, own = ca.MX.sym("t"), degree - DEGREES[0]
    course = ca.vertcat(*(part[own] for part in reference(time)))
    both = ca.Function("both", [time], [ca.vertcat(course, ca.jacobian(course, time)[2])])
    for instant in (*spline(degree).t[degree + 1 : -degree - 1], 0.013, 0.055):
        wanted = [
            float(spline(degree).derivative(order)(instant)) if order <= degree else 0.0 for order in range(4)
        ]
        # rounding of a millimetre, differentiated three times over pieces of 20 ms: 1e-19 / (0.02)^3
        np.testing.assert_allclose(both(float(instant)).full().ravel(), wanted, rtol=1e-9, atol=1e-9)


@cache
def followed_exactly() -> Recording:
    return simulate(along_tables(), sensors=False, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("compiled", [True, False], ids=["compiled", "plain"])
@pytest.mark.parametrize("integrator", ["implicit", "explicit", "rosenbrock"])
def test_every_integrator_supports_tables_with_a_continuous_controller(
    integrator: Integrator, compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if compiled and compiler() is None:
        pytest.skip("no C compiler on the path")
    monkeypatch.setenv(SWITCH, "on")
    made = simulate(along_tables(), sensors=False, integrator=integrator, compile_code=compiled)
    for degree in DEGREES:
        channel = f"degree{degree}.position"
        # with default tolerances a kink of the reference may cost a micrometre of its millimetre
        np.testing.assert_allclose(made[channel], followed_exactly()[channel], atol=1e-6)
