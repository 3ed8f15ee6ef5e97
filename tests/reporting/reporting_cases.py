"""A realistic result without a diagnosis: two joints, Coulomb friction and an offset hidden in one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.results.result import (
    Alternative,
    ChannelFit,
    ChannelSeries,
    Dependence,
    Diagnosis,
    Errors,
    Estimate,
    Experiment,
    Finding,
    Fit,
    Mismatch,
    ParameterChange,
    Result,
    Rung,
    Verdict,
)
from robot_model import Robot, load_robot

__all__ = ["COULOMB", "OFFSET", "empty_result", "hidden_friction", "two_link_arm"]

RATE = 500.0
COULOMB = 4.4
OFFSET = 0.8
NOISE = {"joint1": 0.15, "joint2": 0.08}
Array = NDArray[np.float64]


def two_link_arm() -> Robot:
    return load_robot("two_link_arm")


def _motion(time: Array, order: int) -> tuple[Array, Array]:
    parts = ((0.6, 0.17 + 0.04 * order), (0.35, 0.43), (0.12, 1.07 - 0.1 * order))
    angle = sum(a * np.sin(2 * np.pi * f * time + k) for k, (a, f) in enumerate(parts))
    rate = sum(a * 2 * np.pi * f * np.cos(2 * np.pi * f * time + k) for k, (a, f) in enumerate(parts))
    return np.asarray(angle), np.asarray(rate)


def _series(joint: str, order: int, *, recording: str, role: Any, seconds: float, seed: int) -> ChannelSeries:
    rng = np.random.default_rng(seed + order)
    time = np.arange(round(seconds * RATE)) / RATE
    position, velocity = _motion(time + (7.0 if role == "validation" else 0.0), order)
    nominal = 20.0 * np.cos(position) + 2.0 * velocity
    missing = COULOMB * np.tanh(velocity / 1e-3) + OFFSET if joint == "joint2" else np.zeros_like(time)
    measured = nominal + missing + NOISE[joint] * rng.standard_normal(time.size)
    held = np.full(time.size, True) if role == "validation" else (time % 10.0) >= 7.0
    return ChannelSeries(
        recording=recording,
        role=role,
        channel=f"{joint}.torque",
        unit="N m",
        location=joint,
        time=time,
        measured=measured,
        nominal=nominal,
        augmented=nominal + 0.99 * missing,
        held_out=held,
        noise_floor=NOISE[joint],
        position=position,
        velocity=velocity,
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _fit(series: tuple[ChannelSeries, ...], channel: str) -> ChannelFit:
    chosen = [s for s in series if s.channel == channel]

    def errors(model: str) -> Errors:
        table = [(s.measured - getattr(s, model), s.held_out) for s in chosen]
        return Errors(
            train_rms=_rms(np.concatenate([r[~h] for r, h in table])),
            validation_rms=_rms(np.concatenate([r[h] for r, h in table])),
        )

    return ChannelFit("N m", errors("nominal"), errors("augmented"), chosen[0].noise_floor)


def hidden_friction(*, seconds: float = 20.0, name: str | None = None) -> Result:
    """Coulomb friction of 4.4 N m and an offset of 0.8 N m at joint2, found; `name` replaces every name."""
    recordings = (("run_a.csv", "train", 0), ("run_b.csv", "validation", 100))
    series = tuple(
        _series(joint, order, recording=source, role=role, seconds=seconds, seed=seed)
        for source, role, seed in recordings
        for order, joint in enumerate(NOISE)
    )
    fit = Fit({c: _fit(series, c) for c in ("joint1.torque", "joint2.torque")}, 0.978)
    result = Result(_diagnosis(fit, seconds), series, _ladder(), 'name = "two_link_arm"\n', seconds=4.2)
    return _renamed(result, name) if name else result


def _diagnosis(fit: Fit, seconds: float) -> Diagnosis:
    return Diagnosis(
        robot="two_link_arm",
        recordings=("run_a.csv",),
        validation=("run_b.csv",),
        verdict="explained",
        summary=(
            "Joint 2 needs 4.4 N m more torque than the nominal robot says, against the direction of its "
            "motion, and 0.8 N m more at all times. Coulomb friction and a torque offset at joint2 explain "
            "it down to the noise, also on run_b.csv, which was not fitted."
        ),
        mismatch=(
            Mismatch(
                location="joint2",
                channel="joint2.torque",
                share=0.97,
                p_value=1e-40,
                windows=((0.15 * seconds, 0.2 * seconds), (0.6 * seconds, 0.64 * seconds)),
                depends_on=(Dependence("joint2.velocity", (-0.02, 0.02), 0.07),),
                frequency_hz=(0.43, 1.29),
                words="Changes sign with the velocity of joint2 and keeps its size.",
            ),
        ),
        findings=_findings(),
        fit=fit,
        experiments=(
            Experiment(
                ("stribeck_friction", "coulomb_friction"),
                "Move joint2 to and fro at 0.005 to 0.05 rad/s for 30 s.",
                "Below 0.05 rad/s the two laws differ by up to 0.6 N m, seven times the noise.",
                "experiment_1.csv",
            ),
        ),
        could_not_tell=(
            "Temperature dependence: no temperature channel.",
            "Backlash at joint1: no secondary encoder.",
        ),
        nominal_parameters=(
            ParameterChange("link2.mass", "kg", 4.0, 4.02, (3.97, 4.07)),
            ParameterChange("joint2.viscous_friction.coefficient", "N m s/rad", 1.2, 1.31, (1.27, 1.35)),
        ),
        notes=("Torques and models were filtered alike, zero phase, 25 Hz.",),
    )


def _findings() -> tuple[Finding, ...]:
    return (
        Finding(
            "coulomb_friction",
            "joint2",
            0.97,
            {"torque": Estimate(COULOMB, (4.1, 4.7), "N m")},
            alternatives=(
                Alternative(
                    "stribeck_friction",
                    "joint2",
                    0.02,
                    "its extra parameters do not lower the held-out error",
                ),
                Alternative("lugre_friction", "joint2", 0.01, "no presliding is seen at this resolution"),
            ),
            validation_improvement=0.93,
        ),
        Finding("torque_offset", "joint2", 0.9995, {"torque": Estimate(OFFSET, (0.79, 0.81), "N m")}),
    )


def _ladder() -> tuple[Rung, ...]:
    return (
        Rung("viscous_friction", "joint2", (), 24.0, 25.1, 3.1, False, "coulomb_friction does more"),
        Rung("coulomb_friction", "joint2", (), 10.1, 10.2, 5120.0, True, "lowers the held-out error most"),
        Rung(
            "torque_offset",
            "joint2",
            ("coulomb_friction",),
            1.02,
            1.03,
            2210.0,
            True,
            "lowers the held-out error",
        ),
        Rung(
            "torque_ripple",
            "joint1",
            ("coulomb_friction", "torque_offset"),
            1.01,
            1.05,
            -3.0,
            False,
            "no gain",
        ),
    )


def _renamed(result: Result, name: str) -> Result:
    """The same result with every name that a file can bring in replaced by `name`."""
    series = tuple(replace(s, channel=name, location=name, recording=name, unit=name) for s in result.series)
    diagnosis = result.diagnosis
    mismatch = tuple(
        replace(
            m,
            **{"channel": name, "location": name, "words": name},
            depends_on=(Dependence(name, (0.0, 1.0), 0.5),),
        )
        for m in diagnosis.mismatch
    )
    findings = tuple(
        replace(f, effect=name, location=name, parameters={name: Estimate(1.0, (0.5, 1.5), name)})
        for f in diagnosis.findings
    )
    changed = replace(
        diagnosis,
        robot=name,
        recordings=(name,),
        validation=(name,),
        summary=name,
        mismatch=mismatch,
        findings=findings,
        could_not_tell=(name,),
        notes=(name,),
        fit=Fit({name: next(iter(diagnosis.fit.channels.values()))}, 0.5),
    )
    ladder = tuple(replace(r, effect=name, location=name, why=name) for r in result.ladder)
    return replace(result, diagnosis=changed, series=series, ladder=ladder, augmented_robot_toml=name)


def empty_result(verdict: Verdict, *, series: bool) -> Result:
    """A result without findings, with or without anything to draw."""
    full = hidden_friction()
    mismatch = full.diagnosis.mismatch if verdict == "unexplained" else ()
    drawn = (
        tuple(replace(s, augmented=s.nominal) for s in full.series if s.location == "joint1")
        if series
        else ()
    )
    fit = Fit({"joint1.torque": full.diagnosis.fit.channels["joint1.torque"]} if series else {}, 0.0)
    diagnosis = replace(
        full.diagnosis,
        verdict=verdict,
        summary=f"A summary that says {verdict}.",
        mismatch=mismatch,
        findings=(),
        fit=fit,
        experiments=(),
        could_not_tell=(),
        nominal_parameters=(),
        notes=(),
    )
    return Result(diagnosis, drawn, (), "")
