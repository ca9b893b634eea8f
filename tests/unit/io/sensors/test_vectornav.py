"""VectorNav's protocol by literal bytes: the manual's examples, recorded sentences, and messages laid out by hand."""

import math
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asvhil.io.sensors.vectornav import binary, sentences
from asvhil.io.sensors.vectornav.codec import VectorNavCodec, sample_of
from asvhil.io.sensors.vectornav.fields import BY_NAME, GROUPS
from asvhil.types import Frame, GroundVelocity, Heading, Measurement, Position, SpecificForce, YawRate
from tests.support.nmea import sentence

# The example of the user manuals: group 1, yaw-pitch-roll alone.
MANUAL_YPR = bytes.fromhex("FA 01 0800 93502E42 833EF13F 48B504BB 9288")

# The sizes of the ICD, by group and bit; 0: no such field. SatInfo (bit 14) and RawMeas (bit 16) vary.
ICD_SIZES = [
    [8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8],
    [8, 8, 8, 2, 8, 8, 8, 4, 4, 1],
    [2, 12, 12, 12, 4, 4, 16, 12, 12, 12, 12, 2, 40],
    [8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 2, 28, -1, 0, -1, 2, 8],
    [2, 12, 16, 36, 12, 12, 12, 12, 12, 12, 28, 24, 12, 4],
    [2, 24, 24, 12, 12, 12, 12, 12, 12, 4, 4, 68, 64],
    [8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 2, 28, -1, 0, -1, 2, 8],
]


def ccitt(data: bytes) -> int:
    """CRC-16 CCITT from zero, bit by bit: the definition, not the library."""
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = crc << 1 ^ (0x1021 if crc & 0x8000 else 0)
        crc &= 0xFFFF
    return crc


def message(header: str, payload: bytes) -> bytes:
    """A message from its header in hexadecimal and its payload."""
    body = bytes.fromhex(header) + payload
    return b"\xfa" + body + struct.pack(">H", ccitt(body))


def ins_message(status: int = 0x0306, lat_deg: float = 40.4237, yaw_deg: float = -170.25) -> bytes:
    """TimeStartup, TimeGps, YawPitchRoll, AngularRate, PosLla, VelNed, Accel, InsStatus (group 1), YprU, PosU, VelU."""
    common = struct.pack("<QQ3f3f", 5_000_000_000, 1_450_000_000_000_000_000, yaw_deg, 1.0, -2.0, 0.01, 0.02, 0.125)
    common += struct.pack("<3d3f3fH", lat_deg, -86.9212, 180.0, 0.5, -0.25, 0.1, 0.75, -0.5, -9.8125, status)
    return message("31 EB11 0001 0006", common + struct.pack("<3f", 0.5, 0.1, 0.1) + struct.pack("<2f", 1.5, 0.05))


def feed(codec: VectorNavCodec, data: bytes, t_ns: int = 7) -> list[tuple[str, Measurement]]:
    return codec.decode(Frame(t_ns=t_ns, port="ins", data=data))


def count(codec: VectorNavCodec, name: str) -> int:
    return dict(codec.counters())[f"ins.{name}"]


# --- binary messages -------------------------------------------------------------------------------------------


def test_the_example_of_the_manual() -> None:
    codec = VectorNavCodec("ins")
    ((source, heading),) = feed(codec, MANUAL_YPR)
    assert source == "BINARY" and isinstance(heading, Heading)
    assert math.degrees(heading.psi_rad) == pytest.approx(43.578686)
    sample = sample_of(binary.decode(MANUAL_YPR))
    assert sample.ypr_deg == pytest.approx((43.578686, 1.8847202, -0.0020249654))
    assert ccitt(MANUAL_YPR[1:]) == 0


def test_the_sizes_of_all_fields_are_those_of_the_icd() -> None:
    for group, sizes in enumerate(ICD_SIZES):
        ours = {bit: field.size if field.form else -1 for bit, field in GROUPS[group].items()}
        assert ours == {bit: size for bit, size in enumerate(sizes) if size}


def test_every_part_of_an_ins_message_becomes_a_measurement() -> None:
    found = feed(VectorNavCodec("ins"), ins_message())
    assert found == [
        ("BINARY", Position(t_ns=7, lat_deg=40.4237, lon_deg=-86.9212, h_acc_m=1.5)),
        ("BINARY", GroundVelocity(t_ns=7, vn_mps=0.5, ve_mps=-0.25)),
        ("BINARY", Heading(t_ns=7, psi_rad=math.radians(-170.25))),
        ("BINARY", YawRate(t_ns=7, r_radps=0.125)),
        (
            "BINARY",
            SpecificForce(t_ns=7, ax_mps2=pytest.approx(0.579, abs=1e-3), ay_mps2=pytest.approx(-0.842, abs=1e-3)),
        ),
    ]  # of 0.75, -0.5, -9.81 with the bow up by 1 degree and starboard up by 2


