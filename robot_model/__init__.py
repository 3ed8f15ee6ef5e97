"""Description of robots and their recordings. Imports no other package of the project.

Files of flexible bodies are read by a module that needs SciPy's sparse matrices; it is loaded when used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from robot_model.description.control import (
    AdaptiveNetwork,
    ComputedTorque,
    Controller,
    Cycloid,
    Hold,
    JointPD,
    JointReference,
    MultiSine,
    NoController,
    Quintic,
    Reference,
    SlidingMode,
    Table,
    VoltageServo,
)
from robot_model.description.flexible import (
    Beam,
    GeneralSection,
    ModalBody,
    Rectangle,
    Section,
    SprungMass,
    StrainGauge,
    TipBody,
    Tube,
)
from robot_model.description.recording import QUANTITIES, Recording, unit_of
from robot_model.description.transmission import Drive, Motor, Transmission
from robot_model.description.types import Base, Bearing, EffectUse, Inertial, Joint, Link, Robot, Sensor
from robot_model.input import OutOfMemoryError, lacks_memory, toml_tables, toml_text
from robot_model.input.errors import InputError, nearest
from robot_model.joint.actuator import Actuator
from robot_model.joint.clearance import Clearance
from robot_model.joint.thermal import ConstantTemperature, SelfHeating, TemperatureTable, Thermal
from robot_model.loader import (
    load_robot,
    read_robot,
    robot_from_toml,
    robot_to_toml,
    save_robot,
    shipped_robots,
)
from robot_model.system.files import lacks_room, replacing, require_folder, write_atomically
from robot_model.system.folders import replacing_set

if TYPE_CHECKING:
    from robot_model.modal_file import ModalMatrices, read_modal_file

__all__ = [
    "QUANTITIES",
    "Actuator",
    "AdaptiveNetwork",
    "Base",
    "Beam",
    "Bearing",
    "Clearance",
    "ComputedTorque",
    "ConstantTemperature",
    "Controller",
    "Cycloid",
    "Drive",
    "EffectUse",
    "GeneralSection",
    "Hold",
    "Inertial",
    "InputError",
    "Joint",
    "JointPD",
    "JointReference",
    "Link",
    "ModalBody",
    "ModalMatrices",
    "Motor",
    "MultiSine",
    "NoController",
    "OutOfMemoryError",
    "Quintic",
    "Recording",
    "Rectangle",
    "Reference",
    "Robot",
    "Section",
    "SelfHeating",
    "Sensor",
    "SlidingMode",
    "SprungMass",
    "StrainGauge",
    "Table",
    "TemperatureTable",
    "Thermal",
    "TipBody",
    "Transmission",
    "Tube",
    "VoltageServo",
    "lacks_memory",
    "lacks_room",
    "load_robot",
    "nearest",
    "read_modal_file",
    "read_robot",
    "replacing",
    "replacing_set",
    "require_folder",
    "robot_from_toml",
    "robot_to_toml",
    "save_robot",
    "shipped_robots",
    "toml_tables",
    "toml_text",
    "unit_of",
    "write_atomically",
]

#: Names of the module that is loaded when it is used.
_MODAL = ("ModalMatrices", "read_modal_file")


def __getattr__(name: str) -> Any:
    """Names that are loaded on first use."""
    if name not in _MODAL:
        raise AttributeError(f"module 'robot_model' has no attribute '{name}'")
    from robot_model import modal_file

    return getattr(modal_file, name)
