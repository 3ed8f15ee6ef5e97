"""MAT versions 4 to 7: same numbers as SciPy, and one sentence for damaged files."""

from __future__ import annotations

import struct
import zlib
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.sparse
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_np
from numpy.typing import NDArray

from missing_physics.recordings import load_recording, mapping_from_toml, read_raw
from robot_model import InputError

TIME = np.arange(60) / 100.0
#: Types of MATLAB's numbers.
KINDS = ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8")

names = st.from_regex(r"[a-z][a-z0-9_]{0,8}", fullmatch=True)
shapes = st_np.array_shapes(min_dims=2, max_dims=3, min_side=0, max_side=4)
arrays = st.sampled_from(KINDS).flatmap(lambda kind: st_np.arrays(np.dtype(kind), shapes))
other = st.one_of(
    st.text(st.characters(codec="ascii", categories=["L"]), min_size=1, max_size=5),
    st_np.arrays(np.complex128, (2, 3)),
    st.just(scipy.sparse.eye(3).tocsc()),
    st.lists(arrays, min_size=2, max_size=3).map(lambda items: np.array([*items, None], dtype=object)[:-1]),
)
structures = st.recursive(
    st.one_of(arrays, other),
    lambda inner: st.dictionaries(names, inner, min_size=1, max_size=3),
    max_leaves=6,
)


def flattened(name: str, value: Any) -> dict[str, NDArray[Any]]:
    """What SciPy reads, as one variable per numeric field."""
    if isinstance(value, np.ndarray) and value.dtype.names is not None:
        cells = {field: value[field].ravel() for field in value.dtype.names}
        if value.size == 1:
            inner = [flattened(f"{name}.{field}", own[0]) for field, own in cells.items()]
            return {key: numbers for part in inner for key, numbers in part.items()}
        return {
            f"{name}.{field}": np.array([cell.item() for cell in own])
            for field, own in cells.items()
            if own.size and all(cell.size == 1 and cell.dtype.kind in "biuf" for cell in own)
        }
    if isinstance(value, np.ndarray) and value.dtype.kind == "O":  # cells
        parts = [flattened(f"{name}{{{k + 1}}}", cell) for k, cell in enumerate(value.ravel(order="F"))]
        return {key: numbers for part in parts for key, numbers in part.items()}
    return {name: value} if isinstance(value, np.ndarray) and value.dtype.kind in "biuf" else {}


def by_scipy(path: Path) -> dict[str, NDArray[Any]]:
    found: dict[str, NDArray[Any]] = {}
    for name, value in scipy.io.loadmat(path).items():
        if not name.startswith("__"):
            found |= flattened(name, value)
    return found


def assert_read_alike(path: Path) -> None:
    mine, theirs = read_raw(path).variables, by_scipy(path)
    # An empty field of a structure is no variable.
    assert mine.keys() == {name for name, values in theirs.items() if values.size or name in mine}
    for name, values in mine.items():
        np.testing.assert_array_equal(values, theirs[name], strict=True)


@given(content=st.dictionaries(names, structures, min_size=1, max_size=3), squeeze=st.booleans())
@settings(max_examples=25)
def test_version_5_is_read_as_scipy_reads_it(tmp_path: Path, content: dict[str, Any], squeeze: bool) -> None:
    scipy.io.savemat(tmp_path / "a.mat", content, do_compression=squeeze)
    assert_read_alike(tmp_path / "a.mat")


matrices = st.sampled_from(["f8", "f4", "i4", "i2", "u2", "u1", "c16"]).flatmap(
    lambda kind: st_np.arrays(np.dtype(kind), st.tuples(st.integers(0, 4), st.integers(0, 4)))
)


@given(content=st.dictionaries(names, st.one_of(matrices, st.just("text")), min_size=1, max_size=4))
@settings(max_examples=25)
def test_version_4_is_read_as_scipy_reads_it(tmp_path: Path, content: dict[str, Any]) -> None:
    scipy.io.savemat(tmp_path / "a.mat", content, format="4")
    assert_read_alike(tmp_path / "a.mat")


def test_arrays_of_structures_become_columns_in_the_order_of_their_rows(tmp_path: Path) -> None:
    samples = np.empty((2, 3), dtype=[("t", object), ("mixed", object)])
    samples["t"].flat = range(6)
    samples["mixed"].flat = [1.0, "text", 2.0, 3.0, 4.0, 5.0]
    scipy.io.savemat(tmp_path / "a.mat", {"s": samples})
    assert_read_alike(tmp_path / "a.mat")
    np.testing.assert_array_equal(read_raw(tmp_path / "a.mat")["s.t"], range(6))


def element(order: str, kind: int, content: bytes) -> bytes:
    return struct.pack(f"{order}II", kind, len(content)) + content + bytes(-len(content) % 8)


