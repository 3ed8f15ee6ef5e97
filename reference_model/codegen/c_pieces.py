"""Long C functions cut into pieces, so that the time to compile them grows with their length only.

CasADi writes an expression graph as one C function of one assignment per line. Compilers need time that
grows faster than the length of such a function: 13,000 lines take gcc as long in one piece as in pieces of
300, 36,000 lines twice as long. Values that a later piece needs travel through an array.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

__all__ = ["PIECE", "WHOLE", "in_pieces"]

#: Lines of one piece; measured to compile fastest, while the code loses about a third of its speed.
PIECE = 300

#: Functions up to this many lines are not split: compiling takes no longer, and code is 1.4 times as fast.
WHOLE = 15_000

_HEAD = re.compile(
    r"^static int (\w+)\(const casadi_real\*\* arg, casadi_real\*\* res, casadi_int\* iw, "
    r"casadi_real\* w, int mem\) \{$"
)
_VARIABLE = re.compile(r"\ba(\d+)\b")
_ASSIGNMENT = re.compile(r"^  a(\d+) ?=(.*);$")
_RESULT = re.compile(r"^  if \(res\[\d+\]!=0\) res\[\d+\]\[\d+\]=(.*);$")
_DECLARATION = re.compile(r"^  casadi_real a\d+(, a\d+)*;$")
_NOT_INLINED = "static __attribute__((noinline)) void"


@dataclass(frozen=True)
class _Piece:
    """Some lines, the variables they read before they write them, and those they write."""

    lines: Sequence[str]
    read: frozenset[str]
    written: frozenset[str]


def in_pieces(source: str, *, whole: int = WHOLE, size: int = PIECE) -> str:
    """The same C source with every function of more than `whole` assignments cut into pieces of `size`.

    Functions that hold anything but scalar assignments are unchanged.
    """
    lines, found, row = source.split("\n"), [], 0
    while row < len(lines):
        head = _HEAD.match(lines[row])
        end = lines.index("}", row) if head else row
        if head:
            found += _function(head.group(1), lines[row : end + 1], whole, size)
        else:
            found.append(lines[row])
        row = end + 1
    return "\n".join(found)


def _function(name: str, lines: list[str], whole: int, size: int) -> list[str]:
    body = [line for line in lines[1:-1] if not _DECLARATION.match(line) and line != "  return 0;"]
    if len(body) <= whole or not all(_ASSIGNMENT.match(line) or _RESULT.match(line) for line in body):
        return lines
    pieces = [_piece(body[start : start + size]) for start in range(0, len(body), size)]
    kept = _kept(pieces)
    place = {variable: k for k, variable in enumerate(sorted(frozenset().union(*kept)))}
    found: list[str] = []
    for k, (piece, out) in enumerate(zip(pieces, kept)):
        own = ", ".join(f"a{variable}" for variable in sorted(piece.read | piece.written))
        found += [
            f"{_NOT_INLINED} {name}_{k}(const casadi_real** arg, casadi_real** res, casadi_real* s) {{",
            f"  casadi_real {own};",
            *(f"  a{variable}=s[{place[variable]}];" for variable in sorted(piece.read)),
            *piece.lines,
            *(f"  s[{place[variable]}]=a{variable};" for variable in sorted(out)),
            "}",
        ]
    calls = [f"  {name}_{k}(arg, res, s);" for k in range(len(pieces))]
    return [*found, lines[0], f"  casadi_real s[{max(1, len(place))}];", *calls, "  return 0;", "}"]


def _piece(lines: Sequence[str]) -> _Piece:
    read: set[str] = set()
    written: set[str] = set()
    for line in lines:
        assignment = _ASSIGNMENT.match(line)
        used = assignment.group(2) if assignment else line
        read |= set(_VARIABLE.findall(used)) - written
        if assignment:
            written.add(assignment.group(1))
    return _Piece(lines, frozenset(read), frozenset(written))


def _kept(pieces: Sequence[_Piece]) -> list[frozenset[str]]:
    """For each piece the variables it writes that a later piece reads (liveness, from the end)."""
    live: frozenset[str] = frozenset()
    kept = []
    for piece in reversed(pieces):
        kept.append(live & piece.written)
        live = (live - piece.written) | piece.read
    return kept[::-1]
