"""`missing-physics demo`: one sealed case, from nothing to the revealed truth.

Exudyn moves a space robot with physics that its robot file does not contain. This truth is encrypted and its
fingerprint printed; the diagnosis runs in a separate process, isolated as far as the system allows; then the
truth is revealed. The challenge is imported only when the demo runs, since `diagnose` also runs where it is
not available.
"""

from __future__ import annotations

import json
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import Annotated, Any

import typer
from rich.text import Text

from missing_physics.reporting.terminal.console import PlainConsole, styled
from missing_physics.reporting.terminal.tables import number_table
from missing_physics.wording.numbers import interval_text
from robot_model import EffectUse, replacing_set, require_folder, write_atomically

__all__ = ["register", "reveal"]

#: A parameter counts as not determined if its interval is wider than this many times the estimate.
UNDETERMINED = 10.0
#: Headings of the final table.
HEADINGS = ("parameter", "truth", "found", "95 % interval", "agrees")
#: Files that a demo writes: those of the case, and the rest.
CASE = tuple(f"case/{name}" for name in ("robot.toml", "recording.csv", "validation.csv"))
MADE = (
    *("sealed.bin", "opened.json", "diagnosis.json", "robot.augmented.toml"),
    *("comparison.rrd", "report.html"),
)
#: Bits of a random seed.
SEED_BITS = 31


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(demo)


def demo(
    out: Annotated[Path, typer.Option("--out", help="folder for the case and the results")] = Path(
        "reports/demo"
    ),
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="seed of the case; by default a random one, which nobody knows beforehand"),
    ] = None,
) -> None:
    """Hide something in a simulated space robot, seal what it is, diagnose the recordings, open the seal.

    Writes the robot file and two recordings into OUT/case, the sealed truth into OUT/sealed.bin, and the
    report with everything else into OUT.
    """
    from missing_physics.challenge.processes.stage import begin

    begin()
    _Demo(out, secrets.randbits(SEED_BITS) if seed is None else seed, PlainConsole()).run()


class _Demo:
    def __init__(self, out: Path, seed: int, console: PlainConsole) -> None:
        self.out, self.seed, self.console = out, seed, console
        self.began = monotonic()
        self.made: dict[str, bytes] = {}  # written at once, replacing an earlier demo

    def run(self) -> None:
        require_folder(self.out)
        files, sealed, key, promised = self._conceal()
        diagnosis = self._diagnose(files)
        self._open(sealed, key, promised, diagnosis)
        self._write()
        report = self.out / "report.html"
        self.console.print(f"\nReport:     {report}", soft_wrap=True)
        self.console.print(f"Comparison: missing-physics view {self.out}", soft_wrap=True)
        self._say(f"The same case again: missing-physics demo --seed {self.seed}")

    def _say(self, *parts: str | tuple[str, str]) -> None:
        took = f"{monotonic() - self.began:4.0f} s"
        self.console.print(styled((took, "dim"), "  ", *parts), soft_wrap=True)

    def _write(self) -> None:
        with replacing_set(self.out, (*CASE, *MADE)) as fresh:
            for name, content in self.made.items():
                write_atomically(fresh / name, content)

    def _conceal(self) -> tuple[Mapping[str, bytes], bytes, bytes, str]:
        from missing_physics.challenge.cases.truth import Truth, canonical
        from missing_physics.challenge.one_case import ROBOT, case_files, draw_case
        from missing_physics.challenge.seals.seal import digest, new_key, seal

        self._say(f"Exudyn simulates {ROBOT} with an effect that its robot file does not contain ...")
        design = draw_case(self.seed)
        files = case_files(design)
        truth = canonical(Truth(nonce=secrets.token_hex(16), designs=(design,)))
        key = new_key()
        sealed = seal(truth, key)
        self.made |= {f"case/{name}": content for name, content in files.items()}
        self.made["sealed.bin"] = sealed
        self._say("Sealed the truth with a key that no file holds:")
        self.console.print(f"          SHA-256 of the truth   {digest(truth)}", soft_wrap=True)
        self.console.print(f"          SHA-256 of sealed.bin  {digest(sealed)}", soft_wrap=True)
        return files, sealed, key, digest(truth)

    def _diagnose(self, files: Mapping[str, bytes]) -> dict[str, Any]:
        """Answer of the public command in a separate process; if it fails, the demo exits with its code."""
        from missing_physics.challenge.processes import stage
        from missing_physics.challenge.processes.blind import isolation
        from missing_physics.challenge.seals.seal import digest

        self._say(f"Diagnosing robot.toml and two recordings ({isolation()}) ...")
        outcome = stage.carry_out("diagnose", files, hidden=(str(self.out.resolve()),), keep=stage.KEPT)
        if outcome.status != "done":
            typer.echo(f"missing-physics: the diagnosis failed: {outcome.message}", err=True)
            raise typer.Exit({"refused": stage.UNUSABLE, "stopped": stage.STOPPED}.get(outcome.status, 1))
        self.made |= outcome.files
        answer: dict[str, Any] = json.loads(outcome.files["diagnosis.json"])
        self._say("The diagnosis says: ", (answer["verdict"].upper(), "bold"))
        for line in answer_lines(answer):
            self.console.print(f"          {line}", soft_wrap=True)
        fingerprint = digest(outcome.files["diagnosis.json"])
        self.console.print(f"          SHA-256 of the answer  {fingerprint}", soft_wrap=True)
        return answer

    def _open(self, sealed: bytes, key: bytes, promised: str, answer: Mapping[str, Any]) -> None:
        from missing_physics.challenge.cases.truth import Truth
        from missing_physics.challenge.seals.seal import digest, unseal

        opened = unseal(sealed, key, what=str(self.out / "sealed.bin"))
        assert digest(opened) == promised
        truth = Truth.model_validate_json(opened)
        content = {"key": key.hex(), "seed": self.seed, "truth": json.loads(opened)}
        self.made["opened.json"] = (json.dumps(content, indent=1) + "\n").encode()
        self._say("Opened the seal: the truth has the SHA-256 given above.")
        reveal(truth.designs[0].hidden[0], answer["findings"], self.console)


