"""URDF and MJCF files edited in place: everything else keeps every byte."""

from robot_model.editing.source import Source, source_of
from robot_model.editing.text import Marked, Tag

__all__ = ["Marked", "Source", "Tag", "source_of"]