def test_the_typed_sample_has_status_rates_and_uncertainty() -> None:
    sample = sample_of(binary.decode(ins_message()))
    assert sample.status == 0x0306 and sample.position_u_m == pytest.approx(1.5)
    assert sample.rate_radps == pytest.approx((0.01, 0.02, 0.125))


def test_the_same_quantities_are_found_in_the_groups_of_their_own() -> None:
    imu = struct.pack("<3f3f", 0.25, 0.5, -9.5, 0.0, 0.0, -0.5)
    attitude = struct.pack("<3f", 90.0, 0.0, 0.0)
    ins = struct.pack("<H3d3f", 0x0006, -33.5, 151.25, 10.0, -1.0, 2.0, 0.0)
    found = [m for _, m in feed(VectorNavCodec("ins"), message("34 0006 0200 1300", imu + attitude + ins))]
    place, *rest = found
    assert isinstance(place, Position) and (place.lat_deg, place.lon_deg) == (-33.5, 151.25)
    assert math.isnan(place.h_acc_m)
    assert rest == [
        GroundVelocity(t_ns=7, vn_mps=-1.0, ve_mps=2.0),
        Heading(t_ns=7, psi_rad=math.pi / 2),
        YawRate(t_ns=7, r_radps=-0.5),
        SpecificForce(t_ns=7, ax_mps2=0.25, ay_mps2=0.5),
    ]


def test_rates_without_attitude_are_a_yaw_rate_without_heading() -> None:
    ((_, rate),) = feed(VectorNavCodec("ins"), message("01 2000", struct.pack("<3f", 0.0, 0.0, 0.25)))
    assert rate == YawRate(t_ns=7, r_radps=0.25)


@pytest.mark.parametrize(
    ("fix", "gives"), [(0, False), (1, False), (2, True), (3, True), (4, True), (8, True), (10, False), (255, False)]
)
def test_the_receiver_alone_is_a_source_of_its_own(fix: int, gives: bool) -> None:
    payload = struct.pack("<B3d3f3f", fix, 1.5, 2.5, 0.0, 0.5, 0.25, 0.0, 3.0, 4.0, 9.0)
    codec = VectorNavCodec("ins")
    found = feed(codec, message("08 B002", payload))
    assert bool(found) is gives and count(codec, "invalid") == (not gives)
    if gives:
        assert found == [
            ("GNSS1", Position(t_ns=7, lat_deg=1.5, lon_deg=2.5, h_acc_m=5.0)),
            ("GNSS1", GroundVelocity(t_ns=7, vn_mps=0.5, ve_mps=0.25)),
        ]


FIX: set[type] = {Position, GroundVelocity}
INERTIAL: set[type] = {YawRate, SpecificForce}


@pytest.mark.parametrize(
    ("status", "kinds"),
    [
        (0x0000, INERTIAL),  # not tracking
        (0x0004, INERTIAL),  # GNSS is there, the filter is not
        (0x0005, FIX | INERTIAL),  # aligning: the attitude is not within specification
        (0x0006, FIX | {Heading} | INERTIAL),  # tracking
        (0x8206, FIX | {Heading} | INERTIAL),  # reserved bits mean nothing
        (0x0002, {Heading} | INERTIAL),  # tracking, no satellites
        (0x0003, {Heading} | INERTIAL),  # satellites lost for long: position is frozen, attitude goes on
        (0x0007, {Heading} | INERTIAL),
        (0x0016, FIX | {Heading}),  # IMU error
        (0x0046, {Heading} | INERTIAL),  # GNSS error
    ],
)
def test_only_what_the_status_stands_by_is_taken(status: int, kinds: set[type]) -> None:
    assert {type(m) for _, m in feed(VectorNavCodec("ins"), ins_message(status))} == kinds


@pytest.mark.parametrize("lat_deg", [math.nan, math.inf, 90.5, -91.0])
def test_a_place_that_is_none_is_dropped_and_the_rest_kept(lat_deg: float) -> None:
    codec = VectorNavCodec("ins")
    assert [type(m) for _, m in feed(codec, ins_message(lat_deg=lat_deg))] == [Heading, YawRate, SpecificForce]
    assert count(codec, "invalid") == 1


