"""Centrifugal stiffening: a described flexible beam lacks the foreshortening that bending causes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from reference_model.effects.base import Extent, Parameter
from reference_model.effects.structure import StructureEffect
from reference_model.flexible import FlexibleBody
from robot_model import InputError, Robot

__all__ = ["CentrifugalStiffening"]


class CentrifugalStiffening(StructureEffect):
    """A share of the geometric stiffening of a beam whose description leaves it out.

    At 1 the beam is the one whose description says `stiffening = true`.
    """

    id = "centrifugal_stiffening"
    title = "Centrifugal stiffening"
    place = "link"
    stage = 1
    reshapes = True
    parameters = (
        Parameter("strength", "-", "share of the foreshortening that takes part", 0.0, 1.0, 1.0, absent=0.0),
    )
    equation = "node k also moves by -strength/2 x^T B_k x along the beam, B_k = int_0^k w' w'^T ds"
    source = "Southwell and Gough, ARC R&M 766 (1921); Kane, Ryan, Banerjee, J. Guidance 10 (1987) 139-151"
    signature = "a link's frequency that rises with the square of the rate of slewing, only while it slews"
    confused_with = ("link_flexibility", "payload", "temperature_dependent_friction")
    experiment = (
        "let the link ring at several constant rates: frequency squared against rate squared is a line"
    )
    essential = ("strength",)

    def changed(self, robot: Robot, at: str, p: Mapping[str, float]) -> Robot:
        link = robot.link(at)
        if link.beam is None:
            raise InputError(f"link '{at}' is no beam; only beams stiffen.")
        if link.beam.stiffening:
            raise InputError(f"link '{at}' is described with stiffening already; set stiffening to false.")
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
