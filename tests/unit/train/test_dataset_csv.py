"""CSV files of somebody's boat: units, signs and winds by a column map, and a clear line for every broken file."""

import dataclasses
import math
import random
import re
from pathlib import Path

import numpy as np
import pytest

from asvhil.errors import ConfigError, LogError, ModelError
from asvhil.train.columns import load_columns
from asvhil.train.dataset import dataset_from_csv, find_columns
from asvhil.train.windows import check
from tests.support.paths import ROOT

MAP = """
time: {column: ms, unit: ms}
u: {column: surge, unit: m/s}
v: {column: sway, unit: cm/s, sign: -1}
r: {column: yaw_rate, unit: deg/s}
psi: {column: yaw, unit: deg}
port: {column: left, unit: us, astern_us: 1100, neutral_us: 1500, ahead_us: 1900}
starboard: {column: right, unit: us, sign: -1, astern_us: 1100, neutral_us: 1510, ahead_us: 1900}
"""
HEADER = "ms,surge,sway,yaw_rate,yaw,left,right"
ROWS = 401  # 40 s at 10 Hz


def row(k: int) -> list[str]:
    """u = 1 + 0.1 t, v = 0.2, r = 0.1 rad/s; port 0.5 and starboard -0.25, changing sign each second."""
    t_s = 0.1 * k
    sign = 1 if k // 10 % 2 == 0 else -1
    yaw = math.degrees(0.1 * t_s + 3.0) % 360.0
    left, right = 1500 + 200 * sign, (1510 + 0.25 * 390) if sign > 0 else (1510 - 0.25 * 410)
    return [
        str(5000 + 100 * k),
        f"{1 + 0.1 * t_s:.6f}",
        "-20",
        f"{math.degrees(0.1):.6f}",
        f"{yaw:.6f}",
        str(left),
        str(right),
    ]


def write(tmp_path: Path, rows: list[list[str]] | None = None, header: str = HEADER, sep: str = ",") -> Path:
    lines = [header.replace(",", sep)] + [sep.join(fields) for fields in (rows or [row(k) for k in range(ROWS)])]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def column_map(tmp_path: Path, text: str = MAP) -> Path:
    path = tmp_path / "map.yaml"
    path.write_text(text)
    return path


def test_units_signs_and_pulses(tmp_path: Path) -> None:
    data = dataset_from_csv([write(tmp_path)], column_map(tmp_path), 0.2)
    [segment] = data.segments
    assert data.dt_s == 0.2 and data.outliers == 0 and data.duration_s == pytest.approx(40.0)
    assert np.allclose(segment.t_s, 0.2 * np.arange(200))
    assert np.allclose(segment.nu, np.stack([1 + 0.1 * segment.t_s, 0.2 + 0 * segment.t_s, 0.1 + 0 * segment.t_s], -1))
    assert np.allclose(segment.psi, 3.0 + 0.1 * segment.t_s, atol=1e-6)  # continuous through 360 degrees
    sign = np.where(segment.t_s % 2.0 < 0.99, 1.0, -1.0)
    assert np.allclose(segment.command, np.stack([0.5 * sign, -0.25 * sign], -1))
    assert (segment.wind == 0.0).all()


