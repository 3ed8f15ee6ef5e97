"""Fits hypotheses to recordings in the band of the motion, and weighs them by held-out data."""

from missing_physics.inference.data import Data
from missing_physics.inference.fit import Fit, fitted
from missing_physics.inference.ledger import Search, absent
from missing_physics.inference.posterior import Posterior, weighed
from missing_physics.inference.search import search

__all__ = ["Data", "Fit", "Posterior", "Search", "absent", "fitted", "search", "weighed"]
