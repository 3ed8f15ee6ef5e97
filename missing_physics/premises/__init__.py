"""Premises of a diagnosis, tested against the recording before anything is fitted.

A robot file without gravity, a current named as a torque, a torque on the motor side of its gear, a command
or a model's torque instead of a measured one: a diagnosis would explain each of them by physics that is not
there. Each is a hypothesis about the same rows, weighed by its evidence against the hypothesis that every
channel is what its name says.
"""

from missing_physics.premises.findings import PremiseError, premise_findings, require_premises

__all__ = ["PremiseError", "premise_findings", "require_premises"]
