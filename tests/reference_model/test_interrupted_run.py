"""An interrupt ends a simulation, although CasADi reports it as a failure of the right-hand side."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from reference_model.simulation import simulate
from reference_model.steppers import integration
from robot_model import Robot, load_robot

#: Length of a motion [s] whose integration takes a second of a processor.
LONG = 400.0


@pytest.fixture
def _soon(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A CVODES run is interrupted a twentieth of a second after its start."""
    real, begun = integration.cvodes, []
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)

    def interrupted(*args: Any) -> Callable[..., Any]:
        solver = real(*args)

        def run(**given: Any) -> Any:
            if not begun:  # a sampled run is many: each would put the alarm off
                begun.append(True)
                signal.setitimer(signal.ITIMER_REAL, 0.05)
            return solver(**given)

        return run

    monkeypatch.setattr(integration, "cvodes", interrupted)
    yield
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGALRM, before)


def long_motion() -> Robot:
    robot = load_robot("two_link_arm")
    assert robot.reference is not None
    reference = robot.reference.model_copy(update={"duration": LONG})
    return robot.model_copy(update={"reference": reference})


@pytest.mark.usefixtures("_soon")
def test_an_interrupt_of_a_continuous_run_is_propagated(capsys: pytest.CaptureFixture[str]) -> None:
    """The integration is not restarted, and no error is reported."""
    with pytest.raises(KeyboardInterrupt):
        simulate(long_motion())
    assert capsys.readouterr() == ("", "")
