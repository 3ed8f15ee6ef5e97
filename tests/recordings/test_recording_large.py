"""Long recordings: every path works in pieces or in one pass, and nothing grows faster than the file."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
import pytest

from missing_physics.recordings import check, estimate_noise, excitation, load_recording

PROGRAM = """
import re, sys
from missing_physics.recordings import check, estimate_noise, load_recording, outlook
recording = load_recording(sys.argv[1])
check(recording); estimate_noise(recording); outlook(recording)
print(len(recording), re.search(r"VmHWM:\\s*(\\d+) kB", open("/proc/self/status").read())[1])
"""


def long_table(count: int) -> pa.Table:
    t = np.arange(count) / 1000.0
    noise = 1e-3 * np.random.default_rng(0).standard_normal(count)
    return pa.table({"time": t, "joint1.position": np.sin(t) + noise, "joint1.torque": np.cos(t) + noise})


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_half_a_million_rows(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    table = long_table(500_000)
    (pq.write_table if suffix == ".parquet" else pa_csv.write_csv)(table, path)
    recording = load_recording(path)
    np.testing.assert_array_equal(recording["joint1.torque"], table["joint1.torque"].to_numpy())
    # 200,000 samples in blocks: the median absolute deviation scatters by well under a percent.
    assert estimate_noise(recording)["joint1.position"] == pytest.approx(1e-3, rel=0.03)
    assert not [f for f in check(recording) if f.severity != "note"]
    # 500 s of a sine with 2 pi s per period turn 159 times.
    assert excitation(recording)[0].reversals == int(500 / np.pi - 0.5) + 1


@pytest.mark.proof
@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="the peak of memory is read from /proc")
@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_ten_million_rows(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    (pq.write_table if suffix == ".parquet" else pa_csv.write_csv)(long_table(10_000_000), path)
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(path)], capture_output=True, text=True, check=True
    )
    count, peak = map(int, done.stdout.split())
    assert count == 10_000_000
    # Three columns of 80 MB each; the table, the copies in the recording and some passes over single columns.
    assert peak < 2_500_000, f"{peak} kB at peak"
