"""Prediction of a robot file for a recording, and the residual.

Independent of every fit: it uses only the robot file, the recording and the reference model. So whatever a
fit reports about its model can be checked against the file that it wrote.
"""

from missing_physics.evaluation.band import Band
from missing_physics.evaluation.joint_motion import JointMotion
from missing_physics.evaluation.prediction import Prediction, predicted
from missing_physics.evaluation.residual import Evaluation, evaluate

__all__ = ["Band", "Evaluation", "JointMotion", "Prediction", "evaluate", "predicted"]
