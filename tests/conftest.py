"""Settings of all tests."""

import os

from hypothesis import HealthCheck, settings

# Compiling would cost the quick tests more than it brings; the tests of compiled code switch it on.
os.environ.setdefault("MISSING_PHYSICS_COMPILED", "off")

# No test depends on elapsed time: machines are shared. A fixture's folder may serve all examples of a test.
IGNORED = (HealthCheck.too_slow, HealthCheck.function_scoped_fixture)
settings.register_profile("shared_machine", deadline=None, suppress_health_check=IGNORED)
settings.load_profile("shared_machine")
