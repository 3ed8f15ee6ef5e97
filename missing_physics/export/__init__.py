"""A robot in the format of another simulator, and code for effects that the format cannot hold."""

from missing_physics.export.content import Content, content_of
from missing_physics.export.mjcf import mjcf_of
from missing_physics.export.own_file import Edited, edited_file
from missing_physics.export.plain import json_of
from missing_physics.export.snippets import code_of
from missing_physics.export.urdf import urdf_of

__all__ = ["Content", "Edited", "code_of", "content_of", "edited_file", "json_of", "mjcf_of", "urdf_of"]
