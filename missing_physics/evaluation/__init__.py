"""What a robot file predicts of a recording, and what it leaves of it.

Independent of every fit: from the robot's description, the recording and the reference model alone, so that
whatever a fit reports of its model can be checked against the file that it wrote.
"""

from missing_physics.evaluation.band import Band
from missing_physics.evaluation.joint_motion import JointMotion
from missing_physics.evaluation.prediction import Prediction, predicted
from missing_physics.evaluation.residual import Evaluation, evaluate

__all__ = ["Band", "Evaluation", "JointMotion", "Prediction", "evaluate", "predicted"]
