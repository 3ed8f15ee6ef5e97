"""Settings of all tests."""

import os

# Compiling would cost the quick tests more than it brings; the tests of compiled code switch it on.
os.environ.setdefault("MISSING_PHYSICS_COMPILED", "off")
