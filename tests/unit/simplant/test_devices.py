"""The simulated VN-300 and NMEA receiver: what they send is the truth, at its rate, with errors of their own."""

import math
from collections import Counter

import pynmeagps
import pytest

from asvhil.config import Config, load_config
from asvhil.geo import wrap_rad
from asvhil.io.sensors.nmea import NmeaCodec
from asvhil.io.sensors.nmea_sentences import EVERYTHING
from asvhil.io.sensors.vectornav import binary
from asvhil.io.sensors.vectornav.codec import VectorNavCodec
from asvhil.simplant.lockstep import Lockstep
from asvhil.simplant.plant import Plant
from asvhil.types import (
    Frame,
    GroundVelocity,
    Heading,
    Measurement,
    Phase,
    Position,
    SpecificForce,
    YawRate,
)

LINKS = (
    "links.ins.endpoint=serial:ins:115200",
    "links.gnss.endpoint=serial:gnss:115200",
)
EXACT = (
    "plant.sensors.gnss.slow_bias_m=0",
    "plant.sensors.gnss.white_m=0",
    "plant.sensors.gnss.velocity_white_mps=0",
    "plant.sensors.heading.white_deg=0",
    "plant.sensors.imu.gyro_white_radps=0",
    "plant.sensors.imu.accel_white_mps2=0",
    "plant.sensors.imu.accel_bias_mps2=0",
)


def plant(*overrides: str) -> Plant:
    return Plant(load_config("sitl", (*LINKS, *overrides)), 0)


def frames(boat: Plant, seconds: float, port: str) -> list[Frame]:
    return [frame for frame in boat.advance(round(seconds * 1e9)) if frame.port == port]


def test_the_vn300_measures_the_true_state_at_its_rate() -> None:
    boat = plant(*EXACT, "plant.weather.wind.speed_mps=8", "plant.weather.current={speed_mps: 0.5, toward_deg: 90}")
    codec = VectorNavCodec("ins")
    sent = frames(boat, 30.0, "ins")
    assert len(sent) == 600 and sent[-1].t_ns == 30_000_000_000
    found = [m for frame in sent for _, m in codec.decode(frame)]
    truth = boat.truth
    fix, velocity, heading, rate, force = found[-5:]
    assert isinstance(fix, Position) and isinstance(velocity, GroundVelocity)
    assert isinstance(heading, Heading) and isinstance(rate, YawRate) and isinstance(force, SpecificForce)
    assert boat.origin.to_ned(fix.lat_deg, fix.lon_deg) == pytest.approx((truth.n_m, truth.e_m), abs=1e-6)
    c, s = math.cos(truth.psi_rad), math.sin(truth.psi_rad)
    ground = c * truth.u_mps - s * truth.v_mps, s * truth.u_mps + c * truth.v_mps
    assert (velocity.vn_mps, velocity.ve_mps) == pytest.approx(ground, abs=1e-6) and math.hypot(*ground) > 0.3
    assert heading.psi_rad == pytest.approx(truth.psi_rad, abs=1e-6)
    assert rate.r_radps == pytest.approx(truth.r_radps, abs=1e-6)
    values = binary.decode(sent[-1].data)
    assert values["Common.TimeStartup"] == (30_000_000_000,)
    # 2026-01-01 00:00:30 UTC in GPS time: (20454 - 3657) days since 1980-01-06, and 18 leap seconds.
    assert values["Common.TimeGps"] == (((20454 - 3657) * 86400 + 30 + 18) * 1_000_000_000,)


def test_the_vn300_says_nothing_of_position_and_heading_until_it_is_aligned() -> None:
    codec = VectorNavCodec("ins")
    boat = plant("plant.sensors.ins.align_s=2")
    kinds = [(f.t_ns, type(m)) for f in frames(boat, 3.0, "ins") for _, m in codec.decode(f)]
    assert min(t_ns for t_ns, kind in kinds if kind is Position) == 2_000_000_000
    assert min(t_ns for t_ns, kind in kinds if kind is SpecificForce) == 50_000_000


