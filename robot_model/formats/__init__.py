"""Robots from files of other programs: URDF, xacro and MJCF, with an overlay for what they cannot say.

Why the project reads these formats by itself, on top of an XML parser:

- MuJoCo's `MjSpec` reads MJCF and URDF, but weighs some 100 MB with its viewer, drops a URDF's dry friction,
  effort limits, transmissions and the names of links that it fuses, computes inertias only when it compiles,
  which needs all meshes, and knows neither line numbers nor a way to refuse files outside a folder.
- `yourdfpy` and `urchin` read URDF for kinematics and pictures: they bring trimesh and its meshes, and write
  mistakes to a log instead of refusing the file. `urdf_parser_py` has had no release since 2021.
- What a dynamics model needs of either format are a few dozen attributes. `defusedxml` reads the XML safely;
  what the attributes mean is checked in the tests against Pinocchio and MuJoCo themselves.

Meshes are never opened, so that missing ones and ``package://`` addresses do no harm.
"""
