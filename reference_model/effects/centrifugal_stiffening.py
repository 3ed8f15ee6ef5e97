"""Centrifugal stiffening: a flexible beam whose model lacks the foreshortening due to bending."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from reference_model.effects.base import Extent, Parameter
from reference_model.effects.structure import StructureEffect
from reference_model.flexible import FlexibleBody
from robot_model import InputError, Robot

__all__ = ["CentrifugalStiffening"]


class CentrifugalStiffening(StructureEffect):
    """A fraction of the geometric stiffening of a beam whose description omits it.

    At 1 the beam is the same as with `stiffening = true` in its description.
    """

    id = "centrifugal_stiffening"
    title = "Centrifugal stiffening"
    place = "link"
    stage = 1
    reshapes = True
    parameters = (
        Parameter(
            "strength", "-", "fraction of the foreshortening that is included", 0.0, 1.0, 1.0, absent=0.0
        ),
    )
    equation = "node k also moves by -strength/2 x^T B_k x along the beam, B_k = int_0^k w' w'^T ds"
    source = "Southwell and Gough, ARC R&M 766 (1921); Kane, Ryan, Banerjee, J. Guidance 10 (1987) 139-151"
    signature = "a link's frequency rises with the square of the slew rate, only during the slew"
    confused_with = ("link_flexibility", "payload", "temperature_dependent_friction")
    experiment = (
        "let the link ring at several constant rates: frequency squared against rate squared is a line"
    )
    essential = ("strength",)

    def changed(self, robot: Robot, at: str, p: Mapping[str, float]) -> Robot:
        link = robot.link(at)
        if link.beam is None:
            raise InputError(f"link '{at}' is not a beam; only beams stiffen.")
        if link.beam.stiffening:
            raise InputError(
                f"link '{at}' already has stiffening in its description; set stiffening to false."
            )
        if p["strength"] == 0:
            return robot
        stiff = link.model_copy(update={"beam": link.beam.model_copy(update={"stiffening": True})})
        links = tuple(stiff if other.name == at else other for other in robot.links)
        return robot.model_copy(update={"links": links})

    def reshaped(self, body: FlexibleBody, p: Mapping[str, float]) -> FlexibleBody:
        if body.foreshortening is None:
            return body
        return replace(body, foreshortening=p["strength"] * body.foreshortening)

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        return ({"strength": self.parameter("strength").typical},)
