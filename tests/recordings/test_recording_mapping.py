"""Mapping files: every way to make a channel, against the same channel made by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lsim

from missing_physics.recordings import (
    Correction,
    check,
    in_words,
    load_constants,
    load_mapping,
    load_recording,
    mapping_from_toml,
)
from missing_physics.recordings.channels.estimates import noise_of
from missing_physics.recordings.inspection.values import value_findings
from robot_model import InputError, Recording

N = 200
T = np.arange(N) / 100.0


def load(tmp_path: Path, text: str, /, **variables: np.ndarray) -> Recording:
    np.savez(tmp_path / "raw.npz", **variables)
    return load_recording(tmp_path / "raw.npz", mapping=mapping_from_toml(text), check=False)


def test_scale_offset_row_and_column(tmp_path: Path) -> None:
    table = np.vstack([T, np.sin(T), np.cos(T)])
    text = """
        [time]
        source = "rec"
        row = 0
        [channels."joint1.position"]
        source = "rec"
        row = 2
        scale = 2.0
        offset = -1.0
        [channels."joint2.position"]
        source = "tall"
        column = 1
        [channels."joint3.position"]
        source = "cube"
        index = [0, 1, ":"]
    """
    recording = load(tmp_path, text, rec=table, tall=table.T, cube=table[None])
    np.testing.assert_array_equal(recording.time, T)
    np.testing.assert_array_equal(recording["joint1.position"], 2 * np.cos(T) - 1)
    np.testing.assert_array_equal(recording["joint2.position"], np.sin(T))
    np.testing.assert_array_equal(recording["joint3.position"], np.sin(T))


def test_product_terms_and_signed_bits(tmp_path: Path) -> None:
    pwm = np.round(800 * np.sin(3 * T)).astype(np.int64)
    text = """
        [time]
        rate = 100.0
        [channels."joint1.voltage"]
        product = [{ source = "pwm", signed_bits = 16 }, "volts", "gain"]
        scale = 0.5
        [channels."joint2.torque"]
        terms = [{ source = "a", scale = 2.0 }, { source = "b", scale = -1.0, offset = 3.0 }]
        [constants]
        gain = "gain"
    """
    raw = {"pwm": pwm % 65536, "volts": 7 + T, "gain": np.array([[4.0]]), "a": np.sin(T), "b": np.cos(T)}
    recording = load(tmp_path, text, **raw)
    np.testing.assert_array_equal(recording.time, np.arange(N) / 100.0)
    np.testing.assert_allclose(recording["joint1.voltage"], 0.5 * pwm * (7 + T) * 4.0, rtol=1e-15)
    np.testing.assert_allclose(recording["joint2.torque"], 2 * np.sin(T) - np.cos(T) + 3, rtol=1e-14)
    assert load_constants(tmp_path / "raw.npz", mapping=mapping_from_toml(text)) == {"gain": 4.0}


def test_servo_voltage_is_proportional_to_its_error_up_to_the_supply(tmp_path: Path) -> None:
    text = """
        [time]
        rate = 100.0
        [channels."joint1.voltage"]
        servo = { goal = "goal", position = { source = "twice", scale = 0.5 }, gain = 2.0, supply = "v" }
        valid = "on"
        [channels."joint2.voltage"]
        servo = { goal = "goal", position = "still", gain = "gain", supply = 12.0, limit = 0.9 }
    """
    raw = {"goal": np.sin(3 * T), "twice": 2.0 * np.cos(T), "v": 7 + T, "on": np.arange(N) % 5}
    recording = load(tmp_path, text, **raw, still=0 * T, gain=np.array([[4.0]]))
    duty = np.clip(2.0 * (np.sin(3 * T) - np.cos(T)), -1.0, 1.0)
    assert 0.1 < (np.abs(duty) == 1.0).mean() < 0.9
    on = raw["on"] != 0
    np.testing.assert_allclose(recording["joint1.voltage"][on], (duty * (7 + T))[on], rtol=1e-14)
    assert np.isnan(recording["joint1.voltage"][~on]).all()
    np.testing.assert_allclose(
        recording["joint2.voltage"], 12.0 * np.clip(4.0 * np.sin(3 * T), -0.9, 0.9), rtol=1e-14
    )


def test_a_channel_is_limited_after_its_scale(tmp_path: Path) -> None:
    text = TIME + '[channels."joint1.torque"]\nterms = ["a", "b"]\nscale = 2.0\nclip = [-1.5, 1.0]'
    recording = load(tmp_path, text, a=np.sin(3 * T), b=np.cos(T))
    torque = 2 * (np.sin(3 * T) + np.cos(T))
    np.testing.assert_allclose(recording["joint1.torque"], np.clip(torque, -1.5, 1.0), rtol=1e-14)
    mapping = mapping_from_toml(text)
    message = in_words([Correction("joint1.torque", scale=-3.0)], mapping)
    assert "scale = -6" in message
    assert "clip = [-3, 4.5]" in message


@pytest.mark.parametrize("bits", [2, 8, 16])
def test_signed_bits_are_twos_complement_up_to_the_limits(tmp_path: Path, bits: int) -> None:
    """The largest positive number is followed by the most negative one, and all ones are -1."""
    half = 2 ** (bits - 1)
    logged = np.tile([0, half - 1, half, 2 * half - 1], N // 4)
    text = f"""
        [time]
        rate = 100.0
        [channels."joint1.current"]
        source = "raw"
        signed_bits = {bits}
    """
    recording = load(tmp_path, text, raw=logged)
    np.testing.assert_array_equal(recording["joint1.current"][:4], [0, half - 1, -half, -1])


def test_low_pass_of_a_map_is_inverted(tmp_path: Path) -> None:
    """The exact answer of the filter to two sines, from the start of the recording on: transients too."""
    time = np.arange(2000) / 500.0
    w, d = 2 * np.pi * 2.0, 0.9
    before = np.sin(2 * np.pi * 1.3 * time) + 0.2 * np.sin(2 * np.pi * 6.0 * time)
    _, filtered, _ = lsim(([w**2], [1.0, 2 * d * w, w**2]), before, time)
    text = """
        time = { source = "t" }
        [channels."joint1.position"]
        source = "y"
        low_pass = { frequency = 2.0, damping_ratio = 0.9 }
    """
    recording = load(tmp_path, text, t=time, y=filtered)
    # Central differences are off by (2 pi f h)^2 / 6, 0.1 % at 6 Hz; lsim takes the input for linear between.
    np.testing.assert_allclose(recording["joint1.position"][5:-5], before[5:-5], atol=2e-3)
    assert np.abs(filtered - before).max() > 0.5


def test_window_keeps_the_samples_inside(tmp_path: Path) -> None:
    text = """
        window = [0.5, 1.25]
        time = { rate = 100.0 }
        channels = { "joint1.position" = { source = "q" } }
    """
    recording = load(tmp_path, text, q=np.sin(T))
    np.testing.assert_array_equal(recording.time, T[50:126])
    np.testing.assert_array_equal(recording["joint1.position"], np.sin(T[50:126]))
    with pytest.raises(InputError, match="window"):
        mapping_from_toml("window = [2.0, 1.0]\n" + TIME + ONE + 'source = "q"')


def test_a_part_of_a_file(tmp_path: Path) -> None:
    """FILE@FIRST:LAST, with and without a map; two parts that meet share no sample."""
    np.savez(tmp_path / "raw.npz", **{"time": T, "joint1.position": np.sin(T), "gain": np.array(2.0)})
    mapping = mapping_from_toml("""
        [time]
        source = "time"
        [channels."joint1.position"]
        source = "joint1.position"
        scale = 2.0
        [constants]
        gain = "gain"
    """)
    first = load_recording(f"{tmp_path}/raw.npz@:1")
    second = load_recording(f"{tmp_path}/raw.npz@1:1.9", mapping=mapping)
    np.testing.assert_array_equal(first.time, T[:100])
    np.testing.assert_array_equal(second.time, T[100:190])
    np.testing.assert_array_equal(second["joint1.position"], 2 * np.sin(T[100:190]))
    assert second.source == f"{tmp_path}/raw.npz@1:1.9"
    assert load_constants(f"{tmp_path}/raw.npz@1:1.9", mapping=mapping) == {"gain": 2.0}


@pytest.mark.parametrize(
    ("part", "sentence"),
    [
        ("1.7:", r"raw\.npz@1\.7: has 30 samples, of a recording from 0 to 1\.99 s; at least 50"),
        ("5:9", "has 0 samples"),
        ("1:0", "two instants in seconds are expected"),
        ("nan:1", "two instants in seconds are expected"),
        ("one:2", "two instants in seconds are expected"),
    ],
)
def test_invalid_part_of_a_file_is_rejected(tmp_path: Path, part: str, sentence: str) -> None:
    np.savez(tmp_path / "raw.npz", **{"time": T, "joint1.position": np.sin(T)})
    with pytest.raises(InputError, match=sentence):
        load_recording(tmp_path / f"raw.npz@{part}")


def test_file_name_that_looks_like_a_part_is_read(tmp_path: Path) -> None:
    np.savez(tmp_path / "raw.npz", **{"time": T, "joint1.position": np.sin(T)})
    (tmp_path / "raw.npz").rename(tmp_path / "log@0:1.npz")
    assert len(load_recording(tmp_path / "log@0:1.npz")) == N
    with pytest.raises(InputError, match=r"other\.npz@0:1 does not exist"):
        load_recording(tmp_path / "other.npz@0:1")


def test_low_pass_without_a_frequency_is_rejected() -> None:
    with pytest.raises(InputError, match="frequency"):
        mapping_from_toml(TIME + ONE + 'source = "q"\nlow_pass = { damping_ratio = 1.0 }')
    with pytest.raises(InputError, match="did you mean 'damping_ratio'"):
        mapping_from_toml(TIME + ONE + 'source = "q"\nlow_pass = { frequency = 1.0, damping = 1.0 }')


def test_delay_of_a_map_is_corrected(tmp_path: Path) -> None:
    """A channel recorded 25 ms late is set right, and rows without it are cut off."""
    late = 0.025
    text = f"""
        [time]
        source = "t"
        [channels."joint1.position"]
        source = "q"
        [channels."joint1.torque"]
        source = "u"
        delay = {late}
    """
    recording = load(tmp_path, text, t=T, q=np.sin(T), u=np.sin(3 * (T - late)))
    # Linear interpolation between samples h apart errs by at most h^2/8 times the second derivative.
    np.testing.assert_allclose(recording["joint1.torque"], np.sin(3 * recording.time), atol=9 * 0.01**2 / 8)
    np.testing.assert_array_equal(recording["joint1.position"], np.sin(recording.time))
    assert recording.time[0] == 0.0
    assert T[-1] - recording.time[-1] == pytest.approx(0.03)


def test_channel_with_its_own_time_stamps(tmp_path: Path) -> None:
    slow = np.arange(0.105, 1.8, 0.05)
    text = """
        [time]
        source = "t"
        [channels."joint1.position"]
        source = "q"
        [channels."joint1.temperature"]
        source = "k"
        time = { source = "ms", scale = 0.001 }
    """
    recording = load(tmp_path, text, t=T, q=np.sin(T), ms=1000 * slow, k=300 + slow)
    # A straight line is interpolated exactly but for rounding at 300.
    np.testing.assert_allclose(recording["joint1.temperature"], 300 + recording.time, rtol=1e-14)
    assert recording.time[0] == pytest.approx(0.11)


def test_slower_channel_is_read_at_its_own_time_stamps(tmp_path: Path) -> None:
    """In between are no samples: what is interpolated there was not measured."""
    slow = T[3::10] + 0.002  # a fifth of a sample late
    text = """
        [time]
        source = "t"
        [channels."joint1.position"]
        source = "q"
        [channels."link1.strain.1"]
        source = "e"
        time = { source = "ts" }
    """
    recording = load(tmp_path, text, t=T, q=np.sin(T), ts=slow, e=1e-5 * np.sin(slow))
    there = np.isfinite(recording["link1.strain.1"])
    # the first sample of the gauge lies after its instant, so that this one is cut off
    np.testing.assert_allclose(recording.time[there], T[3::10][1:])
    expected = 1e-5 * np.sin(recording.time[there])
    # the chord of 0.1 s is off by at most 0.1^2/8 of the curvature
    np.testing.assert_allclose(recording["link1.strain.1"][there], expected, atol=1e-5 * 0.1**2 / 8)
    assert np.isfinite(recording["joint1.position"]).all()
    [finding] = [f for f in value_findings(recording) if f.channel == "link1.strain.1" and f.kind == "slower"]
    assert finding.severity == "note"


def test_noise_of_a_slower_clock_uses_its_own_samples() -> None:
    time = np.arange(4000) * 1e-3
    noisy = np.sin(time) + 0.01 * np.random.default_rng(5).standard_normal(time.size)
    recording = Recording(time, {"link1.strain.1": np.where(np.arange(time.size) % 10 == 0, noisy, np.nan)})
    assert noise_of(recording, "link1.strain.1") == pytest.approx(0.01, rel=0.15)  # of 400 samples


def test_invalid_samples_become_missing(tmp_path: Path) -> None:
    on = T > 0.5
    text = """
        [time]
        source = "t"
        [channels."joint1.voltage"]
        source = "u"
        valid = "on"
    """
    recording = load(tmp_path, text, t=T, u=1 + T, on=on)
    np.testing.assert_array_equal(np.isnan(recording["joint1.voltage"]), ~on)


@pytest.mark.parametrize("form", ["nanoseconds", "datetime", "text"])
def test_unix_time_stamps_keep_their_precision(tmp_path: Path, form: str) -> None:
    """Nanoseconds since 1970 do not fit into a float; the start must be subtracted first."""
    ns = 1_768_469_290_123_456_789 + 10_000_003 * np.arange(N)
    stamps = {
        "nanoseconds": ns,
        "datetime": ns.astype("datetime64[ns]").astype(str),
        "text": np.array([f"{s}Z" for s in ns.astype("datetime64[ns]")]),
    }[form]
    text = """
        [time]
        source = "t"
        scale = 1e-9
        start_at_zero = true
        [channels."joint1.position"]
        source = "q"
    """
    recording = load(tmp_path, text, t=stamps, q=np.sin(T))
    # The product with 1e-9 rounds once: 2^-53 of 2 s.
    np.testing.assert_allclose(recording.time, 0.010000003 * np.arange(N), rtol=1e-15, atol=0)


def test_several_files_form_one_recording(tmp_path: Path) -> None:
    np.savez(tmp_path / "one.npz", t=T, a=np.sin(T))
    np.savez(tmp_path / "two.npz", b=np.cos(T))
    mapping = mapping_from_toml("""
        join = ["two.npz"]
        [time]
        source = "t"
        [channels."joint1.position"]
        source = "a"
        [channels."joint1.torque"]
        source = "b"
    """)
    np.testing.assert_array_equal(
        load_recording(tmp_path / "one.npz", mapping=mapping)["joint1.torque"], np.cos(T)
    )
    (tmp_path / "two.npz").unlink()
    with pytest.raises(InputError, match=r"two\.npz does not exist"):
        load_recording(tmp_path / "one.npz", mapping=mapping)


def test_columns_without_names_of_several_files(tmp_path: Path) -> None:
    (tmp_path / "time.txt").write_text("\n".join(f"{t:.3f}" for t in T))
    for name, wave in (("angle", np.sin(T)), ("torque", np.cos(T))):
        rows = [f"0\t{value!r}\t" for value in wave.tolist()]
        (tmp_path / f"{name}.txt").write_text("\n".join(rows) + "\n")
    mapping = mapping_from_toml("""
        join = ["angle.txt", "torque.txt"]
        [time]
        source = "column1"
        [channels."joint1.position"]
        source = "angle.column2"
        [channels."joint1.torque"]
        source = "torque.column2"
        scale = -1.0
    """)
    recording = load_recording(tmp_path / "time.txt", mapping=mapping)
    np.testing.assert_array_equal(recording["joint1.position"], np.sin(T))
    np.testing.assert_array_equal(recording["joint1.torque"], -np.cos(T))


def test_derivative_of_a_variable(tmp_path: Path) -> None:
    """u = 20 (r - q) - 1.5 q', the law of a drive that logs no torque; steps need not be even."""
    time = T + 0.002 * np.sin(40 * T)
    text = """
        [time]
        source = "t"
        [channels."joint1.position"]
        source = "q"
        [channels."joint1.torque"]
        terms = [
            { source = "r", scale = 20.0 },
            { source = "q", scale = -20.0 },
            { source = "q", scale = -1.5, offset = 7.0, derivative = true },
        ]
    """
    recording = load(tmp_path, text, t=time, q=np.sin(3 * time), r=np.cos(3 * time))
    law = 20 * (np.cos(3 * time) - np.sin(3 * time)) - 4.5 * np.cos(3 * time)
    # Central differences: 27 (0.0108 s)^2 / 6, from the third derivative of q, times 1.5; double at the ends.
    np.testing.assert_allclose(recording["joint1.torque"], law, rtol=0, atol=1.6e-3)
    assert np.abs(recording["joint1.torque"] - law)[1:-1].max() < 8e-4


