"""Controllers beyond computed torque, for unknown friction and payload, as data."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from robot_model.controllers.base import Sampled, numbers, positive
from robot_model.input.fields import Gains, NonNegative, Positive

__all__ = ["AdaptiveNetwork", "SlidingMode"]

#: Largest number of centres; more weights would take more time than the motion itself.
MOST_CENTRES = 500


class SlidingMode(Sampled):
    """Sliding mode with a boundary layer: u = Z(q) (rdd + slope ed + a) - z(q, qd), s = ed + slope e.

    e = r - q and ed = rd - qd. The reaching law a(s), with sat(x) = max(-1, min(1, x)), is `constant`,
    a = rate sat(s/boundary_layer), or `exponential`, a = rate sat(s/boundary_layer) + proportional s
    (constant rate and constant plus proportional rate of Gao and Hung, IEEE Trans. Ind. Electronics 40 (1993)
    45-55).
    Inside the layer it is computed torque with kp = slope p and kd = slope + p, p = rate/boundary_layer
    [+ proportional].
    """

    kind: Literal["sliding_mode"] = "sliding_mode"
    model: Literal["rigid", "full"] = Field(
        default="rigid", description="whether the controller knows the flexible links' deformation"
    )
    slope: Gains = Field(description="of the sliding line, one number or one per moving joint [1/s]")
    reaching: Literal["constant", "exponential"] = Field(default="constant", description="reaching law")
    rate: Gains = Field(description="rate of decrease of s outside the layer [rad/s^2 or m/s^2]")
    proportional: Gains = Field(default=0.0, description="of the exponential reaching law [1/s]")
    boundary_layer: Gains = Field(description="value of s below which the switching is linear [rad/s or m/s]")

    @model_validator(mode="after")
    def _possible(self) -> SlidingMode:
        positive(self, ("slope", "rate", "boundary_layer"))
        if self.reaching == "exponential":
            positive(self, ("proportional",))
        elif unused := [number for number in numbers(self.proportional) if number]:
            raise ValueError(
                f"proportional is {unused[0]:g}, which the constant reaching law does not use; remove it, or "
                'set reaching to "exponential"'
            )
        return self


class AdaptiveNetwork(Sampled):
    """Computed torque with a radial basis network that learns the model error while it runs.

    u = Z(q) (rdd + kd ed + kp e + W^T phi(x)) - z(q, qd), e = r - q, ed = rd - qd. The network's input x are
    positions and velocities of all moving joints, each minus the middle and divided by half the range of its
    reference; phi_j = exp(-|x - c_j|^2 / (2 width^2)), with centres c_j on the reference at instants that are
    spread evenly over its duration. Each joint's weights obey

        dW/dt = adaptation (phi s - leakage W),   s = ed + (kd/2) e

    so that V = (ed^2 + (kp + kd^2/2) e^2 + kd e ed + |W - W*|^2/adaptation)/2, summed over the joints,
    decreases except for the leakage (sigma modification), which keeps the weights bounded, and for the part
    that no W* of these centres can represent. The weights are zero at the start.
    """

    kind: Literal["adaptive_network"] = "adaptive_network"
    model: Literal["rigid", "full"] = Field(
        default="rigid", description="whether the controller knows the flexible links' deformation"
    )
    kp: Gains = Field(description="position gain, one number or one per moving joint [1/s^2]")
    kd: Gains = Field(description="velocity gain [1/s]")
    centres: Annotated[int, Field(strict=True, ge=1, le=MOST_CENTRES)] = Field(
        description="number of centres, at most the number of the recording's samples [-]"
    )
    width: Positive = Field(description="of the basis functions, in half ranges of the reference [-]")
    adaptation: NonNegative = Field(description="adaptation rate of the weights; 0 keeps them zero [1/s^2]")
    leakage: NonNegative = Field(
        default=0.0, description="decay rate of the weights divided by adaptation [s]"
    )

    @model_validator(mode="after")
    def _possible(self) -> AdaptiveNetwork:
        positive(self, ("kp", "kd"))
        return self
