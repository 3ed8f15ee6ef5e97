"""Cost of simulations in steps, which does not depend on the machine."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Effort"]


@dataclass
class Effort:
    """A tally that simulations add to.

        Attributes:
            states: of single implicit steps between two commands of a sampled controller, refused ones too:
    each XX"""

    states: int = 0
