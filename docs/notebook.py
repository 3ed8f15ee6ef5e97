# ---
# jupyter:
#   jupytext:
#     formats: py:percent,ipynb
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # From a URDF and a log to an MJCF file
#
# This page is a notebook in text form: `jupytext --to ipynb docs/notebook.py` converts it, and `make site`
# runs it. The robot is a pendulum on a drive, written as a URDF below.

# %%
import tempfile
from pathlib import Path

import numpy as np

import missing_physics as mp

folder = Path(tempfile.mkdtemp())
URDF = """<robot name="pendulum">
  <link name="stand"/>
  <link name="rod"><inertial><origin xyz="0.25 0 0"/><mass value="1.2"/>
    <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.025" iyz="0" izz="0.025"/></inertial></link>
  <joint name="pivot" type="continuous">
    <parent link="stand"/><child link="rod"/><axis xyz="0 -1 0"/>
  </joint>
</robot>"""
(folder / "pendulum.urdf").write_text(URDF)
robot = mp.load_robot(folder / "pendulum.urdf")
[(joint.name, joint.kind) for joint in robot.moving_joints]

# %% [markdown]
# ## A log
#
# Simulated here by the equation of motion of the pendulum, with dry friction of 0.35 N m that the URDF lacks
# and torque sensor noise. A data frame, a dictionary of arrays, a CSV file or a bag would work as well.

# %%
time = np.arange(0.0, 10.0, 0.005)
waves = [(0.8, 0.31, 0.0), (0.4, 0.83, 1.3)]
angle = sum(a * np.sin(2 * np.pi * f * time + p) for a, f, p in waves)
speed = sum(2 * np.pi * f * a * np.cos(2 * np.pi * f * time + p) for a, f, p in waves)
acceleration = sum(-((2 * np.pi * f) ** 2) * a * np.sin(2 * np.pi * f * time + p) for a, f, p in waves)
inertia, weight = 0.025 + 1.2 * 0.25**2, 1.2 * 0.25 * 9.80665
chance = np.random.default_rng(1)
torque = inertia * acceleration + weight * np.cos(angle) + 0.35 * np.sign(speed)
log = mp.load_recording(
    {
        "time": 1e3 * time,
        "pivot.position": np.degrees(angle + 1e-5 * chance.standard_normal(time.size)),
        "pivot.torque": torque + 0.02 * chance.standard_normal(time.size),
    },
    units={"time": "ms", "pivot.position": "deg"},
    robot=robot,
)
mp.inspect(log, robot)

# %% [markdown]
# ## What is missing

# %%
answer = mp.diagnose(robot, log)
answer

# %%
friction = answer.findings[0]
print(friction.effect, "at", friction.location, friction.parameters["torque"].value, "N m")

# %% [markdown]
# ## Into MuJoCo
#
# The same as `missing-physics export out --to mjcf`, or with `--into pendulum.urdf` for the URDF itself.

# %%
from missing_physics.export import content_of, edited_file, mjcf_of

content = content_of(answer.robot)
(folder / "pendulum.xml").write_text(mjcf_of(content))
print(mjcf_of(content))

# %%
print("\n".join(edited_file(content, folder / "pendulum.urdf").changed))