def test_the_vn300_without_satellites_keeps_its_heading() -> None:
    boat = plant("plant.faults=[{kind: ins-gnss, from_s: 5, until_s: 8}, {kind: ins, from_s: 10, until_s: 11}]")
    codec = VectorNavCodec("ins")
    seen: Counter[tuple[int, type]] = Counter()
    for frame in frames(boat, 12.0, "ins"):
        seen.update((frame.t_ns // 1_000_000_000, type(m)) for _, m in codec.decode(frame))
    fixes = {second: seen[second, Position] for second in range(2, 12)}
    assert fixes == {2: 20, 3: 20, 4: 20, 5: 0, 6: 0, 7: 0, 8: 20, 9: 20, 10: 0, 11: 20}
    assert seen[6, Heading] == 20 and seen[10, Heading] == 0


KINDS = {Position: "fix", GroundVelocity: "velocity", Heading: "heading", YawRate: "rate", SpecificForce: "force"}


def readings(fault: str, port: str, from_s: float, to_s: float) -> dict[str, list[Measurement]]:
    """What the codec of a port makes of what is sent in a span, by kind, with a fault from 5 to 8 s."""
    text = f"plant.faults=[{{from_s: 5, until_s: 8, {fault}}}]"
    boat = plant(*EXACT, text, "plant.weather.wind.speed_mps=8")
    codec = VectorNavCodec("ins") if port == "ins" else NmeaCodec("gnss", EVERYTHING)
    found: dict[str, list[Measurement]] = {name: [] for name in KINDS.values()}
    for frame in frames(boat, to_s, port):
        for _, m in codec.decode(frame):
            if frame.t_ns > from_s * 1e9:
                found[KINDS[type(m)]].append(m)
    codec_counts = dict(codec.counters())
    assert codec_counts.get("ins.bad_crc", 0) == codec_counts.get("gnss.bad", 0) == 0
    return found


@pytest.mark.parametrize("port", ["ins", "gnss"])
@pytest.mark.parametrize(
    ("fault", "missing"),
    [
        ("kind: gnss-silent", {"fix", "velocity"}),
        ("kind: heading-silent", {"heading"}),
        ("kind: imu-silent", {"rate", "force"}),
        ("kind: gnss-silent, device: autopilot", set()),
        ("kind: vane", set()),
    ],
)
def test_what_a_silent_sensor_leaves_out(port: str, fault: str, missing: set[str]) -> None:
    has = {"fix", "velocity", "heading"} | ({"rate", "force"} if port == "ins" else set())
    during = readings(fault, port, 5.1, 7.9)
    assert {name for name, list_ in during.items() if list_} == has - missing
    after = readings(fault, port, 8.1, 9.0)
    assert {name for name, list_ in after.items() if list_} == has


@pytest.mark.parametrize("port", ["ins", "gnss"])
def test_a_jump_of_position_leaves_the_velocity_and_is_over_with_the_fault(port: str) -> None:
    def place(fault: str, from_s: float, to_s: float) -> tuple[float, float, float]:
        found = readings(fault, port, from_s, to_s)
        fix = found["fix"][-1]
        assert isinstance(fix, Position)
        velocity = found["velocity"][-1]
        assert isinstance(velocity, GroundVelocity)
        boat = Plant(load_config("sitl"), 0)
        return (*boat.origin.to_ned(fix.lat_deg, fix.lon_deg), velocity.vn_mps)

    jump, none = "kind: gnss-jump, size: 20, toward_deg: 90", "kind: vane"
    during, sound = place(jump, 6.0, 7.0), place(none, 6.0, 7.0)
    assert (during[0] - sound[0], during[1] - sound[1], during[2] - sound[2]) == pytest.approx((0, 20, 0), abs=0.03)
    assert place(jump, 8.3, 9.0) == place(none, 8.3, 9.0)


@pytest.mark.parametrize("port", ["ins", "gnss"])
def test_a_frozen_receiver_repeats_itself_and_a_heading_jumps(port: str) -> None:
    frozen = readings("kind: gnss-frozen", port, 5.3, 7.9)
    assert len({(m.lat_deg, m.lon_deg) for m in frozen["fix"]}) == 1 and len(frozen["fix"]) > 10
    assert len({m.vn_mps for m in frozen["velocity"]}) == 1
    moving = readings("kind: vane", port, 5.3, 7.9)["fix"]
    assert len({m.lat_deg for m in moving}) > 5
    turned = readings("kind: heading-jump, size: -60", port, 5.1, 7.9)["heading"]
    sound = readings("kind: vane", port, 5.1, 7.9)["heading"]
    offs = [math.degrees(wrap_rad(a.psi_rad - b.psi_rad)) for a, b in zip(turned, sound, strict=True)]
    assert offs == pytest.approx([-60.0] * len(offs), abs=0.11)


def test_the_bream_set_gives_raw_readings_to_the_estimator() -> None:
    """A GNSS and a compass on the NMEA line, gyro and accelerometer of the autopilot; none of its own estimates."""
    settings = load_config("sitl-bream")
    loop = Lockstep(settings)
    for _ in range(20 * 20):
        _, outputs = loop.tick()
    sources = dict(outputs.health.sources)
    names = ["gnss.RMC", "gnss.RMC", "gnss.HDG", "autopilot.RAW_IMU", "autopilot.RAW_IMU", "anemometer.MWV"]
    assert [sources[q] for q in ("position", "velocity", "heading", "yaw_rate", "acceleration", "wind")] == names
    assert outputs.phase is Phase.HOLD
    wrong = [3.0 + 4.0 * math.sin(p) + 3.5 * math.cos(p) + math.sin(2 * p) + 0.5 * math.cos(2 * p) for p in ANGLES]
    assert 5.0 < max(wrong) < 10.0 and min(wrong) < 0.0
    seen = {p: reading_of_compass(settings, p) for p in (0.0, 1.0, 3.0)}
    for p, psi_rad in seen.items():
        bias_deg = 3.0 + 4.0 * math.sin(p) + 3.5 * math.cos(p) + math.sin(2 * p) + 0.5 * math.cos(2 * p)
        assert math.degrees(wrap_rad(psi_rad - p)) == pytest.approx(bias_deg, abs=1.5)


ANGLES = [math.radians(degree) for degree in range(360)]


def reading_of_compass(settings: Config, psi_rad: float) -> float:
    """Mean of the headings over 12 s of a boat that does not turn: 4 degrees / sqrt(120) are 0.4."""
    tree = settings.model_dump(mode="json")
    tree["plant"]["start_heading_deg"] = math.degrees(psi_rad)
    tree["plant"]["weather"]["wind"]["speed_mps"] = 0.0
    codec = NmeaCodec("gnss", {"HDG"})
    found = [m for f in Plant(Config.model_validate(tree), 0).advance(12_000_000_000) for _, m in codec.decode(f)]
    assert len(found) == 120
    return math.atan2(sum(math.sin(m.psi_rad) for m in found), sum(math.cos(m.psi_rad) for m in found))


def test_the_receiver_and_the_compass_measure_the_true_state() -> None:
    boat = plant(*EXACT, "plant.sensors.nmea.declination_deg=-4.5", "plant.start_heading_deg=2")
    boat_frames = frames(boat, 10.0, "gnss")
    codec = NmeaCodec("gnss", EVERYTHING)
    found = [pair for frame in boat_frames for pair in codec.decode(frame)]
    counts = Counter((source, type(m)) for source, m in found)
    assert counts == {
        ("GGA", Position): 50,
        ("RMC", Position): 50,
        ("RMC", GroundVelocity): 50,
        ("VTG", GroundVelocity): 50,
        ("HDG", Heading): 100,
    }
    assert dict(codec.counters())["gnss.unknown"] == 10  # ZDA: the time
    assert sum(codec.dropped.values()) == 10
    last = {(source, type(m)): m for source, m in found}
    truth = boat.truth
    for name in ("GGA", "RMC"):
        fix = last[name, Position]
        assert boat.origin.to_ned(fix.lat_deg, fix.lon_deg) == pytest.approx((truth.n_m, truth.e_m), abs=0.02)
    heading = last["HDG", Heading]
    # Magnetic on the wire, rounded to a tenth of a degree; true again by the variation that goes with it.
    assert heading.psi_rad % math.tau == pytest.approx(truth.psi_rad % math.tau, abs=math.radians(0.06))
    rmc, vtg = last["RMC", GroundVelocity], last["VTG", GroundVelocity]
    assert (rmc.vn_mps, rmc.ve_mps) == pytest.approx((vtg.vn_mps, vtg.ve_mps), abs=0.001)


def test_every_sentence_reads_alike_in_the_library() -> None:
    boat = plant("plant.sensors.nmea.declination_deg=10")
    lines = b"".join(frame.data for frame in frames(boat, 2.0, "gnss")).splitlines(keepends=True)
    assert len(lines) == 30 + 20 + 2
    for line in lines:
        parsed = pynmeagps.NMEAReader.parse(line)
        if parsed.msgID == "RMC":
            assert (parsed.mv, parsed.mvEW) == (10.0, "E") and parsed.date.year == 2026


def test_devices_have_errors_of_their_own() -> None:
    boat = plant("plant.sensors.ins.gnss={slow_bias_m: 0, white_m: 0}", "plant.sensors.nmea.gnss={slow_bias_m: 30}")
    codec, reader = VectorNavCodec("ins"), NmeaCodec("gnss", {"GGA"})
    sent = boat.advance(20_000_000_000)
    ours = [m for f in sent if f.port == "ins" for _, m in codec.decode(f) if isinstance(m, Position)]
    cheap = [m for f in sent if f.port == "gnss" for _, m in reader.decode(f) if isinstance(m, Position)]
    place = boat.truth.n_m, boat.truth.e_m
    assert boat.origin.to_ned(ours[-1].lat_deg, ours[-1].lon_deg) == pytest.approx(place, abs=0.01)
    assert math.dist(boat.origin.to_ned(cheap[-1].lat_deg, cheap[-1].lon_deg), place) > 2.0


def test_a_device_more_changes_nothing_of_the_others() -> None:
    alone, more = Plant(load_config("sitl"), 0), plant()
    mine = [frame for frame in alone.advance(10_000_000_000)]
    theirs = [frame for frame in more.advance(10_000_000_000) if frame.port not in ("ins", "gnss")]
    assert mine == theirs and alone.truth == more.truth


def test_the_message_holds_what_the_codec_uses_and_no_more_than_a_line_carries() -> None:
    (frame,) = frames(plant("plant.sensors.ins.rate_hz=1"), 1.0, "ins")
    assert len(frame.data) == binary.measure(frame.data, 0) < 115200 / 10 / 50  # 50 Hz on a slow line
    assert set(binary.decode(frame.data)) >= {"Common.InsStatus", "Attitude.YprU", "Ins.PosU", "Ins.VelU"}


def test_without_the_links_there_are_no_devices() -> None:
    boat = Plant(load_config("sitl"), 0)
    assert {frame.port for frame in boat.advance(2_000_000_000)} == {"autopilot", "anemometer"}