def test_one_of_several_records_in_a_file(tmp_path: Path) -> None:
    time = np.concatenate([T, T, T[:120]])
    wave = np.arange(time.size, dtype=float)
    text = """
        {}
        [time]
        source = "t"
        [channels."joint1.position"]
        source = "q"
        valid = "on"
        [channels."joint1.velocity"]
        source = "q"
        derivative = true
    """
    raw = {"t": time, "q": wave, "on": wave != 410}
    third = load(tmp_path, text.format("record = 3"), **raw)
    np.testing.assert_array_equal(third.time, T[:120])
    np.testing.assert_array_equal(third["joint1.position"], [*range(400, 410), np.nan, *range(411, 520)])
    # No difference is taken across the seam.
    np.testing.assert_allclose(third["joint1.velocity"], 100.0, rtol=1e-9)
    with pytest.raises(InputError, match=r"holds 3 records one after another, the mapping asks for record 4"):
        load(tmp_path, text.format("record = 4"), **raw)
    with pytest.raises(InputError, match=r"time goes back in row 201 .* holds 3 records .* write record = 1"):
        load(tmp_path, text.format(""), **raw)


def test_equal_time_stamps_are_spread_up_to_the_next(tmp_path: Path) -> None:
    """Rows at 450 Hz under a clock of 15.625 ms: the stamp is the tick before the row."""
    rows = np.arange(900) / 450.0
    stamps = np.floor(rows / 0.015625) * 0.015625
    text = """
        [time]
        source = "t"
        {}
        [channels."joint1.position"]
        source = "q"
    """
    recording = load(tmp_path, text.format('equal_stamps = "spread"'), t=stamps, q=np.sin(rows))
    # A row is less than one row's time away from where it was: a tick holds 7.03 rows.
    assert np.abs(recording.time - rows).max() < 1 / 450
    assert np.diff(recording.time).min() > 0
    with pytest.raises(InputError, match=r'time repeats in row 2 .*equal_stamps = "spread"'):
        load(tmp_path, text.format(""), t=stamps, q=np.sin(rows))