def matrix(order: str, name: bytes, shape: tuple[int, ...], *, kind: int = 6, data: bytes) -> bytes:
    """A matrix of version 5, as table 1-2 of its description has it; `data` is what follows its name."""
    dimensions = struct.pack(f"{order}{len(shape)}i", *shape)
    parts = (
        element(order, 6, struct.pack(f"{order}II", kind, 0)),
        element(order, 5, dimensions),
        element(order, 1, name),
        data,
    )
    return element(order, 14, b"".join(parts))


def packed(content: bytes) -> bytes:
    return struct.pack("<II", 15, len(content)) + content


def version_5(order: str, *elements: bytes) -> bytes:
    mark = b"IM" if order == "<" else b"MI"
    return b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack(f"{order}H", 0x0100) + mark + b"".join(elements)


@pytest.mark.parametrize("order", "<>")
def test_both_byte_orders_of_version_5(tmp_path: Path, order: str) -> None:
    numbers = element(order, 9, TIME.astype(f"{order}f8").tobytes())
    path = tmp_path / "a.mat"
    path.write_bytes(version_5(order, matrix(order, b"time", (1, 60), data=numbers)))
    values = read_raw(path)["time"]
    np.testing.assert_array_equal(values, TIME[None])
    assert values.dtype.isnative


@pytest.mark.parametrize("order", "<>")
def test_both_byte_orders_of_version_4(tmp_path: Path, order: str) -> None:
    header = struct.pack(f"{order}5i", 1000 * (order == ">"), 60, 1, 0, 5)
    (tmp_path / "a.mat").write_bytes(header + b"time\0" + TIME.astype(f"{order}f8").tobytes())
    np.testing.assert_array_equal(read_raw(tmp_path / "a.mat")["time"], TIME[:, None])


def test_zeroed_tag_gives_one_sentence(tmp_path: Path) -> None:
    """SciPy 1.17 ends the process with SIGSEGV here."""
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"time": TIME})
    content = path.read_bytes()
    tag = struct.pack("<II", 9, TIME.nbytes)
    assert content.count(tag) == 1
    path.write_bytes(content.replace(tag, bytes(8)))
    with pytest.raises(InputError, match=r"a\.mat cannot be read as MAT; it may be truncated or damaged"):
        load_recording(path)


def nested(depth: int) -> bytes:
    inner = matrix("<", b"", (1, 1), data=element("<", 9, bytes(8)))
    for level in range(depth):
        names = element("<", 5, struct.pack("<i", 8)) + element("<", 1, b"a\0\0\0\0\0\0\0")
        inner = matrix("<", b"s" if level == depth - 1 else b"", (1, 1), kind=2, data=names + inner)
    return inner


NUMBERS = element("<", 9, TIME.tobytes())
WHOLE = matrix("<", b"time", (1, 60), data=NUMBERS)
FIELDS = element("<", 5, struct.pack("<i", 8)) + element("<", 1, b"a\0\0\0\0\0\0\0")
DAMAGED = {
    "no data": matrix("<", b"time", (1, 60), data=b""),
    "more declared than there is": matrix("<", b"time", (1, 61), data=NUMBERS),
    "fewer declared than there are": matrix("<", b"time", (1, 59), data=NUMBERS),
    "negative dimension": matrix("<", b"time", (-1, -60), data=NUMBERS),
    "one dimension": matrix("<", b"time", (60,), data=NUMBERS),
    "very many dimensions": matrix("<", b"time", (1,) * 40, data=NUMBERS),
    "dimensions that overflow": matrix("<", b"time", (2**31 - 1,) * 4, data=NUMBERS),
    "unknown type of numbers": matrix("<", b"time", (1, 60), data=element("<", 8, TIME.tobytes())),
    "small tag that is not": matrix("<", b"time", (1, 60), data=struct.pack("<HH", 9, 480) + TIME.tobytes()),
    "longer than the file": WHOLE[:-8],
    "no matrix": element("<", 9, TIME.tobytes()),
    "structure without fields": matrix("<", b"s", (1, 1), kind=2, data=b""),
    "fields without length": matrix(
        "<", b"s", (1, 1), kind=2, data=element("<", 5, bytes(4)) + element("<", 1, b"a") + NUMBERS
    ),
    "field that is no matrix": matrix("<", b"s", (1, 1), kind=2, data=FIELDS + NUMBERS),
    "field longer than its structure": matrix(
        "<", b"s", (1, 1), kind=2, data=FIELDS + struct.pack("<II", 14, 1000)
    ),
    "too few structures": matrix("<", b"s", (1, 9), kind=2, data=FIELDS + matrix("<", b"", (0, 0), data=b"")),
    "nested too deeply": nested(200),
    "no compressed data": packed(b"not zlib"),
    "compressed and cut": packed(zlib.compress(WHOLE)[:-9]),
    "compressed and longer": packed(zlib.compress(WHOLE + bytes(999))),
    "compressed with another checksum": packed(zlib.compress(WHOLE)[:-1] + b"\0"),
    "compressed twice": packed(zlib.compress(packed(zlib.compress(WHOLE)))),
}


