"""Default classes: attributes that elements take where they give none themselves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from robot_model.formats.parts.markup import Element
from robot_model.input.errors import nearest

__all__ = ["ACTUATORS", "Defaults", "read_defaults"]

#: Kinds of actuators; they share one set of defaults.
ACTUATORS = (
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "orientation",
    "pid",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
    "dcmotor",
    "plugin",
)

#: Ways to give an orientation, of which an element has one; its own excludes those of its class.
ORIENTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")

#: The class of elements that name none.
MAIN = "main"


@dataclass(frozen=True)
class Defaults:
    """Attributes by class and kind of element, those of the outer classes included."""

    classes: Mapping[str, Mapping[str, Mapping[str, str]]]

    def resolved(self, element: Element, childclass: str) -> Element:
        """The element with what its class gives, else the class of the body around it."""
        name = element.attributes.get("class", childclass)
        if name not in self.classes:
            element.fault(f"has the class '{name}', which is no default class{nearest(name, self.classes)}")
        given = self.classes[name].get(_kind(element.tag), {})
        if any(key in element.attributes for key in ORIENTATIONS):
            given = {key: value for key, value in given.items() if key not in ORIENTATIONS}
        return replace(element, attributes={**given, **element.attributes})


def read_defaults(root: Element) -> Defaults:
    """The classes of a model."""
    classes: dict[str, dict[str, dict[str, str]]] = {MAIN: {}}
    for element in root.all("default"):
        _collect(element, MAIN, classes)
        if "class" in element.attributes:  # older files name the outermost class
            classes[element.attributes["class"]] = classes[MAIN]
    return Defaults(classes)


def _collect(element: Element, name: str, classes: dict[str, dict[str, dict[str, str]]]) -> None:
    own = classes[name]
    for child in element.children:
        if child.tag != "default":
            kind = _kind(child.tag)
            own[kind] = {**own.get(kind, {}), **child.attributes}
    for child in element.all("default"):
        inner = child.text("class")
        classes[inner] = {kind: dict(attributes) for kind, attributes in own.items()} | classes.get(inner, {})
        _collect(child, inner, classes)


def _kind(tag: str) -> str:
    return "actuator" if tag in ACTUATORS else tag
