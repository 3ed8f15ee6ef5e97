"""URDF and MJCF files changed in place: what is not changed keeps every byte."""

from robot_model.editing.source import Source, source_of
from robot_model.editing.text import Marked, Tag

__all__ = ["Marked", "Source", "Tag", "source_of"]
