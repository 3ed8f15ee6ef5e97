"""Settings of all tests."""

import os
import signal
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

# No test depends on elapsed time: machines are shared. A fixture's folder may serve all examples of a test.
IGNORED = (HealthCheck.too_slow, HealthCheck.function_scoped_fixture)
QUICK, THOROUGH = 10, 150
for name, examples in (("quick", QUICK), ("thorough", THOROUGH)):  # the quick ones are the same every time
    settings.register_profile(
        name,
        max_examples=examples,
        derandomize=name == "quick",
        deadline=None,
        suppress_health_check=IGNORED,
    )
settings.load_profile("quick")  # `make proof` chooses the other one

# A shell that starts tests in the background has them ignore interrupts, which some of them are about.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True, scope="session")
def _disks_are_not_waited_for() -> Iterator[None]:
    """No test cuts the power; waiting until a disk has written takes a third of some tests' time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda handle: None)
        yield
