"""External input: text read in bounded time and memory, and errors of too little memory."""

from robot_model.input.memory import OutOfMemoryError, lacks_memory
from robot_model.input.toml import toml_tables, toml_text

__all__ = ["OutOfMemoryError", "lacks_memory", "toml_tables", "toml_text"]
