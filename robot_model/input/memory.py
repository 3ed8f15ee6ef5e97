"""Too little memory: an error of the machine, not of the input."""

from __future__ import annotations

from robot_model.input.errors import one_sentence

__all__ = ["OutOfMemoryError", "lacks_memory"]

#: Messages of libraries that raise another type than `MemoryError`: C++ (CasADi, Exudyn), Arrow, HDF5, libc.
_WORDS = (
    "bad_alloc",
    "malloc of size",
    "realloc of size",
    "memory allocation failed",
    "unable to allocate",
    "can't allocate",
    "cannot allocate memory",
    "out of memory",
)


class OutOfMemoryError(MemoryError):
    """The machine has too little memory; the message is one sentence for the person at the keyboard."""

    def __init__(self, message: str) -> None:
        super().__init__(one_sentence(message))


def lacks_memory(error: BaseException) -> bool:
    """Whether an error of any type means that memory could not be allocated."""
    if isinstance(error, MemoryError):
        return True
    text = str(error).lower()
    return isinstance(error, RuntimeError | OSError) and any(word in text for word in _WORDS)
