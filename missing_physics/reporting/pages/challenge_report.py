"""The score of a blind challenge as one HTML file, like the report of a diagnosis."""

from __future__ import annotations

import os

from plotly.offline import get_plotlyjs

from missing_physics.challenge.cases.families import MEANING
from missing_physics.challenge.page import case_line, falls_short, interval, percent, proper_scores, wanted
from missing_physics.challenge.scoring.result import Report
from missing_physics.challenge.scoring.shares import FEW
from missing_physics.challenge.scoring.shortfalls import shortfalls
from missing_physics.challenge.scoring.summary import Summary, summary_of
from missing_physics.reporting.elements.figures import Figure, Spec, axis, label, layout
from missing_physics.reporting.elements.palette import AFTER, NOISE
from missing_physics.reporting.pages.html_report import asset, environment, policy
from robot_model import write_atomically

__all__ = ["render_challenge", "write_challenge"]

#: Height of a row of the confusion matrix, and of what stands around it [px].
ROW, AROUND = 24, 230


def write_challenge(report: Report, path: str | os.PathLike[str], *, title: str = "Blind challenge") -> None:
    """Write the page to `path` atomically. Raises `InputError` if it cannot be written."""
    write_atomically(path, render_challenge(report, title=title))


def render_challenge(report: Report, *, title: str = "Blind challenge") -> str:
    """The page as text; every name in it passes through autoescaping."""
    found = summary_of(report)
    library, script = get_plotlyjs().replace("</script", "<\\/script"), asset("figures.js")
    return (
        environment()
        .get_template("challenge.html")
        .render(
            title=title,
            facts=report.facts,
            unmade=report.unmade,
            found=found,
            meaning=MEANING,
            figures=[_calibration(found), _confusion(found)],
            interval=interval,
            percent=percent,
            wanted=wanted,
            case_line=case_line,
            short=falls_short(report, found),
            proper=proper_scores(found),
            shortfalls=shortfalls(report.scores),
            style=asset("style.css"),
            library=library,
            script=script,
            policy=policy(library, script),
        )
    )


def _calibration(found: Summary) -> Figure:
    """Share right over the stated probability, with Wilson's intervals."""
    rows = found.calibration
    shares = [share.value for *_, share in rows]
    marks: Spec = {
        "type": "scatter",
        "mode": "markers",
        "x": [mean for _, _, mean, _ in rows],
        "y": shares,
        "name": "findings",
        "marker": {"color": AFTER, "size": [16 if share.count >= FEW else 8 for *_, share in rows]},
        "error_y": {
            "type": "data",
            "symmetric": False,
            "array": [share.interval[1] - share.value for *_, share in rows],
            "arrayminus": [share.value - share.interval[0] for *_, share in rows],
        },
        "text": [f"{share.hits} of {share.count}" for *_, share in rows],
    }
    ideal: Spec = {
        "type": "scatter",
        "mode": "lines",
        "x": [0, 1],
        "y": [0, 1],
        "name": "as stated",
        "line": {"color": NOISE, "dash": "dot", "width": 1},
    }
    return Figure(
        "calibration",
        [ideal, marks],
        layout(
            xaxis=axis("stated probability", range=[-0.03, 1.03]), yaxis=axis("right", range=[-0.03, 1.03])
        ),
        title="Stated probability against share right",
        caption=f"Small marks stand for fewer than {FEW} findings and do not count.",
    )


def _confusion(found: Summary) -> Figure:
    """Confusion matrix: number of cases by named and hidden effect."""
    hidden = sorted({truth for truth, _ in found.confusion}, reverse=True)
    named = sorted({name for _, name in found.confusion})
    counts = [[found.confusion.get((truth, name), 0) for name in named] for truth in hidden]
    heat: Spec = {
        "type": "heatmap",
        "x": [label(name) for name in named],
        "y": [label(truth) for truth in hidden],
        "z": counts,
        "text": [[str(count) if count else "" for count in row] for row in counts],
        "texttemplate": "%{text}",
        "colorscale": [[0, "#FFFFFF"], [1, AFTER]],
        "showscale": False,
        "xgap": 1,
        "ygap": 1,
    }
    return Figure(
        "confusion",
        [heat],
        layout(xaxis=axis("named", tickangle=-45), yaxis=axis("hidden")),
        title="Named against hidden",
        caption="Cases with one thing hidden, or none; in brackets the verdict where nothing was named.",
        height=AROUND + ROW * max(len(hidden), 1),
    )
