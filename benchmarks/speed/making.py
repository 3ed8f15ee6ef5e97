"""Time and memory of making a chain's state derivative, each measured in a separate process.

    python -m benchmarks.speed.making loop|straight rigid|flexible LINKS

prints one measurement as JSON. Code is compiled into an empty cache, by a compiler wrapped in a short script,
which reports the compiler's processor time and the largest memory of its processes: the system's value for a
process includes the memory of the one that started it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.work_precision.footprint import peak
from reference_model.codegen.code_cache import FOLDER_VARIABLE
from reference_model.codegen.compiled import SWITCH, compiler

__all__ = ["MADE", "exponents", "made"]

ROOT = Path(__file__).resolve().parents[2]
#: Measured quantities, in the order of the table's columns.
MADE = ("equations", "generating", "memory", "compiling", "compiler", "library")
#: In place of the compiler on the path: runs it, and appends [s, kB] of its processes to a file.
SCRIPT = """#!{python} -S
import json, resource, subprocess, sys
code = subprocess.run([{path!r}, *sys.argv[1:]]).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
with open({log!r}, "a") as file:
    file.write(json.dumps([used.ru_utime + used.ru_stime, used.ru_maxrss]) + "\\n")
sys.exit(code)
"""


def made(way: str, kind: str, links: int) -> Mapping[str, float]:
    """Measured in a fresh process: `MADE`, times in s, memory in MB, the library in kB.

    Args:
        way: `loop` or `straight`.
        kind: `rigid` or `flexible`.
        links: of the chain.
    """
    chosen = compiler()
    assert chosen is not None, "no C compiler on the path"
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "bin").mkdir()
        script, log = folder / "bin" / Path(chosen.path).name, folder / "log"
        script.write_text(SCRIPT.format(python=sys.executable, path=chosen.path, log=str(log)))
        script.chmod(0o700)
        environment = {
            **os.environ,
            "PATH": f"{script.parent}{os.pathsep}{os.environ['PATH']}",
            FOLDER_VARIABLE: str(folder / "code"),
            SWITCH: "on",
        }
        words = [sys.executable, "-m", "benchmarks.speed.making", way, kind, str(links)]
        run = subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
        found: dict[str, float] = json.loads(run.stdout.splitlines()[-1])
        used = [json.loads(line) for line in log.read_text().splitlines()]
    found["compiling"] = sum(seconds for seconds, _ in used)
    found["compiler"] = max(kilobytes for _, kilobytes in used) / 1024
    return found


def exponents(links: Sequence[int], rows: Sequence[Mapping[str, float]]) -> Mapping[str, float]:
    """Exponents of the growth of every value with the number of links, by least squares of logarithms."""
    over = np.log(links)
    return {key: float(np.polyfit(over, np.log([row[key] for row in rows]), 1)[0]) for key in MADE}


def _measured(way: str, kind: str, links: int) -> Mapping[str, float]:
    from benchmarks.speed.chains import chain
    from reference_model.codegen.compiled import compiled
    from reference_model.kernels import looped_rate
    from reference_model.plant.closed_loop import Plant

    before, start = peak(), time.process_time()
    plant = Plant(chain(links, flexible=kind == "flexible"))
    built = time.process_time()
    function = looped_rate(plant) if way == "loop" else plant.rate
    assert function is not None
    code = compiled([function])
    done = time.process_time()
    assert code.library is not None, code.note
    size = code.library.stat().st_size / 1024
    memory = peak() - before
    return {"equations": built - start, "generating": done - built, "memory": memory, "library": size}


if __name__ == "__main__":
    print(json.dumps(_measured(sys.argv[1], sys.argv[2], int(sys.argv[3]))))