@pytest.mark.parametrize(("north", "status", "gives"), [(0.5, 6, True), (math.nan, 6, False), (0.5, 7, False)])
def test_a_velocity_without_a_position_is_a_velocity(north: float, status: int, gives: bool) -> None:
    """VelNed and InsStatus alone, as of a sensor whose position comes from elsewhere."""
    codec = VectorNavCodec("ins")
    found = feed(codec, message("01 8010", struct.pack("<3fH", north, -0.25, 0.1, status)))
    assert bool(found) is gives and count(codec, "invalid") == (not gives)
    for _, velocity in found:
        assert velocity == GroundVelocity(t_ns=7, vn_mps=0.5, ve_mps=-0.25)


def test_zeros_are_no_place() -> None:
    codec = VectorNavCodec("ins")
    assert feed(codec, message("01 4000", struct.pack("<3d", 0.0, 0.0, 0.0))) == []
    assert count(codec, "invalid") == 1


def test_a_heading_that_is_no_number_leaves_the_rate() -> None:
    found = [m for _, m in feed(VectorNavCodec("ins"), ins_message(yaw_deg=math.nan))]
    assert YawRate(t_ns=7, r_radps=0.125) in found and not any(isinstance(m, Heading) for m in found)


def test_satellites_and_raw_measurements_have_as_many_bytes_as_they_say() -> None:
    satellites = bytes([3, 0]) + bytes(range(24))
    raw = struct.pack("<dHBB", 1.0, 2300, 2, 0) + bytes(56)
    payload = b"\x09" + satellites + raw + struct.pack("<Hd", 0x17, 12.5)
    data = message("08 08C0 0700", payload)  # NumSats, SatInfo, extension; RawMeas, Status, AltMsl
    assert binary.measure(data, 0) == len(data) == 1 + 5 + 1 + 26 + 68 + 10 + 2
    assert binary.decode(data) == {
        "Gnss1.NumSats": (9,),
        "Gnss1.SatInfo": satellites,
        "Gnss1.RawMeas": raw,
        "Gnss1.Status": (0x17,),
        "Gnss1.AltMsl": (12.5,),
    }
    assert binary.encode(binary.decode(data)) == data
    for end in range(len(data)):
        assert binary.measure(data[:end], 0) in (binary.INCOMPLETE, len(data))
    assert binary.measure(data[:7] + b"\x24" + data[8:], 0) == binary.IMPOSSIBLE  # 36 satellites: one too many


@pytest.mark.parametrize(
    "header",
    [
        "00",  # no group
        "81 0800",  # a group beyond the seventh
        "01 0080",  # a field beyond the fifteenth of a group that has no more
        "02 0004",  # a bit without a field
        "01 0000",  # a group without a field
        "08 0080 0000",  # an extension without a field
        "08 0080 0080",  # and one more
        "08 0080 0800",  # bit 19
        "7F FF7F FF03 FF1F FFFF 0700 FF3F FF1F FFFF 0700",  # everything, with as many satellites as there may be
    ],
)
def test_what_no_message_begins_with(header: str) -> None:
    data = b"\xfa" + bytes.fromhex(header) + b"\x1e" * 5000
    assert binary.measure(data, 0) == binary.IMPOSSIBLE


NAMES = sorted(name for name, field in BY_NAME.items() if field.form)


@settings(max_examples=150, deadline=None)
@given(st.sets(st.sampled_from(NAMES), min_size=1), st.randoms(use_true_random=False))
def test_any_mix_of_fields_is_measured_and_read_back(names: set[str], noise) -> None:  # type: ignore[no-untyped-def]
    values = {}
    for name in names:
        field = BY_NAME[name]
        values[name] = struct.unpack(field.form, bytes(noise.randrange(128) for _ in range(field.size)))
    data = binary.encode(values)
    assert ccitt(data[1:]) == 0
    size = sum(BY_NAME[name].size for name in names)
    header = 1 + bin(data[1]).count("1") * 2
    extended = sum({"Status", "AltMsl"} & {n.split(".")[1] for n in names if n.startswith(g)} != set() for g in _GNSS)
    assert len(data) == 1 + header + 2 * extended + size + 2 == binary.measure(data, 0)
    again = binary.decode(data)
    assert set(again) == names
    for name in names:  # bit patterns, because some of them are no numbers
        form = BY_NAME[name].form
        assert struct.pack(form, *again[name]) == struct.pack(form, *values[name])


_GNSS = ("Gnss1.", "Gnss2.")


