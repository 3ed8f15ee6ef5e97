"""An interrupt ends a simulation, although Exudyn reports it as an error of the Python code it calls."""

from __future__ import annotations

import os
import signal

import pytest
from exudyn_robots import pendulum

from exudyn_model import simulate


@pytest.mark.parametrize("formulation", ["tree", "redundant"])
def test_an_interrupt_is_propagated_from_the_solver(
    formulation: str, capsys: pytest.CaptureFixture[str]
) -> None:
    seen: list[float] = []

    def interrupt(time: float) -> None:
        seen.append(time)
        if len(seen) == 3:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        simulate(pendulum(), formulation=formulation, progress=interrupt)  # type: ignore[arg-type]
    assert len(seen) == 3
    assert capsys.readouterr().err == ""