def test_smoothing_and_another_step(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    rows = [row(k) for k in range(ROWS)]
    for fields in rows:
        fields[1] = f"{float(fields[1]) + rng.normal(0.0, 0.1):.6f}"
    path = write(tmp_path, rows)
    errors = []
    for smoothed in (False, True):
        [segment] = dataset_from_csv([path], column_map(tmp_path), 0.5, smoothed=smoothed).segments
        errors.append(np.abs(segment.nu[:, 0] - (1 + 0.1 * segment.t_s)).mean())
        assert np.allclose(np.diff(segment.t_s), 0.5)
    assert errors[1] < 0.6 * errors[0]


@pytest.mark.parametrize(
    ("lines", "header", "values", "expected"),
    [
        ("wind_u: {column: a, unit: m/s}\nwind_v: {column: b, unit: m/s}", "a,b", ("3", "-1"), (3.0, -1.0)),
        ("wind_n: {column: a, unit: m/s}\nwind_e: {column: b, unit: m/s}", "a,b", ("3", "0"), None),
        ("wind_speed: {column: a, unit: kn}\nwind_from: {column: b, unit: deg}", "a,b", ("3.8876889849", "90"), "side"),
    ],
)
def test_the_ways_a_wind_is_given(tmp_path: Path, lines: str, header: str, values: tuple[str, str], expected) -> None:
    path = write(tmp_path, [[*row(k), *values] for k in range(ROWS)], f"{HEADER},{header}")
    [segment] = dataset_from_csv([path], column_map(tmp_path, MAP + lines), 0.2).segments
    if expected is None:  # 3 m/s toward north, in body axes
        wanted = 3.0 * np.stack([np.cos(segment.psi), -np.sin(segment.psi)], -1)
    elif expected == "side":  # 2 m/s apparent from starboard: 2 m/s to port, and along with the boat
        wanted = segment.nu[:, :2] + [0.0, -2.0]
    else:
        wanted = np.tile(expected, (len(segment.t_s), 1))
    assert np.allclose(segment.wind, wanted, atol=5e-3)


def test_a_few_missing_rows_are_bridged_and_many_split(tmp_path: Path) -> None:
    rows = [row(k) for k in range(ROWS)]
    for k in (100, 101, 102):
        rows[k][2] = "nan"
    rows[150][1] = ""
    [segment] = dataset_from_csv([write(tmp_path, rows)], column_map(tmp_path), 0.2).segments
    assert np.isfinite(segment.nu).all()
    for k in range(200, 216):
        rows[k][5] = "NaN"
    first, second = dataset_from_csv([write(tmp_path, rows)], column_map(tmp_path), 0.2).segments
    assert first.t_s[-1] < 20.0 and second.t_s[0] > 21.4


def test_jumps_are_left_out(tmp_path: Path) -> None:
    rows = [row(k) for k in range(ROWS)]
    rows[77][1] = "9.5"
    data = dataset_from_csv([write(tmp_path, rows)], column_map(tmp_path), 0.2)
    assert data.outliers == 1 and data.segments[0].nu[:, 0].max() < 5.1


def put(rows: list[list[str]], k: int, column: int, text: str) -> list[list[str]]:
    rows[k][column] = text
    return rows


def all_rows() -> list[list[str]]:
    return [row(k) for k in range(ROWS)]


@pytest.mark.parametrize(
    ("rows", "header", "words"),
    [
        (
            all_rows(),
            HEADER.replace("sway", "drift"),
            r"row 1: no column 'sway' \(for v\); the header has 'ms', 'surge', 'drift'",
        ),
        (put(all_rows(), 41, 1, "fast"), HEADER, r"row 43, column 'surge': a number is expected, not 'fast'"),
        (
            [put([row(k)], 0, 3, "nan" if k % 10 == 3 else "1")[0] for k in range(ROWS)],
            HEADER,
            r"column 'yaw_rate': 40 of 401 values are NaN or empty, the first in row 5; up to 5%",
        ),
        (put(all_rows(), 60, 0, "5900"), HEADER, r"row 62, column 'ms': time does not rise \(5900 after 10900\)"),
        ([row(k) for k in range(100)], HEADER, r"9\.[68] s of usable data, at least 30 s"),
        (
            [*all_rows(), [str(ROWS * 100 + 15000 + 10**11), *row(ROWS)[1:]]],
            HEADER,
            r"row 403, column 'ms': \S+ is more than 1e\+07 s after the first row: is the unit of time right",
        ),
        (put(all_rows(), 9, 5, "15"), HEADER, r"row 11, column 'left': 15 is no pulse width"),
        ([*all_rows(), ["1", "2"]], HEADER, r"row 403: 2 of 7 fields"),
        ([], "", r"row 1: empty, where the names of the columns should be"),
    ],
)
def test_broken_files_are_told_by_row_and_column(tmp_path: Path, rows, header: str, words: str) -> None:
    path = tmp_path / "run.csv"
    path.write_text("\n".join([header, *(",".join(fields) for fields in rows)]))
    with pytest.raises(LogError, match=f"^{path}: {words}"):
        dataset_from_csv([path], column_map(tmp_path), 0.2)


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("1_500", "; did you mean 1500?"),
        ("1 500", "; did you mean 1500?"),
        ("0,5", "; did you mean 0.5?"),
        ("1,234,567", "; did you mean 1234567?"),
        ("inf", ""),
        ("-Infinity", ""),
        ("1e999", ""),
        ("0x10", ""),
        ("1.2.3", ""),
        ("12:30", ""),
        ("5 m/s", ""),
        ("\u0663", ""),
        ("1\n5", ""),
    ],
)
def test_what_python_or_a_sheet_takes_for_a_number_and_nobody_else(tmp_path: Path, text: str, meant: str) -> None:
    path = write(tmp_path, put(all_rows(), 41, 1, f'"{text}"'))
    words = f"{path}: row {43 + text.count(chr(10))}, column 'surge': a number is expected, not {text!r}{meant}"
    with pytest.raises(LogError, match=f"^{re.escape(words)}$"):
        dataset_from_csv([path], column_map(tmp_path), 0.2)


