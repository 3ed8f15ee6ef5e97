"""Objects of MATLAB's classes, whose format is not published: instructions to convert them in MATLAB."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["closed_objects"]

_SERIES = "s = struct('t', {0}.Time, 'y', squeeze({0}.Data)); save('numbers.mat', '-struct', 's')"
_ELEMENT = _SERIES.format("e")
#: Instructions to convert an object to arrays, with a placeholder for its name, by the start of its class
#: name.
_REMEDIES = {
    "timeseries": _SERIES,
    "Simulink.SimulationData.Dataset": f"for each element, e = {{0}}{{{{1}}}}.Values; {_ELEMENT}",
    "Simulink.SimulationOutput": f"d = {{0}}.logsout; for each element, e = d{{{{1}}}}.Values; {_ELEMENT}",
    "Simulink.SimulationData.Signal": f"e = {{0}}.Values; {_ELEMENT}",
    "timetable": "writetimetable({0}, 'log.csv')",
    "table": "writetable({0}, 'log.csv')",
}
_ELSE = "save its numbers as arrays"


def closed_objects(classes: Mapping[str, str]) -> dict[str, str]:
    """Class of each object and how to convert it, as the end of a sentence, by the name of the variable."""
    found = {}
    for name, of_class in classes.items():
        known = next((text for begin, text in _REMEDIES.items() if of_class.startswith(begin)), _ELSE)
        found[name] = (
            f"an object of the class {of_class}, which only MATLAB opens; there, {known.format(name)}"
        )
    return found
