"""Tables in memory become the same recording as in a file."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from missing_physics.recordings import mapping_from_toml, recording_from_table
from robot_model import InputError

T = np.arange(100) / 100.0
COLUMNS = {"time": T, "joint1.position": np.sin(T), "joint1.torque": np.where(T < 0.5, np.nan, T)}
DATES = np.datetime64("2026-01-01T00:00:00", "ns") + (T * 1e9).astype("timedelta64[ns]")


def dataset() -> xr.Dataset:
    return xr.Dataset(
        {name: ("time", values) for name, values in COLUMNS.items() if name != "time"}, coords={"time": T}
    )


TABLES: dict[str, Callable[[], Any]] = {
    "pandas": lambda: pd.DataFrame(COLUMNS),
    "pandas of arrow": lambda: pd.DataFrame(COLUMNS).convert_dtypes(dtype_backend="pyarrow"),
    "pandas with an index": lambda: pd.DataFrame(COLUMNS).set_index("time"),
    "pandas with an index without a name": lambda: pd.DataFrame(COLUMNS).set_index("time").rename_axis(None),
    "pandas of dates": lambda: pd.DataFrame(COLUMNS).set_index(pd.DatetimeIndex(DATES)).drop(columns="time"),
    "pandas of dates in a zone": lambda: pd.DataFrame(COLUMNS).assign(
        time=pd.DatetimeIndex(DATES).tz_localize("Europe/Berlin")
    ),
    "pandas of spans": lambda: pd.DataFrame(COLUMNS).assign(time=pd.to_timedelta(T, unit="s")),
    "pandas cut": lambda: pd.DataFrame({n: np.append(v, 9.0) for n, v in COLUMNS.items()})[:100],
    "polars": lambda: pl.DataFrame(COLUMNS),
    "polars, lazy": lambda: pl.LazyFrame(COLUMNS),
    "polars of dates": lambda: pl.DataFrame(COLUMNS | {"time": DATES}),
    "PyArrow": lambda: pa.table(COLUMNS),
    "xarray": dataset,
    "arrays": lambda: COLUMNS,
    "lists": lambda: {name: values.tolist() for name, values in COLUMNS.items()},
    "nested": lambda: {"time": T, "joint1": {"position": np.sin(T), "torque": COLUMNS["joint1.torque"]}},
    "spans": lambda: COLUMNS | {"time": (T * 1e9).astype("timedelta64[ns]")},
    "structured": lambda: np.rec.fromarrays(list(COLUMNS.values()), names=list(COLUMNS)).view(np.ndarray),
}


@pytest.mark.parametrize("kind", TABLES)
def test_every_table_gives_the_same_recording(kind: str) -> None:
    recording = recording_from_table(TABLES[kind](), check=False, name="run 1")
    assert set(recording) == {"joint1.position", "joint1.torque"}
    assert recording.source == "run 1"
    np.testing.assert_allclose(recording.time, T, rtol=0, atol=1e-9)
    for name in recording:
        np.testing.assert_array_equal(recording[name], COLUMNS[name])


def test_recording_does_not_change_with_its_table() -> None:
    data = {name: values.copy() for name, values in COLUMNS.items()}
    recording = recording_from_table(data, check=False)
    data["joint1.position"][:] = 7.0
    np.testing.assert_array_equal(recording["joint1.position"], np.sin(T))


def test_units_of_native_names() -> None:
    data = pd.DataFrame({"time": 1000 * T, "joint1.position": np.rad2deg(np.sin(T)), "joint1.torque": T})
    recording = recording_from_table(data, units={"time": "ms", "joint1.position": "deg"}, check=False)
    np.testing.assert_allclose(recording.time, T)
    np.testing.assert_allclose(recording["joint1.position"], np.sin(T))
    np.testing.assert_array_equal(recording["joint1.torque"], T)


@pytest.mark.parametrize(
    "data",
    [
        {"t": T, "q": np.stack([T, np.sin(T)], axis=1)},
        pl.DataFrame({"t": T, "q": np.stack([T, np.sin(T)], axis=1)}),
        pl.DataFrame({"t": T, "q": np.stack([T, np.sin(T)], axis=1).tolist()}),
        xr.Dataset({"q": (("t", "joint"), np.stack([T, np.sin(T)], axis=1))}, coords={"t": T}),
        xr.DataArray(np.stack([T, np.sin(T)], axis=1), dims=("t", "joint"), coords={"t": T}, name="q"),
    ],
    ids=["arrays", "polars arrays", "polars lists", "Dataset", "DataArray"],
)
def test_a_mapping_picks_columns_of_arrays(data: Any) -> None:
    text = 'time = { source = "t" }\n[channels."joint1.position"]\nsource = "q"\ncolumn = 1\nscale = 2.0'
    recording = recording_from_table(data, mapping=mapping_from_toml(text), check=False)
    np.testing.assert_array_equal(recording["joint1.position"], 2 * np.sin(T))


@pytest.mark.parametrize(
    ("data", "options", "message"),
    [
        (7, {}, "run is of type int, which is no table; give a data frame"),
        ({}, {}, "run has no columns"),
        (pd.DataFrame({"q": T}), {}, "run has no variable 'time'"),
        ({"time": T, "joint1.position": T[:60]}, {}, "60 samples for joint1.position but 100 for time"),
        ({"time": T, "joint1.position": [[1], [2, 3]]}, {}, "in 'joint1.position' that is no array"),
        ({"time": T, "joint1.position": T + 1j}, {}, "holds complex128 in 'joint1.position'"),
        ({"time": T, "joint1.position": ["x"] * 100}, {}, "has 'x' where a number is expected"),
        (pd.DataFrame({"time": T, "joint1.position": [object()] * 100}), {}, "no numbers, instants or text"),
        (COLUMNS, {"units": {"joint1.position": "A"}}, "'A' is no unit of joint1.position"),
        (COLUMNS, {"units": {"joint1.positon": "deg"}}, "no column 'joint1.positon' for the unit 'deg'; did"),
        (COLUMNS | {"q": T}, {"units": {"q": "deg"}}, "'q' is no native channel"),
    ],
    ids=lambda value: str(value)[:20].split("\n")[0] if isinstance(value, str) else "",
)
def test_invalid_tables_give_one_sentence(data: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as error:
        recording_from_table(data, name="run", **options)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_mapping_for_files_is_rejected_for_tables() -> None:
    mapping = mapping_from_toml('join = ["b.csv"]\ntime = { rate = 100 }')
    with pytest.raises(InputError, match="run is no file; take join"):
        recording_from_table(COLUMNS, mapping=mapping, name="run")
    with pytest.raises(InputError, match="units go into the mapping"):
        recording_from_table(COLUMNS, mapping=mapping, units={"time": "ms"})


values = st.one_of(
    st.none(),
    st.integers(),
    st.floats(),
    st.text(max_size=3),
    st.lists(st.floats(), max_size=60),
    st.binary(),
)


@given(st.recursive(values, lambda inner: st.dictionaries(st.sampled_from([*COLUMNS, "", "a"]), inner)))
def test_anything_gives_a_recording_or_one_sentence(data: Any) -> None:
    try:
        recording_from_table(data)
    except InputError as error:
        sentence = str(error)
    else:
        return
    assert "\n" not in sentence
    assert sentence.endswith((".", "?"))


def test_unused_data_frame_libraries_are_not_loaded() -> None:
    frames = "{'narwhals', 'pandas', 'polars', 'xarray'}"
    code = f"import sys, missing_physics.recordings; sys.exit(bool({frames} & sys.modules.keys()))"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
