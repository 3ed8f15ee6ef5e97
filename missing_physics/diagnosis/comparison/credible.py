"""Physically possible parameters in the findings and in the written robot file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from missing_physics.plausibility import before
from missing_physics.results.result import Finding, ParameterChange
from reference_model.dynamics.inertial import inertial_names, nominal_inertial
from robot_model import Robot

__all__ = ["in_the_file", "with_priors"]

#: Suffixes of the names of parameters that cannot be negative.
NEVER_NEGATIVE = (".mass", ".inertia.xx", ".inertia.yy", ".inertia.zz", ".reflected_inertia")


def in_the_file(
    changes: Sequence[ParameterChange], robot: Robot, *, standard: bool
) -> tuple[ParameterChange, ...]:
    """Re-estimated parameters with the values in the written robot file.

    Data determine combinations of masses and inertias; a single parameter of an estimate may be impossible,
    such as a negative moment of inertia. The file has physically consistent bodies. Changes whose interval
    does not contain the file's value are omitted.

    Args:
        changes: parameters as estimated.
        robot: the written robot file.
        standard: whether it holds the standard model or the nominal robot instead of the answer.
    """
    if standard:
        return ()
    held = dict(zip(inertial_names(robot), nominal_inertial(robot)))
    stated = []
    for change in changes:
        value = held.get(change.name, change.estimate)
        low, high = change.ci95
        if change.name.endswith(NEVER_NEGATIVE):
            low = max(low, 0.0)
        if low <= value <= high:
            stated.append(replace(change, estimate=value, ci95=(low, high)))
    return tuple(stated)


def with_priors(finding: Finding, robot: Robot) -> Finding:
    """A finding with the prior interval of each parameter, which shows what the data do not determine."""
    return replace(
        finding,
        parameters={
            name: replace(estimate, prior95=before(finding.effect, finding.location, name, robot))
            for name, estimate in finding.parameters.items()
        },
    )