def answer_lines(answer: Mapping[str, Any]) -> list[str]:
    """A line for each named effect with its probability; or the places of unnamed forces."""
    lines = [
        f"{f['effect']} at {f['location']}, probability {f['probability']:.3g}"
        + (f" (or {', '.join(f['ambiguous_with'])})" if f["ambiguous_with"] else "")
        for f in answer["findings"]
    ]
    return lines or [f"differs at {m['location']}, not named" for m in answer["mismatch"]]


@dataclass(frozen=True)
class _Answer:
    """The finding that matches the truth best, and the others."""

    best: Mapping[str, Any]
    others: Sequence[Mapping[str, Any]]


def _ranked(truth: EffectUse, findings: Sequence[Mapping[str, Any]]) -> _Answer:
    """Rank: the right effect at the right place, then one ambiguous with it, then others."""
    label = f"{truth.effect}@{truth.at}"
    order = sorted(
        findings,
        key=lambda f: (
            f"{f['effect']}@{f['location']}" != label,
            label not in _rivals(f),
            f["effect"] != truth.effect,
            f["location"] != truth.at,
        ),
    )
    nothing: dict[str, Any] = {"effect": "", "location": "", "parameters": {}}
    return _Answer(order[0] if order else nothing, order[1:])


def _rivals(finding: Mapping[str, Any]) -> set[str]:
    return {r if "@" in r else f"{r}@{finding['location']}" for r in finding.get("ambiguous_with", ())}


def reveal(truth: EffectUse, findings: Sequence[Mapping[str, Any]], console: PlainConsole) -> None:
    """Print the truth next to the findings.

    Args:
        truth: the hidden effects.
        findings: of diagnosis.json.
        console: the output.
    """
    answer = _ranked(truth, findings)
    console.print("\nThe truth, and what was found", style="bold")
    console.print(styled("hidden: ", (f"{truth.effect} at {truth.at}", "bold")))
    console.print(Text("found:  ").append_text(_named(answer.best, truth)))
    if f"{truth.effect}@{truth.at}" in _rivals(answer.best):
        console.print("        and the truth is among those that these data cannot distinguish")
    same = answer.best["effect"] == truth.effect
    rows: list[tuple[str | Text, ...]] = []
    estimates: Mapping[str, Any] = answer.best["parameters"] if same else {}
    for name in [*truth.parameters, *(name for name in estimates if name not in truth.parameters)]:
        found = estimates.get(name, {})
        label = f"{name} [{found['unit']}]" if found.get("unit", "-") != "-" else name
        cells = _estimate(found, truth.parameters.get(name))
        rows.append((label, *cells))
    console.print()
    console.print(number_table(rows, console, headings=HEADINGS))
    for other in answer.others:
        also = f"also found: {other['effect']} at {other['location']} "
        console.print(styled(also, ("(not hidden by the demo)", "red")))


def _named(finding: Mapping[str, Any], truth: EffectUse) -> Text:
    """Effect and place of a finding, and whether each is right."""
    if not finding["location"]:
        return styled("nothing ", ("(missed)", "red"))
    right = _mark(finding["effect"] == truth.effect), _mark(finding["location"] == truth.at)
    what = f"{finding['effect']} at {finding['location']}"
    return Text.assemble(what, " (effect: ", right[0], ", place: ", right[1], ")")


def _estimate(found: Mapping[str, Any], truth: float | None) -> tuple[str, str, str, Text]:
    """Cells of one parameter: truth, value, interval, and whether the interval contains the truth."""
    shown = "-" if truth is None else f"{truth:.4g}"
    value, (low, high) = found.get("value"), found.get("ci95") or (None, None)
    if value is None:
        return shown, "-", "", Text()
    if low is None or high is None or high - low > UNDETERMINED * abs(value):
        return shown, f"{value:.4g}", "not determined", Text()
    agrees = Text() if truth is None else _mark(low <= truth <= high)
    text, lower, upper = interval_text(value, (low, high))
    return shown, text, "not determined" if lower == upper else f"{lower} to {upper}", agrees


def _mark(right: bool) -> Text:
    return Text("yes", style="green") if right else Text("no", style="red")