def test_numbers_as_programs_write_them(tmp_path: Path) -> None:
    rows = all_rows()
    plain = dataset_from_csv([write(tmp_path, rows)], column_map(tmp_path), 0.2).segments[0].nu
    for k, form in enumerate(("{:+.9f}", " {:.9f} ", '"{:.9f}"', "{:.9e}", "{:.9E}", "{:g}"), start=30):
        rows[k][1] = form.format(float(rows[k][1]))
    assert np.allclose(dataset_from_csv([write(tmp_path, rows)], column_map(tmp_path), 0.2).segments[0].nu, plain)
    for k, missing in enumerate(("", " ", "NaN", "nan", "NA", "null"), start=40):
        rows[5 * k][1] = missing
    dataset = dataset_from_csv([write(tmp_path, rows)], column_map(tmp_path), 0.2)
    assert dataset.missing == 6


def test_a_column_that_is_there_twice_is_refused_if_it_is_used(tmp_path: Path) -> None:
    rows = [[*fields, "9"] for fields in all_rows()]
    path = write(tmp_path, rows, f"{HEADER}, surge ")
    with pytest.raises(LogError, match=rf"^{path}: row 1: column 'surge' is there 2 times \(as 2 and 8\)$"):
        dataset_from_csv([path], column_map(tmp_path), 0.2)
    rows = [[*fields, "9"] for fields in rows]
    assert dataset_from_csv([write(tmp_path, rows, f"{HEADER},note,note")], column_map(tmp_path), 0.2).segments


def test_a_row_with_more_fields_than_names_is_refused_unless_they_are_empty(tmp_path: Path) -> None:
    assert dataset_from_csv([write(tmp_path, [[*fields, ""] for fields in all_rows()])], column_map(tmp_path), 0.2)
    path = write(tmp_path, put(all_rows(), 20, 1, "0,25"))  # a decimal comma in a file of commas
    with pytest.raises(LogError, match=rf"^{path}: row 22: 8 of 7 fields$"):
        dataset_from_csv([path], column_map(tmp_path), 0.2)
    path = write(tmp_path, put(all_rows(), 20, 1, '"0.25'))  # a quote that is never closed
    with pytest.raises(LogError, match=rf"^{path}: row \d+: "):
        dataset_from_csv([path], column_map(tmp_path), 0.2)