# --- the stream ------------------------------------------------------------------------------------------------


VNINS = (
    b"$VNINS,125176.941097,2332,8206,+082.014,+000.014,+001.063,+51.51992529,-000.11006359,+00089.216,"
    b"-000.001,-000.008,-000.125,03.9,01.2,0.10*65\r\n"
)


def test_split_at_every_byte_and_merged_gives_the_same() -> None:
    data = ins_message() + VNINS + MANUAL_YPR
    whole = feed(VectorNavCodec("ins"), data)
    assert len(whole) == 5 + 3 + 1
    for cut in range(len(data) + 1):
        codec = VectorNavCodec("ins")
        assert str(feed(codec, data[:cut]) + feed(codec, data[cut:])) == str(whole)
        assert count(codec, "garbage_bytes") == 0
    codec = VectorNavCodec("ins")
    assert str([pair for i in range(len(data)) for pair in feed(codec, data[i : i + 1])]) == str(whole)


def test_every_wrong_bit_is_found_and_the_next_message_read() -> None:
    good = ins_message()
    for at in range(len(good)):
        for bit in range(8):
            data = bytearray(good)
            data[at] ^= 1 << bit
            codec = VectorNavCodec("ins")
            # Enough behind it to end the longest message that the damaged header can ask for.
            found = feed(codec, bytes(data) + good * 20)
            assert str(found[-5:]) == str(feed(VectorNavCodec("ins"), good)), (at, bit)
            assert count(codec, "packets") <= 20, (at, bit)


def test_a_damaged_message_is_counted() -> None:
    codec = VectorNavCodec("ins")
    data = bytearray(ins_message())
    data[40] ^= 0x10
    feed(codec, bytes(data))
    assert count(codec, "bad_crc") >= 1 and count(codec, "packets") == 0
    assert count(codec, "garbage_bytes") + len(codec._buffer) == len(data)


def test_garbage_between_messages_costs_itself_alone() -> None:
    codec = VectorNavCodec("ins")
    assert len(feed(codec, b"\x00\xff noise \xfa\x00" + MANUAL_YPR + b"$VNINS,1*ZZ\r\n" + b"$\x80" + MANUAL_YPR)) == 2
    assert count(codec, "packets") == 2 and count(codec, "bad_crc") == 1
    assert count(codec, "garbage_bytes") == 11 + 11 + 2  # line ends are none


def test_a_sentence_without_end_does_not_hold_up_the_line() -> None:
    codec = VectorNavCodec("ins")
    assert feed(codec, b"$" + b"A" * 255) == []
    assert len(codec._buffer) == 0
    assert len(feed(codec, MANUAL_YPR)) == 1


# --- sentences -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "line",
    [
        VNINS.replace(b"\r\n", b"\n"),
        VNINS.replace(b"\r\n", b"\r"),
        VNINS.replace(b"\r\n", b" \r\n"),
        VNINS.replace(b"*", b" *"),
        sentence(VNINS[1:-5].decode().replace(",+", ", +")),
        sentence(VNINS[1:-5].decode() + ","),
        sentence(VNINS[1:-5].decode().replace("8206", "0X8206")),
        b"\n\r\n" + VNINS,
    ],
)
def test_an_ins_sentence_as_bridges_and_loggers_leave_it(line: bytes) -> None:
    codec = VectorNavCodec("ins")
    whole = feed(VectorNavCodec("ins"), VNINS)
    assert feed(codec, line) + feed(codec, line) == whole * 2 and count(codec, "garbage_bytes") == 0
    for cut in range(len(line)):
        codec = VectorNavCodec("ins")
        assert feed(codec, line[:cut]) + feed(codec, line[cut:]) == whole


@pytest.mark.parametrize(
    ("good", "bad", "left"),
    [
        ("+082.014", "+782.014", 2),
        ("-000.001", "-900.001", 2),
        ("+51.51992529", "+95.51992529", 1),
    ],
)
def test_what_no_ins_can_mean_is_counted_and_the_rest_is_taken(good: str, bad: str, left: int) -> None:
    codec = VectorNavCodec("ins")
    assert len(feed(codec, sentence(VNINS[1:-5].decode().replace(good, bad)))) == left
    assert count(codec, "out_of_range") + count(codec, "invalid") == 1
    codec = VectorNavCodec("ins")
    ((_, rate),) = feed(codec, message("01 2001", struct.pack("<3f3f", 0.0, 0.0, 0.25, 900.0, 0.0, 0.0)))
    assert isinstance(rate, YawRate) and count(codec, "out_of_range") == 1
    assert feed(codec, message("01 2000", struct.pack("<3f", 0.0, 0.0, 99.0))) == []
    assert feed(codec, message("01 0800", struct.pack("<3f", -400.0, 0.0, 0.0))) == []
    assert count(codec, "out_of_range") == 3