@pytest.mark.parametrize("kind", DAMAGED)
def test_damaged_version_5_files_are_read_or_rejected(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "a.mat"
    path.write_bytes(version_5("<", DAMAGED[kind]))
    with pytest.raises(InputError, match=r"a\.mat cannot be read as MAT; it may be truncated or damaged"):
        read_raw(path)


@pytest.mark.parametrize("whole", [WHOLE, nested(20)])
def test_undamaged_file_of_the_damage_tests_is_readable(tmp_path: Path, whole: bytes) -> None:
    path = tmp_path / "a.mat"
    for content in (whole, packed(zlib.compress(whole))):
        path.write_bytes(version_5("<", content))
        assert len(read_raw(path).variables) == 1


@pytest.mark.parametrize(
    "header",
    [
        (0, -1, 1, 0, 5),
        (0, 60, 1, 0, 0),
        (0, 60, 1, 0, -5),
        (0, 60, 1, 7, 5),
        (0, 2**31 - 1, 2**31 - 1, 0, 5),
        (3, 60, 1, 0, 5),
        (60, 60, 1, 0, 5),
        (100, 60, 1, 0, 5),
        (0, 61, 1, 0, 5),
    ],
)
def test_damaged_version_4_files_are_read_or_rejected(tmp_path: Path, header: tuple[int, ...]) -> None:
    path = tmp_path / "a.mat"
    path.write_bytes(struct.pack("<5i", *header) + b"time\0" + TIME.tobytes())
    with pytest.raises(InputError, match=r"a\.mat cannot be read as MAT; it may be truncated or damaged"):
        read_raw(path)


def test_numbers_of_a_vax_are_reported(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    path.write_bytes(struct.pack("<5i", 2000, 60, 1, 0, 5) + b"time\0" + TIME.tobytes())
    with pytest.raises(InputError, match="a VAX or a Cray"):
        read_raw(path)


def test_every_truncation_is_detected(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    for form in ({"format": "4"}, {}, {"do_compression": True}):
        scipy.io.savemat(path, {"time": TIME[:4], "s": TIME[:3]}, **form)
        content = path.read_bytes()
        whole = len(read_raw(path).variables)
        for length in range(1, len(content), 5):
            path.write_bytes(content[:length])
            with suppress(InputError):  # cut between two variables, a file is a shorter one
                assert len(read_raw(path).variables) < whole


def test_cells_become_numbered_variables_or_columns(tmp_path: Path) -> None:
    cells = np.empty(2, dtype=object)
    cells[:] = [TIME, {"q": np.sin(TIME)}]
    many = np.empty((len(TIME) * 10, 1), dtype=object)
    many[:, 0] = [float(k) for k in range(len(many))]
    scipy.io.savemat(tmp_path / "a.mat", {"log": cells, "many": many})
    found = read_raw(tmp_path / "a.mat").variables
    np.testing.assert_array_equal(found["log{1}"].ravel(), TIME)
    np.testing.assert_array_equal(found["log{2}.q"].ravel(), np.sin(TIME))
    np.testing.assert_array_equal(found["many"], np.arange(len(many)).reshape(-1, 1).ravel())


def opaque(name: str, of_class: str) -> bytes:
    """A variable that holds an object, as MATLAB writes it; its content is published nowhere."""

    def element(kind: int, content: bytes) -> bytes:
        return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)

    inner = element(6, struct.pack("<II", 17, 0))
    inner += b"".join(element(1, text.encode()) for text in (name, "MCOS", of_class))
    return element(14, inner + element(14, b""))


@pytest.mark.parametrize(
    ("of_class", "remedy"),
    [
        ("timeseries", "s = struct('t', out.Time, 'y', squeeze(out.Data))"),
        ("Simulink.SimulationData.Dataset", "e = out{1}.Values"),
        ("timetable", "writetimetable(out, 'log.csv')"),
        ("my.Own", "save its numbers as arrays"),
    ],
)
def test_matlab_object_is_reported_with_advice(tmp_path: Path, of_class: str, remedy: str) -> None:
    scipy.io.savemat(tmp_path / "a.mat", {"k": 1.0}, do_compression=False)
    plain = (tmp_path / "a.mat").read_bytes() + opaque("out", of_class)
    (tmp_path / "a.mat").write_bytes(plain)
    text = 'time = { source = "out.Time" }\nchannels = { "joint1.position" = { source = "out.Data" } }'
    mapped = mapping_from_toml(text, source="map")
    for mapping in (None, mapped):
        with pytest.raises(InputError) as told:
            load_recording(tmp_path / "a.mat", mapping=mapping)
        message = str(told.value)
        assert f"out is an object of the class {of_class}, which only MATLAB opens; there, " in message
        assert remedy in message
