"""Gravity in the accelerometer, blows that only the gyro shows, and a wind that is nonsense, in the closed loop."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config import load_config
from asvhil.geo import wrap_rad
from asvhil.io.sensors.nmea_checksum import nmea_sentence
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Frame, Outputs
from tests.support.loop import place_error_m

HZ = 20
CALM_RECEIVER = ("plant.sensors.gnss.slow_bias_m=0", "plant.weather.wind.speed_mps=4")
CHOP = ("plant.weather.waves.orbital_std_mps=0.15", "plant.weather.waves.yaw_std_radps=0.04")


class Altered(Lockstep):
    """A loop in which what the sensors send can be changed on its way, and the boat be pushed."""

    def __init__(self, base: str, *overrides: str) -> None:
        super().__init__(load_config(base, overrides))
        self.on_message: Callable[[float, Any], None] | None = None
        self.on_sentence: Callable[[float, bytes], bytes] | None = None
        self._in, self._out = dialect.MAVLink(None), dialect.MAVLink(None, srcSystem=1, srcComponent=1)
        self.off_m = self.off_rad = self.away_m = 0.0
        self.notes: set[str] = set()
        self.without = ""  # a message that is lost

    @property
    def t_s(self) -> float:
        return self.ticks / HZ

    def receive(self) -> tuple[Frame, ...]:
        return tuple(self._altered(frame) for frame in super().receive())

    def _altered(self, frame: Frame) -> Frame:
        if frame.port == "anemometer" and self.on_sentence is not None:
            return Frame(t_ns=frame.t_ns, port=frame.port, data=self.on_sentence(self.t_s, frame.data))
        if frame.port != "autopilot" or self.on_message is None:
            return frame
        data = b""
        for message in self._in.parse_buffer(frame.data) or ():
            if message.get_type() == self.without:
                continue
            self.on_message(self.t_s, message)
            data += bytes(message.pack(self._out))
            self._out.seq = (self._out.seq + 1) % 256
        return Frame(t_ns=frame.t_ns, port=frame.port, data=data, peer=frame.peer)

    def go_on(self, seconds: float) -> Outputs:
        """Runs on, and notes how far the valid estimate is off and the boat away at most, and what is told."""
        for _ in range(round(seconds * HZ)):
            _, outputs = self.tick()
            self.notes |= {f"{note.subject}: {note.text}" for note in outputs.health.notes}
            estimate, truth, off_m = outputs.estimate, self.plant.truth, place_error_m(self, outputs)
            if estimate is None or off_m is None:
                continue
            self.off_m = max(self.off_m, off_m)
            self.off_rad = max(self.off_rad, abs(wrap_rad(estimate.psi_rad - truth.psi_rad)))
            self.away_m = max(self.away_m, math.hypot(truth.n_m, truth.e_m))
        return outputs

    def settle(self, seconds: float) -> None:
        self.go_on(seconds)
        self.off_m = self.off_rad = self.away_m = 0.0
        self.notes.clear()


def told(loop: Altered, subject: str) -> bool:
    return any(note.startswith(subject) for note in loop.notes)


@pytest.mark.parametrize(
    "tilt", [("plant.tilt.thrust_deg=3", "plant.tilt.roll_deg=4"), ("plant.tilt.thrust_deg=3", *CHOP)]
)
def test_a_tilt_that_the_autopilot_tells_is_no_acceleration(tilt: tuple[str, ...]) -> None:
    loop = Altered("sitl", *CALM_RECEIVER, *tilt)
    loop.go_on(50.0)
    assert not told(loop, "accelerometer"), "not while its bias is learnt either"
    loop.settle(0.05)
    assert loop.go_on(60.0).phase == "hold"
    assert loop.off_m < 0.7 and loop.away_m < 0.8
    assert not told(loop, "accelerometer") and not told(loop, "gnss")


def test_a_list_is_known_after_the_attitude_has_fallen_silent() -> None:
    def silent(t_s: float, message: Any) -> None:
        if message.get_type() == "ATTITUDE" and t_s >= 50.0:
            message.roll = message.pitch = math.nan

    loop = Altered("sitl", *CALM_RECEIVER, "plant.tilt.roll_deg=4")
    loop.on_message = silent
    loop.settle(50.0)
    assert loop.go_on(20.0).phase == "hold"
    assert loop.off_m < 0.7 and not told(loop, "accelerometer")


def test_a_sensor_that_is_not_level_in_the_boat_has_a_bias() -> None:
    loop = Altered("sitl", *CALM_RECEIVER, "plant.tilt.imu_roll_deg=3", "plant.tilt.imu_pitch_deg=-2")
    loop.settle(50.0)
    assert loop.go_on(40.0).phase == "hold"
    assert loop.off_m < 0.7 and loop.away_m < 0.8 and not told(loop, "gnss")


@pytest.mark.parametrize("seed", [1, 2])
def test_a_receiver_that_is_late_does_not_have_a_sound_accelerometer_left_out(seed: int) -> None:
    held: list[tuple[int, int]] = []

    def late(t_s: float, message: Any) -> None:
        if message.get_type() == "GPS_RAW_INT":
            held.append((message.vel, message.cog))
            message.vel, message.cog = held[max(len(held) - 2, 0)]

    loop = Altered("sitl", "plant.weather.wind.speed_mps=4", f"plant.seed={seed}")
    loop.on_message = late
    loop.go_on(60.0)
    assert not told(loop, "accelerometer")


def test_an_accelerometer_that_falls_silent_in_doubt_is_told_to_be_silent() -> None:
    loop = Altered("sitl", *CALM_RECEIVER)

    def shifted(t_s: float, message: Any) -> None:
        if message.get_type() == "RAW_IMU" and t_s >= 50.0:
            message.xacc += 100

    loop.on_message = shifted
    loop.settle(53.0)
    loop.go_on(1.0)
    assert told(loop, "accelerometer: left out")
    loop.without = "RAW_IMU"
    loop.settle(2.0)
    loop.go_on(5.0)
    assert told(loop, "accelerometer: silent") and not told(loop, "accelerometer: left out")


def test_one_wild_reading_of_the_gyro_does_not_end_a_hold_without_a_compass() -> None:
    def wild(t_s: float, message: Any) -> None:
        if message.get_type() == "RAW_IMU" and 54.99 <= t_s < 55.04:
            message.zgyro += 3000

    loop = Altered("sitl", *CALM_RECEIVER, "sources.yaw_rate=[autopilot.RAW_IMU]")
    loop.on_message = wild
    loop.settle(50.0)
    loop.without = "ATTITUDE"  # the heading is bridged from now on
    assert loop.go_on(15.0).phase == "hold"


@pytest.mark.parametrize("milli_g", [15, 30, 100])
def test_a_tilt_that_nobody_tells_has_the_accelerometer_left_out(milli_g: int) -> None:
    def shifted(t_s: float, message: Any) -> None:
        if message.get_type() == "RAW_IMU" and t_s >= 50.0:
            message.xacc += milli_g

    loop = Altered("sitl", *CALM_RECEIVER)
    loop.on_message = shifted
    loop.settle(50.0)
    assert loop.go_on(60.0).phase == "hold"
    assert loop.off_m < 1.2 and loop.away_m < 1.6
    assert told(loop, "accelerometer: left out") and not told(loop, "gnss position")
    loop.notes.clear()
    loop.go_on(5.0)
    assert not told(loop, "accelerometer"), "its new bias is known by then"


def test_a_receiver_that_is_off_by_itself_does_not_have_the_accelerometer_left_out() -> None:
    def off(t_s: float, message: Any) -> None:
        if message.get_type() == "GPS_RAW_INT" and 50.0 <= t_s < 60.0:
            message.vel, message.cog = 100, 9000

    loop = Altered("sitl", *CALM_RECEIVER)
    loop.on_message = off
    loop.settle(50.0)
    loop.go_on(20.0)
    assert told(loop, "gnss velocity: jump rejected") and not told(loop, "accelerometer")
    assert loop.off_m < 0.7


@pytest.mark.parametrize(("yaw_radps", "within_s"), [(1.0, 0.3), (1.0, 0.5), (0.7, 0.3)])
def test_a_blow_that_turns_the_boat_leaves_the_compass_believed(yaw_radps: float, within_s: float) -> None:
    loop = Altered("sitl-blueboat")
    loop.settle(60.0)
    vessel = loop.plant._vessel
    for _ in range(round(within_s * HZ)):
        vessel.r_radps += yaw_radps / (within_s * HZ)
        loop.go_on(1 / HZ)
    assert loop.go_on(20.0).phase == "hold"
    assert loop.off_rad < math.radians(8.0) and not told(loop, "compass")


@pytest.mark.parametrize("speed_mps", [30.0, 45.0])
def test_a_wind_of_nonsense_for_seconds_does_not_carry_the_estimate_off(speed_mps: float) -> None:
    def nonsense(t_s: float, data: bytes) -> bytes:
        parts = data.decode().split(",")
        if t_s < 50.0 or t_s % 10.0 > 3.0 or not parts[0].endswith("MWV"):
            return data
        speed = speed_mps + 0.1 * (round(20.0 * t_s) % 7)  # no two alike, as of a sensor that is not stuck
        return nmea_sentence(f"{parts[0][1:]},{parts[1]},R,{speed:.2f},M,A")

    loop = Altered("sitl", *CALM_RECEIVER)
    loop.on_sentence = nonsense
    loop.settle(49.0)
    assert loop.go_on(30.0).phase == "hold"
    assert told(loop, "anemometer: implausible") and loop.off_m < 0.7 and loop.away_m < 1.0
