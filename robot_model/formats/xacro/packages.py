"""Files that a xacro file may read: those of its own package and of packages that it names."""

from __future__ import annotations

import os
from pathlib import Path
from xml.dom.minidom import Document

from defusedxml import DefusedXmlException
from defusedxml.minidom import parseString

from robot_model.formats.parts.sources import bytes_of
from robot_model.input.errors import InputError

__all__ = ["Packages"]

#: The file that marks the folder of a ROS package.
MANIFEST = "package.xml"

#: Environment variables in which ROS 2 and ROS 1 list folders with packages, and the packages' subfolder.
PATHS = (("AMENT_PREFIX_PATH", "share/{}"), ("ROS_PACKAGE_PATH", "{}"))


class Packages:
    """The folders that may be read, starting from a main file's."""

    def __init__(self, main: Path) -> None:
        here = main.resolve().parent
        own = next((folder for folder in (here, *here.parents) if (folder / MANIFEST).is_file()), here)
        self._own, self._open = own, [own]

    def find(self, name: str) -> str:
        """Folder of a package, readable from now on: the file's own, one next to it, or one known to ROS."""
        places = [self._own, *self._own.parents]
        candidates = [place for place in places if place.name == name]
        candidates += [place / name for place in places[:3]]
        for variable, where in PATHS:
            listed = os.environ.get(variable, "").split(os.pathsep)
            candidates += [Path(entry) / where.format(name) for entry in listed if entry]
        for folder in candidates:
            if "/" not in name and ".." not in name and folder.is_dir():
                self._open.append(folder.resolve())
                return str(folder)
        raise InputError(
            f"the package '{name}' of $(find {name}) is neither around the file nor in a folder that "
            "ROS_PACKAGE_PATH or AMENT_PREFIX_PATH names"
        )

    def content(self, file: str | os.PathLike[str]) -> bytes:
        """Content of a file inside the open folders. Raises `InputError`."""
        path = Path(file).resolve()
        if not any(path.is_relative_to(folder) for folder in self._open):
            raise InputError(f"'{file}' is outside the robot's package and those that it names")
        if not path.is_file():
            raise InputError(f"'{file}' is no file")
        return bytes_of(path)

    def document(self, file: str | os.PathLike[str]) -> Document:
        """An XML document inside the open folders. Raises `InputError`."""
        try:
            found: Document = parseString(self.content(file))
        except DefusedXmlException:
            raise InputError(
                f"'{file}' declares entities or refers to another file, which is refused"
            ) from None
        return found
