"""CasADi functions as compiled C where a C compiler is present, else unchanged, with the same results.

CasADi evaluates an expression graph in its own virtual machine, at some nanoseconds for each operation. The
same graph as C runs 10 to 25 times faster, but compiling it takes as long as 20,000 to 50,000 evaluations; so
compiled code is cached between runs (see `code_cache`), and callers request it where it is worth the time.

Flags: -O1, and for functions of moderate length that run long, -O2 for this processor and in one piece
(`tuned`): on state derivatives of 2,000 to 6,000 operations this saved a quarter of the time, on their
derivatives of 13,000 half of it. Above, compiling takes longer than it gains: 36,000 operations 14 s, not
3.4 s in pieces, for 6.3 us instead of 10.9 us. -ffp-contract=off keeps processors with fused multiply-add at
the same rounding.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import casadi as ca

from reference_model.codegen.c_pieces import WHOLE, in_pieces
from reference_model.codegen.code_cache import entry, private_folder, store
from robot_model.system.owners import WRITING, held, own_prefix, remove_left

__all__ = [
    "EARNS_AFTER",
    "SWITCH",
    "Code",
    "Compiler",
    "c_library",
    "compiled",
    "compiled_loops",
    "compiler",
    "switched_off",
]

#: Environment variable: `0`, `off` or `no` disables compilation.
SWITCH = "MISSING_PHYSICS_COMPILED"

#: Evaluations after which compiling a function costs less than going on without: about 0.1 to 0.25 ms are
#: needed to compile an operation (gcc 12), and 5 ns to evaluate it uncompiled.
EARNS_AFTER = 30_000

#: In the order of preference.
COMPILERS = ("gcc", "clang", "cc")
FLAGS = ("-O1", "-ffp-contract=off", "-fPIC", "-shared")
#: For this processor, without contraction for the same results; appended to `FLAGS`.
TUNED = ("-O2", "-march=native")
#: Functions with more operations in total take long to compile with `TUNED`: this many, some 6 s.
MOST_TUNED = 25_000
#: A call of compiled code costs as much as some twenty operations in it: a function shorter than this is
#: compiled with the loop that calls it.
MOST_IN_LOOPS = 4_000
#: Functions with more operations in total are not compiled: it would take minutes.
MOST_OPERATIONS = 500_000
#: Time after which compiling is given up [s].
PATIENCE = 300.0
#: Changes when the layout of the generated code does.
GENERATION = "1"

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Code:
    """Functions, compiled or not.

    Attributes:
        functions: with the names, inputs and outputs of those given.
        note: how they run, and if not as compiled code, why.
        library: the file of the compiled code, which exports each function by its name.
    """

    functions: tuple[ca.Function, ...]
    note: str
    library: Path | None = None


@dataclass(frozen=True)
class Compiler:
    """A C compiler: its path and identity."""

    path: str
    identity: str


def switched_off() -> bool:
    """Whether the environment disables compilation."""
    return os.environ.get(SWITCH, "").lower() in {"0", "off", "no", "false"}


def compiler() -> Compiler | None:
    """The C compiler on the path, or None."""
    found = next(filter(None, map(shutil.which, COMPILERS)), None)
    return _identified(found) if found else None


def compiled(functions: Sequence[ca.Function], *, tuned: bool = False) -> Code:
    """The functions as compiled C, from the cache or compiled now; unchanged where that is not possible.

    Args:
        functions: with different names that are valid C identifiers.
        tuned: for this processor where that is worth it, see `TUNED`; the same results.
    """
    own = tuple(functions)
    if switched_off():
        return Code(own, f"CasADi's virtual machine, because of {SWITCH}")
    chosen = compiler()
    if chosen is None:
        return Code(
            own, f"CasADi's virtual machine, because no C compiler ({', '.join(COMPILERS)}) is on the path"
        )
    counted = [function for function in own if function.is_a("SXFunction") or function.is_a("MXFunction")]
    operations = sum(function.n_instructions() for function in counted)
    if operations > MOST_OPERATIONS:
        return Code(
            own, f"CasADi's virtual machine, because {operations} operations take too long to compile"
        )
    more = tuning(chosen) if tuned and operations <= MOST_TUNED else ()
    try:
        loaded, library = _loaded(own, chosen, more)
    except (OSError, RuntimeError, subprocess.SubprocessError) as error:
        reason = _reason(error)
        _log.warning("functions stay uncompiled: %s", reason)
        return Code(own, f"CasADi's virtual machine, because compiling failed: {reason}")
    return Code(loaded, f"compiled by {chosen.identity.splitlines()[0]}", library)


def compiled_loops(function: ca.Function, loops: Callable[[ca.Function], Sequence[ca.Function]]) -> Code:
    """Functions that repeat `function`, as compiled C; a short one together with the loops around it.

    Args:
        function: of scalar operations.
        loops: makes the functions that repeat it, such as maps and chains.
    """
    if function.n_instructions() <= MOST_IN_LOOPS:
        return compiled(loops(function))
    code = compiled([function])
    return Code(tuple(loops(code.functions[0])), code.note, code.library)


def c_library(source: str, *more: str) -> Path:
    """A library compiled from our own C source for this processor, from the cache or compiled now.

    Args:
        source: C.
        more: flags that come after all others.

    Raises:
        FileNotFoundError: there is no C compiler, or it is not to be used.
        OSError, subprocess.SubprocessError: it fails.
    """
    chosen = None if switched_off() else compiler()
    if chosen is None:
        raise FileNotFoundError(
            f"compiled code is switched off by {SWITCH}"
            if switched_off()
            else f"no C compiler ({', '.join(COMPILERS)}) is on the path"
        )
    flags = *tuning(chosen), *more
    folder, key = private_folder(), _key(source, chosen, flags)
    return entry(folder, key) or _made(folder, key, source, chosen, flags)


def _key(source: str, chosen: Compiler, more: Sequence[str] = ()) -> str:
    parts = [GENERATION, source, chosen.path, chosen.identity, *FLAGS, *more, ca.CasadiMeta.version()]
    if set(TUNED) <= set(more):  # a folder that machines share must not give one the code of another
        parts.append(_processor(chosen.path))
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]


def _loaded(
    functions: tuple[ca.Function, ...], chosen: Compiler, more: Sequence[str] = ()
) -> tuple[tuple[ca.Function, ...], Path]:
    source = _source(functions, MOST_TUNED if more else WHOLE)
    folder, key = private_folder(), _key(source, chosen, more)
    path = entry(folder, key)
    if path is not None:
        with contextlib.suppress(RuntimeError):  # intact content that does not load here is recompiled
            return _external(functions, path), path
        path.unlink(missing_ok=True)
    path = _made(folder, key, source, chosen, more)
    return _external(functions, path), path


def _external(functions: tuple[ca.Function, ...], path: Path) -> tuple[ca.Function, ...]:
    found = tuple(ca.external(function.name(), str(path)) for function in functions)
    for own, other in zip(functions, found):
        same = own.n_in() == other.n_in() and own.n_out() == other.n_out()
        same = same and all(own.sparsity_in(k) == other.sparsity_in(k) for k in range(own.n_in()))
        same = same and all(own.sparsity_out(k) == other.sparsity_out(k) for k in range(own.n_out()))
        if not same:
            raise RuntimeError(f"'{path.name}' holds other functions than its name says")
    return found


def _source(functions: tuple[ca.Function, ...], whole: int) -> str:
    generator = ca.CodeGenerator("code.c")
    for function in functions:
        generator.add(function)
    return in_pieces(generator.dump(), whole=whole)


def _made(folder: Path, key: str, source: str, chosen: Compiler, more: Sequence[str] = ()) -> Path:
    remove_left(folder, WRITING)
    begins = own_prefix(WRITING)
    with (
        tempfile.TemporaryDirectory(dir=folder, prefix=begins, ignore_cleanup_errors=True) as work,
        held(Path(work)),
    ):
        code, library = Path(work) / "code.c", Path(work) / "code.so"
        code.write_text(source)
        command = [chosen.path, *FLAGS, *more, str(code), "-o", str(library), "-lm"]
        subprocess.run(command, check=True, capture_output=True, text=True, timeout=PATIENCE, cwd=work)
        return store(folder, key, library)


def tuning(chosen: Compiler) -> tuple[str, ...]:
    """`TUNED`, or nothing where the compiler does not report its meaning."""
    return TUNED if _processor(chosen.path) else ()


@lru_cache(maxsize=8)
def _processor(path: str) -> str:
    """Meaning of `TUNED` on this machine, as reported by the compiler; empty if these flags are unknown."""
    command = [path, *TUNED, "-E", "-v", "-x", "c", os.devnull]
    try:
        output = subprocess.run(command, check=True, capture_output=True, text=True, timeout=PATIENCE).stderr
    except (OSError, subprocess.SubprocessError):
        return ""
    # The line that calls the compiler proper spells the processor out.
    return "\n".join(line.strip() for line in output.splitlines() if "cc1" in line or "-target-cpu" in line)


@lru_cache(maxsize=8)
def _identified(path: str) -> Compiler | None:
    try:
        output = [
            subprocess.run([path, word], check=True, capture_output=True, text=True, timeout=PATIENCE).stdout
            for word in ("--version", "-dumpmachine")
        ]
    except (OSError, subprocess.SubprocessError):
        return None
    return Compiler(path, "\n".join(text.strip() for text in output))


def _reason(error: Exception) -> str:
    """The first line with an error of the compiler or of Python."""
    output = (getattr(error, "stderr", None) or str(error)).strip().splitlines()
    return next((line for line in output if "error" in line), (output or [type(error).__name__])[0])
