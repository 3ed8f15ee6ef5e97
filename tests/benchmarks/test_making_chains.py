"""Cost of making a chain's code: measured by the compiler that the cache calls, and its growth."""

from __future__ import annotations

import pytest

from benchmarks.speed.making import MADE, exponents, made
from reference_model.codegen.compiled import compiler


def test_the_fitted_exponent_is_that_of_a_power_law() -> None:
    lengths = (8, 16, 32)
    rows = [{key: 3.0 * links ** (0.1 * place) for place, key in enumerate(MADE)} for links in lengths]
    found = exponents(lengths, rows)
    assert [found[key] for key in MADE] == pytest.approx(
        [0.1 * place for place in range(len(MADE))], abs=1e-9
    )


@pytest.mark.skipif(compiler() is None, reason="no C compiler")
def test_code_is_recompiled_and_its_cost_is_that_of_the_compiler() -> None:
    first, again = made("straight", "rigid", 2), made("straight", "rigid", 2)
    assert first["library"] == again["library"] > 0  # from an empty cache each time, and the same code
    for found in (first, again):
        assert set(found) == set(MADE)
        assert found["compiling"] > 0
        assert 5 < found["compiler"] < 200  # [MB]: of a compiler, not of the process that measures
