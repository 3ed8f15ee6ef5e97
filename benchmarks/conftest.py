"""Additional data in every benchmark report."""

from __future__ import annotations

import os
from typing import Any

__all__ = ["pytest_benchmark_update_machine_info"]


def pytest_benchmark_update_machine_info(config: Any, machine_info: dict[str, Any]) -> None:
    """The load of the machine in the minute before, where the system reports it."""
    if hasattr(os, "getloadavg"):
        machine_info["load"] = os.getloadavg()[0]