def test_mutated_files_are_read_or_refused_in_one_line(tmp_path: Path) -> None:
    noise, columns = random.Random(1), column_map(tmp_path)
    whole = write(tmp_path).read_bytes()
    refused = 0
    for _ in range(60):
        data = bytearray(whole)
        for _ in range(noise.randrange(1, 4)):
            at = noise.randrange(len(data))
            odd = (b",", b'"', b"\n", b"\x00", b"_", b"-", b"e", b"\xff", b" ", b"", b";", b"inf", b"\r")
            data[at : at + noise.randrange(4)] = noise.choice(odd)
        path = tmp_path / "odd.csv"
        path.write_bytes(bytes(data))
        try:
            dataset_from_csv([path], columns, 0.2)
        except LogError as error:
            refused += 1
            assert str(error).startswith(f"{path}: ") and "\n" not in str(error)
    assert refused > 20


def test_no_rows_no_file_no_text(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    with pytest.raises(LogError, match=r"run\.csv: cannot be read"):
        dataset_from_csv([path], column_map(tmp_path), 0.2)
    path.write_text(HEADER + "\n")
    with pytest.raises(LogError, match=r"run\.csv: holds no row of data"):
        dataset_from_csv([path], column_map(tmp_path), 0.2)
    path.write_bytes(b"\x89MCAP0\r\n\xff\xfe")
    with pytest.raises(LogError, match=r"run\.csv: not UTF-8 text"):
        dataset_from_csv([path], column_map(tmp_path), 0.2)


@pytest.mark.parametrize("speed", ["76", "1e300"])
def test_a_wind_beyond_any_hurricane_is_a_wrong_unit(tmp_path: Path, speed: str) -> None:
    rows = [[*row(k), speed if k == 7 else "3", "90"] for k in range(ROWS)]
    path = write(tmp_path, rows, f"{HEADER},speed,from")
    text = MAP + "wind_speed: {column: speed, unit: m/s}\nwind_from: {column: from, unit: deg}\n"
    with pytest.raises(LogError, match=r"run\.csv: row 9, column 'speed': .* is beyond 75 m/s of wind"):
        dataset_from_csv([path], column_map(tmp_path, text), 0.2)


def slow(tmp_path: Path, step_s: float, jitter_s: float, unit: str = "s") -> Path:
    """120 rows so far apart."""
    t_s = step_s * np.arange(120) + np.random.default_rng(2).uniform(-jitter_s, jitter_s, 120)
    (tmp_path / "map.yaml").write_text(MAP.replace("unit: ms}", f"unit: {unit}}}"))
    rows = [[f"{t:.4f}", *row(10 * k)[1:4], f"{math.degrees(k % 6):.3f}", *row(10 * k)[5:]] for k, t in enumerate(t_s)]
    return write(tmp_path, rows)


def test_the_jitter_of_a_slow_record_is_no_gap(tmp_path: Path) -> None:
    data = dataset_from_csv([slow(tmp_path, 1.0, 0.02)], tmp_path / "map.yaml", 0.2)
    assert len(data.segments) == 1 and data.duration_s > 118.0


def test_little_that_is_usable_says_why(tmp_path: Path) -> None:
    words = r"0\.0 s of usable data, .*: 238 s in 120 rows, but rows are 2 s apart and gaps beyond 1 s end a stretch"
    with pytest.raises(LogError, match=words):
        dataset_from_csv([slow(tmp_path, 2.0, 0.02)], tmp_path / "map.yaml", 0.2)
    with pytest.raises(LogError, match=r"10\.0 s of usable data, at least 30 s are needed$"):
        dataset_from_csv([write(tmp_path, all_rows()[:101])], column_map(tmp_path), 0.2)


def test_a_motor_that_stands_still_in_a_file_is_told(tmp_path: Path) -> None:
    rows = [[*r[:5], "1700", r[6]] for r in all_rows()]
    data = dataset_from_csv([write(tmp_path, rows)], column_map(tmp_path), 0.2)
    (note,) = data.notes
    assert note.endswith("run.csv: the command of the port motor is 0.5 throughout: is its column the right one?")
    turning = dataclasses.replace(data.segments[0], nu=np.random.default_rng(1).normal(size=data.segments[0].nu.shape))
    long = dataclasses.replace(data, segments=(turning, turning))
    with pytest.raises(ModelError, match=r"in none of the files the command of the port motor \(0\.5\) ever changes"):
        check(long)
    assert dataset_from_csv([write(tmp_path)], column_map(tmp_path), 0.2).notes == ()


APPARENT = "wind_speed: {column: aws, unit: m/s}\nwind_from: {column: awa, unit: %s}\n"


@pytest.mark.parametrize(
    ("unit", "speed", "origin", "words"),
    [
        ("rad", "3", "181.38", r"row 2, column 'awa': 181\.38 is no angle in rad \(beyond 2 pi\): unit deg\?"),
        ("deg", "3", "-400", r"row 2, column 'awa': -400 is no angle in deg \(beyond 360\): is the unit right\?"),
        ("deg", "-9", "90", r"row 2, column 'aws': -9 is a negative speed: is its sign right\?"),
    ],
)
def test_a_wind_that_none_has_is_a_wrong_unit_or_sign(
    tmp_path: Path, unit: str, speed: str, origin: str, words: str
) -> None:
    data = write(tmp_path, [[*r, speed, origin] for r in all_rows()], HEADER + ",aws,awa")
    with pytest.raises(LogError, match=words):
        dataset_from_csv([data], column_map(tmp_path, MAP + APPARENT % unit), 0.2)


def read_headings(tmp_path: Path, headings: np.ndarray, unit: str, r: np.ndarray | float, step_s: float = 0.1) -> None:
    """Read a file with a heading a row, and the yaw rate (rad/s)."""
    rates = np.broadcast_to(r, headings.shape)
    rows = [f"{i * step_s:.1f},1,0,{rates[i]:.8f},{psi:.6f},0.5,0.2" for i, psi in enumerate(headings)]
    (tmp_path / "psi.csv").write_text("\n".join(["t,u,v,r,psi,l,s", *rows]))
    text = "time: {column: t, unit: s}\nu: {column: u, unit: m/s}\nv: {column: v, unit: m/s}\n"
    text += "r: {column: r, unit: rad/s}\nport: {column: l, unit: '1'}\nstarboard: {column: s, unit: '1'}\n"
    columns = column_map(tmp_path, text + f"psi: {{column: psi, unit: {unit}}}")
    dataset_from_csv([tmp_path / "psi.csv"], columns, 0.2)


@pytest.mark.parametrize("offset_deg", [0.0, -7000.0])
def test_a_heading_may_count_from_turn_to_turn_but_not_in_another_unit(tmp_path: Path, offset_deg: float) -> None:
    """Circles at 12 deg/s, for 60 s: two turns."""
    t_s = np.arange(0.0, 60.0, 0.1)
    noise = np.random.default_rng(1).normal(0.0, 1.0, len(t_s))
    continuous = 12.0 * t_s + noise + offset_deg

    def read(headings: np.ndarray, unit: str) -> None:
        read_headings(tmp_path, headings, unit, np.radians(12.0))

    for headings in (continuous, continuous % 360.0):
        read(headings, "deg")
        read(np.radians(headings), "rad")
        with pytest.raises(LogError, match=r"is no angle in rad \(beyond 2 pi\): unit deg\?; and it does not change"):
            read(headings, "rad")
    wrapped = np.radians(continuous % 360.0)
    with pytest.raises(LogError, match=r"from \S+ to \S+ deg, which changes 0\.01\d times as far as r says: unit rad"):
        read(wrapped, "deg")


def test_a_heading_on_a_straight_leg_is_refused_only_where_it_can_be_no_other(tmp_path: Path) -> None:
    """The numbers 368 to 372 of a compass that counts on; and +-2 deg with an offset of the gyro, 205 deg in 600 s."""
    sway = np.sin(np.arange(0.0, 600.0, 0.5))
    read_headings(tmp_path, 370.0 + 2.0 * sway, "deg", 0.0, 0.5)
    with pytest.raises(LogError, match=r"beyond 2 pi\): unit deg\?; and the boat turns too little to tell"):
        read_headings(tmp_path, 370.0 + 2.0 * sway, "rad", 0.0, 0.5)
    read_headings(tmp_path, 2.0 * sway, "deg", np.radians(205.0 / 600.0), 0.5)


def test_another_delimiter_and_a_byte_order_mark(tmp_path: Path) -> None:
    path = write(tmp_path, sep=";")
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    with pytest.raises(LogError, match=r"no column 'ms' .*; key delimiter: ';'\?$"):
        dataset_from_csv([path], column_map(tmp_path), 0.2)
    assert dataset_from_csv([path], column_map(tmp_path, 'delimiter: ";"\n' + MAP), 0.2).duration_s == pytest.approx(
        40.0
    )


@pytest.mark.parametrize(
    ("encoding", "words"),
    [("utf-16", "UTF-16 text, .*: iconv -f UTF-16 -t UTF-8"), ("cp1252", "not UTF-8 text, .*: iconv -f WINDOWS-1252")],
)
def test_text_of_another_encoding_tells_how_to_convert_it(tmp_path: Path, encoding: str, words: str) -> None:
    path = write(tmp_path, header=HEADER + ",Böe")
    path.write_bytes(path.read_text(encoding="utf-8").encode(encoding))
    with pytest.raises(LogError, match=rf"run\.csv: {words}"):
        dataset_from_csv([path], column_map(tmp_path), 0.2)


def test_a_pulse_of_zero_is_no_signal_and_percent_are_percent(tmp_path: Path) -> None:
    rows = all_rows()
    for fields in rows:
        fields[5], fields[6] = "0", "-40"
    text = "\n".join(line for line in MAP.splitlines() if not line.startswith("starboard"))
    text += "\nstarboard: {column: right, unit: '%'}"
    [segment] = dataset_from_csv([write(tmp_path, rows)], column_map(tmp_path, text), 0.2).segments
    assert np.allclose(segment.command, [0.0, -0.4])
    with pytest.raises(LogError, match=r"row 2, column 'right': -40 is beyond -1\.\.1"):
        dataset_from_csv([write(tmp_path, rows)], column_map(tmp_path, text.replace("'%'", "'1'")), 0.2)


def test_a_compass_that_the_motors_pull_aside_turns_no_speed_into_sway(tmp_path: Path) -> None:
    # Two knots straight ahead; for six seconds the compass is 0.2 rad off, and the file's u and v were turned by it.
    rows = []
    for k in range(ROWS):
        off = 0.2 if 200 <= k < 260 else 0.0
        rows.append([str(100 * k), f"{2 * math.cos(off)}", f"{200 * math.sin(off)}", "0", f"{math.degrees(off)}"])
        rows[-1] += ["1700", "1610"]
    path = write(tmp_path, rows)
    [plain] = dataset_from_csv([path], column_map(tmp_path), 0.2).segments
    text = MAP.replace("{column: yaw, unit: deg}", "{column: yaw, unit: deg, settle_s: 60}")
    [settled] = dataset_from_csv([path], column_map(tmp_path, text), 0.2).segments
    assert np.abs(plain.nu[:, 1]).max() == pytest.approx(2.0 * math.sin(0.2))
    assert np.abs(settled.nu[:, 1]).max() < 2.0 * 0.2 * 6.0 / 60.0 and np.abs(settled.nu[:, 0] - 2.0).max() < 1e-3
    assert np.abs(settled.psi).max() < 0.2 * 6.0 / 60.0


def test_a_settled_heading_follows_a_turn_and_starts_anew_after_a_gap(tmp_path: Path) -> None:
    text = MAP.replace("{column: yaw, unit: deg}", "{column: yaw, unit: deg, settle_s: 60}")
    rows = [row(k) for k in range(ROWS)]
    [plain] = dataset_from_csv([write(tmp_path, rows)], column_map(tmp_path), 0.2).segments
    [settled] = dataset_from_csv([write(tmp_path, rows)], column_map(tmp_path, text), 0.2).segments
    assert np.allclose(settled.nu, plain.nu, atol=1e-5) and np.allclose(settled.psi, plain.psi, atol=1e-5)
    for k in range(200, ROWS):  # the boat was turned by hand while nothing was recorded
        rows[k][0] = str(25000 + 100 * k)
        rows[k][4] = f"{(float(rows[k][4]) + 90.0) % 360.0:.6f}"
    parts = dataset_from_csv([write(tmp_path, rows)], column_map(tmp_path, text), 0.2).segments
    assert [np.abs(part.nu[:, 1] - 0.2).max() < 1e-3 for part in parts] == [True, True]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            MAP.replace("unit: deg}\nport", "unit: deg, settle_s: 0}\nport"),
            "key psi.settle_s: a number of 1 or more is expected",
        ),
        (MAP.replace("unit: cm/s", "unit: furlong"), "key v.unit: 'm/s'"),
        (MAP.replace("surge", "surge, colour: red"), "key u.colour: unknown key"),
        (MAP.replace("r: {column: yaw_rate, unit: deg/s}\n", ""), "key r: this key is required"),
        (MAP.replace("ahead_us: 1900}", "ahead_us: 1400}"), r"key port: astern_us < neutral_us < ahead_us must hold"),
        (MAP.replace(", astern_us: 1100, neutral_us: 1500, ahead_us: 1900", ""), "key port: unit us needs"),
        (MAP + "wind_u: {column: a, unit: m/s}", "wind_u and wind_v go together"),
        (MAP.replace("column: right", "column: left"), "port and starboard are both column 'left': each quantity has"),
        ("- 1", "a mapping of quantities to columns is expected"),
        ("u: [", "not valid YAML"),
    ],
)
def test_broken_column_maps(tmp_path: Path, text: str, words: str) -> None:
    path = column_map(tmp_path, text)
    with pytest.raises(ConfigError, match=f"^{path}: {words}"):
        dataset_from_csv([write(tmp_path)], path, 0.2)


def test_the_map_in_the_docs_is_a_good_one(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "models.md").read_text()
    lines = text.partition("```yaml\n")[2].partition("```")[0]
    columns = load_columns(column_map(tmp_path, lines))
    assert columns.psi is not None and columns.wind_from is not None and columns.port.neutral_us == 1500.0


def test_the_shipped_map_reads_a_boat_with_its_motors_the_other_way_round(tmp_path: Path) -> None:
    columns = ",original_timestamp,yaw,surge,sway,yaw_rate,thr_left,thr_right"
    turn = math.degrees(0.002)
    lines = [f"{k},{1444243.083 + 100 * k:.3f},{74 + turn * k},1.5,0.1,0.02,1100,1510" for k in range(400)]
    path = tmp_path / "fixed_00000001.csv"
    path.write_text("\n".join([columns, *lines]))
    [segment] = dataset_from_csv([path], find_columns("blueboat"), 0.2).segments
    assert np.allclose(segment.command, [0.0, 1.0])  # thr_left is the starboard motor, and ahead at 1100 us
    assert np.allclose(segment.nu, [1.5, 0.1, 0.02])
    with pytest.raises(ConfigError, match="no such column map"):
        find_columns("rowboat")
