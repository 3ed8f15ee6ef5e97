"""Where the nominal robot's runs in closed loop differ from recordings whose torques show nothing.

Torques along an estimated motion are no better known than twice a derivative of encoders' noise allows. What
stays below that may still move the joints under their controller by several times what their sensors scatter:
then something is there, though no law along the motion says what.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.fft import dct

from missing_physics.diagnosis.location.residual import outstanding_windows
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.runs.rivals import HEARD
from missing_physics.results.result import Mismatch

__all__ = ["colour_chance", "differing_in_runs"]

Array = NDArray[np.float64]

#: Energy in units of what noise and beams make, from which one recording is enough where others differ by no
#: more than beams may make: a stop may be touched in one alone.
CLEAR_ALONE = 25.0
#: Stretches of time that are told of a channel.
MOST_WINDOWS = 4


def differing_in_runs(replay: Replay | None) -> tuple[Mismatch, ...]:
    """The channels that differ in every recording, largest share first; nothing unless some clearly do.

    Beyond the noise that is stated and what beams may do otherwise than described (`Replay.doubt`), and not
    white: a sensor that scatters more than is stated is no mismatch.

    Args:
        replay: runs along all recordings; None where that is not possible.
    """
    if replay is None:
        return ()
    beyond = np.full((len(replay.asked), len(replay.channels)), np.nan)
    chances, raw, far = np.zeros_like(beyond), np.zeros_like(beyond), np.zeros(beyond.shape, dtype=bool)
    for which in range(len(replay.asked)):
        found = replay.errors(replay.robot, which)
        if found is None:
            return ()
        errors = [found[name] for name in replay.channels]
        doubt = replay.doubt(which)
        raw[which] = [np.mean(e**2) for e in errors]
        beyond[which] = raw[which] - doubt
        far[which] = beyond[which] > CLEAR_ALONE * (1.0 + doubt)
        chances[which] = [colour_chance(e / np.sqrt(1.0 + d)) for e, d in zip(errors, doubt)]
    every = np.all(beyond > HEARD, axis=0)
    heard = every | (np.all(raw > HEARD, axis=0) & far.any(axis=0))
    shares = heard * np.maximum(beyond - 1.0, 0.0).mean(axis=0)
    told = []
    for k in np.argsort(-shares):
        if not heard[k]:
            continue
        name = replay.channels[k]
        there = np.flatnonzero(far[:, k] | every[k])
        chance, times = float(chances[there, k].max()), float(np.sqrt(beyond[there, k].min()))
        shown = replay.asked[int(there[0])].recording
        error = (replay.errors(replay.robot, int(there[0])) or {})[name]
        where = "every recording" if every[k] else shown.source or "one recording"
        windows = outstanding_windows(shown.time, error)[:MOST_WINDOWS]
        words = (
            f"run in closed loop along the recorded references, the robot as described is off in {name} by "
            f"{times:.2g} times its sensor's noise (rms), in {where}, while torques along the estimated "
            "motion show nothing beyond noise."
        )
        share = float(shares[k] / shares.sum())
        told.append(Mismatch(name.split(".")[0], name, share, chance, windows, words=words))
    return tuple(told)


def colour_chance(error: Array) -> float:
    """That white noise of any size holds so much of its energy in its lower half of frequencies.

    Args:
        error: shape (N,).
    """
    energy = dct(error, norm="ortho") ** 2
    half = energy.size // 2
    ratio = float(energy[:half].mean() / max(float(energy[half:].mean()), 1e-300))
    return float(stats.f.sf(ratio, half, energy.size - half))
