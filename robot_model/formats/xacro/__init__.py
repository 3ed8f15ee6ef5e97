"""xacro, the macro language in which many URDF files are written.

The `xacro` package (ros/xacro, which ROS itself runs) expands macros, properties and conditions. A robot
file is untrusted and must not act on this machine, so three things are replaced in that package: expressions,
which it passes to Python's `eval` with a guard that is easily bypassed, are computed by `simpleeval` from a
list of functions; files are read through the safe parser of all formats, and only inside the robot's own
package and packages that it names; and the size of the result is bounded.
"""

from robot_model.formats.xacro.expansion import expanded

__all__ = ["expanded"]
