"""The verdict as a function of the residual, the findings and further results of the search."""

from __future__ import annotations

import pytest

from missing_physics.diagnosis.comparison.verdict import Held, Search, decided, energies
from missing_physics.results.result import Finding, Unnamed, Verdict

NAME = Finding("coulomb_friction", "joint1", 0.99, {})
RIVALS = Finding("coulomb_friction", "joint1", 0.6, {}, ambiguous_with=("torque_offset@joint1",))
CURVE = Unnamed("joint1", "joint1.torque", "N m", ("joint1.velocity",), 0.5, 1.0, (), (), "A curve.")

#: Nominal, standard model, answer, noise.
AT_NOISE = Held(10.0, 1.1, 1.1, 1.0)
LITTLE = Held(10.0, 1.9, 1.8, 1.0)  # (1.8^2 - 1) of (10^2 - 1): 2 %
MUCH = Held(10.0, 6.0, 4.0, 1.0)  # 15 %
UNTOUCHED = Held(3.0, 2.9, 3.0, 1.0)  # a joint at which nothing was found
LARGE = Held(100.0, 20.0, 1.3, 1.0)
NOT_BETTER = Held(10.0, 4.0, 4.05, 1.0)
NO_STANDARD = Held(10.0, None, 4.0, 1.0)


@pytest.mark.parametrize(
    ("errors", "findings", "unnamed", "search", "verdict"),
    [
        ([MUCH], (), (), Search("consistent"), "consistent"),
        ([MUCH], (NAME,), (), Search("not_enough_data"), "not_enough_data"),
        ([MUCH], (), (), Search("unexplained"), "unexplained"),
        ([AT_NOISE], (NAME,), (), Search("explained"), "explained"),
        ([AT_NOISE], (NAME,), (CURVE,), Search("explained"), "explained"),
        ([LITTLE], (NAME,), (), Search("explained"), "explained"),
        ([LITTLE], (NAME,), (CURVE,), Search("explained"), "partly_explained"),
        ([MUCH], (NAME,), (), Search("explained"), "partly_explained"),
        ([MUCH], (NAME,), (), Search("unexplained"), "partly_explained"),
        ([AT_NOISE, MUCH], (NAME,), (), Search("explained"), "partly_explained"),
        ([AT_NOISE, LITTLE], (NAME,), (), Search("explained"), "explained"),
        ([LARGE, UNTOUCHED], (NAME,), (), Search("explained"), "partly_explained"),
        ([NOT_BETTER], (NAME,), (), Search("explained", explained=0.9), "unexplained"),
        ([NO_STANDARD], (NAME,), (), Search("explained", explained=0.9), "partly_explained"),
        ([NO_STANDARD], (NAME,), (), Search("unexplained", explained=0.4), "unexplained"),
        ([AT_NOISE], (NAME,), (), Search("explained", worse=True), "unexplained"),
        ([MUCH], (RIVALS,), (), Search("ambiguous", worse=True, explained=0.9), "unexplained"),
        ([LITTLE], (NAME,), (), Search("explained", mixed=True), "partly_explained"),
        ([AT_NOISE], (NAME, RIVALS), (), Search("ambiguous"), "ambiguous"),
        ([LITTLE], (NAME, RIVALS), (), Search("ambiguous"), "ambiguous"),
        ([MUCH], (RIVALS,), (), Search("ambiguous", explained=0.9), "partly_explained"),
        ([NOT_BETTER], (RIVALS,), (), Search("ambiguous", explained=0.9), "unexplained"),
        ([NO_STANDARD], (RIVALS,), (), Search("ambiguous", explained=0.3), "unexplained"),
        ([], (NAME,), (), Search("explained", explained=0.9), "partly_explained"),
        ([AT_NOISE], (), (), Search("unexplained", renumbered=True, explained=1.0), "explained"),
        ([NO_STANDARD], (), (), Search("unexplained", renumbered=True, explained=0.8), "partly_explained"),
        ([AT_NOISE], (), (), Search("unexplained", renumbered=True, worse=True), "unexplained"),
    ],
)
def test_verdicts(
    errors: list[Held],
    findings: tuple[Finding, ...],
    unnamed: tuple[Unnamed, ...],
    search: Search,
    verdict: Verdict,
) -> None:
    assert decided(errors, findings, unnamed, search) == verdict


def test_a_channel_without_noise_that_is_predicted_exactly_has_a_verdict() -> None:
    before, after = energies([Held(1.0, None, 0.0, 0.0)])
    assert before > 1.0
    assert after == 0.0