def test_noise_and_resolution_are_passed_on(tmp_path: Path) -> None:
    text = """
        [time]
        rate = 100
        [channels."joint1.position"]
        source = "q"
        noise = 1e-4
        resolution = 2e-4
    """
    recording = load(tmp_path, text, q=np.sin(T))
    assert dict(recording.noise) == {"joint1.position": 1e-4}
    assert dict(recording.resolution) == {"joint1.position": 2e-4}


TIME = "[time]\nrate = 100\n"
ONE = '[channels."joint1.position"]\n'


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("= 3", "not valid TOML"),
        (ONE + 'source = "q"', "key 'time' is missing"),
        ("[time]\nscale = 2.0\n" + ONE + 'source = "q"', "time: give either source or rate"),
        ("[time]\nrat = 2.0\n" + ONE + 'source = "q"', "unknown key 'time.rat'; did you mean 'rate'?"),
        (TIME + ONE + 'sorce = "q"', "did you mean 'source'?"),
        (TIME + ONE + 'terms = [{ source = "q", scal = 1.0 }]', "did you mean 'scale'?"),
        (TIME + ONE + "scale = 2.0", "give exactly one of source, product, terms and servo"),
        (TIME + ONE + 'source = "q"\nrow = 1\ncolumn = 1', "give only one of row, column and index"),
        (TIME + ONE + 'product = ["q", "q"]\nrow = 1', "belong in the tables of product, terms or servo"),
        (
            TIME + ONE + 'terms = ["q"]\nderivative = true',
            "belong in the tables of product, terms or servo",
        ),
        (TIME + ONE + 'source = "q"\nclip = [1.0, -1.0]', "clip must be a least and a larger largest value"),
        (
            TIME + ONE + 'servo = { goal = "g" }',
            "servo.position' is missing",
        ),
        (
            TIME + ONE + 'servo = { goal = "g", position = "q", gain = true, supply = 1 }',
            "servo.gain: must be a number, or the name of a variable (it is true)",
        ),
        (
            TIME + ONE + 'servo = { goal = "g", position = "q", gain = nan, supply = 1 }',
            "servo.gain: must be a number, or the name of a variable",
        ),
        (
            TIME + ONE + 'servo = { goal = "g", position = "q", gain = 1, supply = 1, limt = 1 }',
            "servo.limt'; did you mean 'limit'?",
        ),
        (
            TIME
            + ONE
            + 'servo = { goal = { source = "g", scal = 1 }, position = "q", gain = 1, supply = 1 }',
            "servo.goal.scal'; did you mean 'scale'?",
        ),
        ("record = 0\n" + TIME + ONE + 'source = "q"', "record: must be greater than or equal to 1"),
        (TIME + ONE + 'source = "q"\nscale = "two"', "scale: must be a valid number (it is 'two')"),
        (TIME + ONE + 'source = "q"\nscale = "2.0"', "scale: must be a valid number (it is '2.0')"),
        (TIME + ONE + 'source = "q"\nscale = true', "scale: must be a valid number (it is true)"),
        (TIME + ONE + 'source = "q"\nrow = true', "row: must be a valid integer (it is true)"),
        (TIME + ONE + 'source = "q"\nindex = [true, ":"]', "must be a valid integer (it is true)"),
        (TIME + ONE + 'source = "q"\nsigned_bits = "16"', "signed_bits: must be a valid integer"),
        (
            "[time]\nrate = 100\nstart_at_zero = 1\n" + ONE + 'source = "q"',
            "start_at_zero: must be a valid boolean",
        ),
        ("window = [true, 2.0]\n" + TIME + ONE + 'source = "q"', "window[0]: must be a valid number"),
        (
            TIME + ONE + f'source = "q"\nscale = 1{"0" * 5000}',
            "line 5 holds a number of thousands of digits",
        ),
        (
            TIME + ONE + f'source = "q"\nscale = 0x{"f" * 5000}',
            "must be a valid number (it is a whole number of very many digits)",
        ),
        ("a." * 100_000 + "b = 1\n" + TIME, "line 1 has a key of more than 32 dotted parts"),
        (TIME + '[channels."joint1.positon"]\nsource = "q"', "did you mean 'joint1.position'?"),
        (TIME + '[channels.position]\nsource = "q"', "written PLACE.QUANTITY"),
    ],
)
def test_invalid_mapping_gives_an_explanation(text: str, sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        mapping_from_toml(text, source="map.toml")
    assert sentence in str(caught.value)
    assert str(caught.value).startswith("map.toml")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (TIME, "has no native channel, and the map names none"),
        (TIME + ONE + 'source = "qq"', "has no variable 'qq'"),
        (TIME + ONE + 'source = "table"', "say in a mapping which row, column or index"),
        (TIME + ONE + 'source = "table"\nrow = 3', "lies outside"),
        (TIME + ONE + 'source = "q"\nrow = 0', "does not fit"),
        (
            TIME + ONE + 'source = "short"\n[channels."joint2.position"]\nsource = "q"',
            "60 samples for joint1.position",
        ),
        (TIME + ONE + 'product = ["q", "short"]', "differ in length"),
        (TIME + ONE + 'source = "words"', "has 'x' where a number is expected, in column 'words', row 1"),
        (TIME + ONE + 'source = "q"\nvalid = "short"', "short of"),
        (
            TIME + ONE + 'terms = ["q", { source = "one", derivative = true }]',
            "derivative of a single number",
        ),
        ("[time]\nsource = 'words'\n" + ONE + 'source = "q"', "where a number is expected"),
    ],
)
def test_mapping_that_does_not_match_the_file_is_rejected(tmp_path: Path, text: str, sentence: str) -> None:
    raw = {"q": np.sin(T), "table": np.zeros((3, N)), "short": T[:60], "words": np.array(["x"] * N)}
    raw["one"] = np.array(3.0)
    with pytest.raises(InputError) as caught:
        load(tmp_path, text, **raw)
    assert sentence in str(caught.value)
    assert "raw.npz" in str(caught.value)


