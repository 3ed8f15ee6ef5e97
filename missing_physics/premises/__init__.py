"""What a diagnosis takes for granted, weighed against the recording before anything is fitted.

A robot file without gravity, a current under the name of a torque, a torque before its gear, a command or a
model's torque in place of a measured one: a diagnosis would explain each of them by physics that is not
there. Each is a hypothesis about the same rows, weighed by its evidence against that all is as it is named.
"""

from missing_physics.premises.findings import PremiseError, premise_findings, require_premises

__all__ = ["PremiseError", "premise_findings", "require_premises"]
