"""Premises of a diagnosis, tested against the recording before anything is fitted.

Examples are a robot file without gravity, a current named as a torque, a torque on the motor side of its
gear, a command or a model's torque instead of a measured one. A diagnosis would explain each of them by
physics that does not exist. Each is a hypothesis on the same rows, weighed by its evidence against the
hypothesis that every channel is what its name states.
"""

from missing_physics.premises.findings import PremiseError, premise_findings, require_premises

__all__ = ["PremiseError", "premise_findings", "require_premises"]