def test_suggestions_are_valid_keys() -> None:
    """`delay` belongs to a channel, not to one of its terms."""
    with pytest.raises(InputError) as caught:
        mapping_from_toml(TIME + ONE + 'terms = [{ source = "q", delay = 1.0 }]')
    assert "unknown key" in str(caught.value)
    assert "'delay'?" not in str(caught.value)


@pytest.mark.parametrize("name", ["none.toml", "a\0b", "x" * 5000])
def test_missing_mapping_file(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="give the path of a mapping file"):
        load_mapping(tmp_path / name)


def test_dotted_words_in_text_and_comments_are_not_keys(tmp_path: Path) -> None:
    words = "a." * 50 + "b"
    text = f'# {words}\ndescription = """{words}\n{words}"""\n{TIME}{ONE}source = "{words}"\n'
    assert mapping_from_toml(text).sources() == {words}


def test_mapping_with_a_byte_order_mark_and_other_line_ends(tmp_path: Path) -> None:
    path = tmp_path / "map.toml"
    text = (TIME + ONE + 'source = "q"\n').encode()
    path.write_bytes(b"\xef\xbb\xbf" + text)
    assert load_mapping(path).sources() == {"q"}
    path.write_bytes(text.replace(b"\n", b"\r"))
    assert load_mapping(path).sources() == {"q"}


def test_samples_cut_off_at_the_ends_are_reported(tmp_path: Path) -> None:
    text = """
        [time]
        source = "t"
        [channels."joint1.position"]
        source = "q"
        [channels."joint1.torque"]
        source = "u"
        time = { source = "s" }
    """
    time = np.arange(1000) / 100.0
    late = load(tmp_path, text, t=time, q=np.sin(time), u=np.cos(time[200:900]), s=time[200:900])
    assert late.time[[0, -1]] == pytest.approx([2.0, 8.99])
    assert late.left_out == (
        "300 of 1000 samples are left out at the ends, where joint1.torque has no numbers: it has some "
        "from 2 to 8.99 s only"
    )
    [finding] = [finding for finding in check(late) if finding.kind == "left_out"]
    assert finding.sentence == f"{late.left_out}."
    window = "window = [2.0, 8.9]\n" + text
    asked = load(tmp_path, window, t=time, q=np.sin(time), u=time[200:900], s=time[200:900])
    assert asked.left_out == ""
