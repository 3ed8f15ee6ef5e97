"""Code shared by the readers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from missing_physics.recordings.readers.source import Source
from robot_model import InputError, OutOfMemoryError, lacks_memory, lacks_room

__all__ = ["LONGEST_REASON", "reading"]

#: Most characters of a library's message that are shown.
LONGEST_REASON = 160


@contextmanager
def reading(source: Source, kind: str) -> Iterator[None]:
    """Turn whatever a format library raises on a damaged file into an `InputError`.

    The libraries raise a dozen different types on damaged bytes (among them zlib.error, struct.error,
    KeyError, RecursionError), and none of them documents which; so all are caught here. Insufficient memory
    is
    not damage: it becomes an `OutOfMemoryError`, whatever the library raises.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        if lacks_memory(error):
            raise OutOfMemoryError(
                f"{source} takes more memory than is free; close other programs, or keep fewer samples or "
                "columns."
            ) from None
        reason = " ".join(str(error).split())[:LONGEST_REASON].rstrip(".") or type(error).__name__
        if lacks_room(error):
            raise InputError(f"{source} cannot be read: {reason}.") from None
        raise InputError(
            f"{source} cannot be read as {kind}; it may be truncated or damaged ({reason}); export it again."
        ) from None
