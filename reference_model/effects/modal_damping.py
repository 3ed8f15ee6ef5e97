"""Modal damping: a flexible link's vibration decays faster or slower than in the description."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from reference_model.effects.base import Extent, Parameter
from reference_model.effects.structure import StructureEffect
from reference_model.flexible import FlexibleBody, flexible_body
from robot_model import InputError, Robot

__all__ = ["ModalDamping"]

#: A total that is negative by less than this is rounding [-].
ROUNDING = 1e-12


class ModalDamping(StructureEffect):
    """A change of the damping ratio of all modes of a flexible link, whatever form its damping has."""

    id = "modal_damping"
    title = "Wrong structural damping"
    place = "link"
    stage = 1
    reshapes = True
    beam_number = "damping_ratio"
    parameters = (
        Parameter(
            "damping_ratio", "-", "added to the damping ratio of each mode", -0.99, 0.99, 0.01, absent=0.0
        ),
    )
    equation = "xdd_a + (c_a + 2 damping_ratio w_a) xd_a + w_a^2 x_a = -(inertial coupling), every mode a"
    source = "Clough and Penzien, Dynamics of Structures (1993), sec. 12-3"
    signature = "vibration of the link after a stop that decays faster or slower, at the same frequency"
    confused_with = ("viscous_friction", "link_flexibility", "sensor_delay", "slosh")
    experiment = (
        "ring-down from three amplitudes: a material's damping ratio does not depend on the amplitude, dry "
        "friction at a joint reduces it by a constant amount per cycle"
    )
    essential = ("damping_ratio",)

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        return ({"damping_ratio": self.parameter("damping_ratio").typical},)

    def limits(self, robot: Robot, at: str) -> Mapping[str, tuple[float, float]]:
        """Total damping of a mode stays positive; its own damping may be cancelled."""
        body = flexible_body(robot.link(at))
        least = float((np.diag(body.damping) / (2 * body.frequencies)).min())
        return {"damping_ratio": (-least, self.parameter("damping_ratio").upper)}

    def changed(self, robot: Robot, at: str, p: Mapping[str, float]) -> Robot:
        link = robot.link(at)
        if not link.flexible:
            raise InputError(f"link '{at}' is rigid and has no modes; give it link_flexibility, or a beam.")
        self.reshaped(flexible_body(link), p)
        return robot

    def reshaped(self, body: FlexibleBody, p: Mapping[str, float]) -> FlexibleBody:
        if p["damping_ratio"] == 0:
            return body
        damping = body.damping + np.diag(2 * p["damping_ratio"] * body.frequencies)
        ratios = np.diag(damping) / (2 * body.frequencies)
        if ratios.min() < -ROUNDING:
            raise InputError(
                f"damping_ratio = {p['damping_ratio']:g} leaves a mode with the damping ratio "
                f"{ratios.min():.3g}; no structure generates energy."
            )
        return replace(body, damping=damping)
