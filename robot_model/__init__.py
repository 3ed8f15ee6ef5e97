"""What a robot is, and what a recording of it is. Knows no other room."""

from robot_model.control import (
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
    Table,
    VoltageServo,
)
from robot_model.errors import InputError, nearest
from robot_model.files import replacing, write_atomically
from robot_model.flexible import (
    Beam,
    GeneralSection,
    ModalBody,
    Rectangle,
    Section,
    StrainGauge,
    TipBody,
    Tube,
)
from robot_model.loader import load_robot, robot_from_toml, robot_to_toml, save_robot, shipped_robots
from robot_model.modal_file import ModalMatrices, read_modal_file
from robot_model.recording import QUANTITIES, Recording, unit_of
from robot_model.types import Actuator, Base, Bearing, EffectUse, Inertial, Joint, Link, Robot, Sensor

__all__ = [
    "QUANTITIES",
    "Actuator",
    "Base",
    "Beam",
    "Bearing",
    "ComputedTorque",
    "Controller",
    "Cycloid",
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
    "MultiSine",
    "NoController",
    "Quintic",
    "Recording",
    "Rectangle",
    "Reference",
    "Robot",
    "Section",
    "Sensor",
    "StrainGauge",
    "Table",
    "TipBody",
    "Tube",
    "VoltageServo",
    "load_robot",
    "nearest",
    "read_modal_file",
    "replacing",
    "robot_from_toml",
    "robot_to_toml",
    "save_robot",
    "shipped_robots",
    "unit_of",
    "write_atomically",
]