def test_a_recorded_ins_sentence() -> None:
    place, velocity, heading = (m for source, m in feed(VectorNavCodec("ins"), VNINS) if source == "VNINS")
    assert place == Position(t_ns=7, lat_deg=51.51992529, lon_deg=-0.11006359, h_acc_m=1.2)
    assert velocity == GroundVelocity(t_ns=7, vn_mps=-0.001, ve_mps=-0.008)
    assert isinstance(heading, Heading) and math.degrees(heading.psi_rad) == pytest.approx(82.014)


def test_the_register_read_back_is_the_same_as_the_sentence() -> None:
    line = (  # the example of the manual; mode 0: only the satellites are there
        b"$VNRRG,63,333811.902862,1694,0004,+009.500,-004.754,-000.225,+32.95602815,-096.71424297,"
        b"+00171.195,-000.840,-000.396,-000.109,07.8,01.6,0.23*5F\r\n"
    )
    codec = VectorNavCodec("ins")
    assert feed(codec, line) == [] and count(codec, "invalid") == 2
    parts = sentences.split(line)
    assert parts is not None
    solution = sentences.ins_solution(parts)
    assert solution is not None and solution.lla == (32.95602815, -96.71424297, 171.195)
    assert solution.status == 4 and solution.ypr_deg == (9.5, -4.754, -0.225)
    assert solution.velocity_mps == (-0.84, -0.396, -0.109) and solution.position_u_m == 1.6


def test_sixteen_bit_checksums() -> None:
    assert sentences.split(b"$VNWRG,75,3,16,01,0721*D415\r\n") == ["VNWRG", "75", "3", "16", "01", "0721"]
    crc = b"%04X" % ccitt(VNINS[1 : VNINS.index(b"*")])
    line = VNINS[: VNINS.index(b"*") + 1] + crc + b"\r\n"
    assert str(feed(VectorNavCodec("ins"), line)) == str(feed(VectorNavCodec("ins"), VNINS))
    assert feed(VectorNavCodec("ins"), line.replace(crc, b"%04X" % (int(crc, 16) ^ 1))) == []


def test_rates_and_force_in_ascii() -> None:
    line = (
        b"$VNYMR,+100.949,-007.330,+000.715,-00.0049,-00.2449,+00.5397,-01.258,-00.100,-09.701,"
        b"-00.000018,+00.001122,-00.000551*69\r\n"
    )
    (name, rate), (same, force) = feed(VectorNavCodec("ins"), line)
    assert name == same == "VNYMR" and rate == YawRate(t_ns=7, r_radps=-0.000551)
    # It was recorded at rest, with the bow down by 7.3 degrees, and shows 1.26 m/s^2 of gravity.
    assert isinstance(force, SpecificForce)
    assert (force.ax_mps2, force.ay_mps2) == pytest.approx((0.0, 0.0), abs=0.03)


@pytest.mark.parametrize(
    ("line", "counter"),
    [
        (VNINS.replace(b"*65", b"*66"), "bad_crc"),
        (VNINS.replace(b"*65", b"*XX"), "bad_crc"),  # what a person may type is no checksum
        (VNINS.replace(b"*65", b""), "bad_crc"),
        (VNINS.replace(b"+082", b"+083"), "bad_crc"),
        (b"$VNERR,03*72\r\n", "errors"),
        (sentence("VNRRG,01,VN-300"), "ignored"),
        (sentence("VNINS,1,2,3"), "malformed"),
        (sentence("VNINS,x,2332,8206,1,2,3,4,5,6,7,8,9,1,2,3"), "malformed"),
        (sentence("VNINS,1,2332,8206,nan,2,3,4,5,6,7,8,9,1,2,3"), "malformed"),
        (sentence("VNYMR,1,2,3,4,5,6,7,8,9,inf,1,2"), "malformed"),
        (sentence("VNRRG,63"), "malformed"),
        (sentence("VNRRG"), "ignored"),
    ],
)
def test_sentences_that_give_nothing_are_counted(line: bytes, counter: str) -> None:
    codec = VectorNavCodec("ins")
    assert feed(codec, line) == [] and count(codec, counter) == 1
    assert len(feed(codec, MANUAL_YPR)) == 1
