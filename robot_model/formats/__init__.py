"""Robots from files of other programs: URDF, xacro and MJCF, with an overlay for what they cannot hold.

Why the project reads these formats itself, on top of an XML parser:

- MuJoCo's `MjSpec` reads MJCF and URDF well, but comes with a simulator and a viewer (about 100 MB with what
  they need). Masses that follow from geoms are known only after it has compiled a model, for which every mesh
  must be there; it includes files from anywhere, and leaves out a URDF's speed limits and transmissions.
- `yourdfpy` and `urchin` read URDF for kinematics and pictures: they need `trimesh` for its meshes, and
  `yourdfpy` collects mistakes in a list instead of refusing the file. `urdf_parser_py` has had no release
  since 2021.
- A model of the dynamics needs only a few dozen attributes of either format. `defusedxml` reads the XML
  safely; tests against Pinocchio and MuJoCo check that the attributes have the same meaning here.

Meshes are never opened, so that missing ones and ``package://`` addresses cause no errors.
"""
