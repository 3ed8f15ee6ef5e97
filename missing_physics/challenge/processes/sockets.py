"""Filter of system calls for the diagnosing process, which prevents sockets to the host of a virtual machine.

A network namespace does not cover AF_VSOCK, by which a virtual machine communicates with its host. The filter
rejects `socket(AF_VSOCK)` and `io_uring_setup` (whose operations a filter cannot see) with EPERM, and kills a
process that uses another architecture's call numbers (seccomp(2), BPF_MODE_FILTER). Child processes inherit
it.
"""

from __future__ import annotations

import sys

__all__ = ["CLOSED", "behind_filter"]

#: Installs the filter, then runs the module given first with the other arguments. It is self-contained:
#: the challenge is not accessible where it runs.
CLOSED = """
import ctypes, platform, runpy, struct, sys
numbers = {"x86_64": (0xC000003E, 41), "aarch64": (0xC00000B7, 198)}
refused = True
if sys.platform == "linux" and sys.byteorder == "little" and platform.machine() in numbers:
    architecture, socket = numbers[platform.machine()]
    LOAD, EQUAL, ABOVE, RETURN = 0x20, 0x15, 0x35, 0x06
    ALLOW, REFUSE, KILL = 0x7FFF0000, 0x00050001, 0x80000000
    orders = [
        (LOAD, 0, 0, 4), (EQUAL, 1, 0, architecture), (RETURN, 0, 0, KILL),
        (LOAD, 0, 0, 0), (ABOVE, 5, 0, 0x40000000), (EQUAL, 4, 0, 425),
        (EQUAL, 0, 2, socket), (LOAD, 0, 0, 16), (EQUAL, 1, 0, 40),
        (RETURN, 0, 0, ALLOW), (RETURN, 0, 0, REFUSE),
    ]
    code = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *order) for order in orders))
    class Program(ctypes.Structure):
        _fields_ = [("count", ctypes.c_ushort), ("orders", ctypes.c_void_p)]
    program = Program(len(orders), ctypes.addressof(code))
    prctl = ctypes.CDLL(None, use_errno=True).prctl
    prctl.argtypes = [ctypes.c_int] + [ctypes.c_ulong] * 4
    prctl(38, 1, 0, 0, 0)  # PR_SET_NO_NEW_PRIVS
    refused = prctl(22, 2, ctypes.addressof(program), 0, 0) != 0  # PR_SET_SECCOMP
if refused:
    print("no filter of system calls on this machine", file=sys.stderr)
module, sys.argv = sys.argv[1], sys.argv[1:]
runpy.run_module(module, run_name="__main__", alter_sys=True)
"""


def behind_filter(module: str, *arguments: str) -> list[str]:
    """Command that runs a Python module behind the filter."""
    return [sys.executable, "-c", CLOSED, module, *arguments]
