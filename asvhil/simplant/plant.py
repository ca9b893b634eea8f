"""The simulated boat on the network: vessel, weather, sensors, autopilot and anemometer, sans-IO."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

import numpy as np

from asvhil.config import Config, FaultConfig
from asvhil.config.fault_spans import Faults, Present
from asvhil.config.ports import ANEMOMETER, AUTOPILOT, GNSS, INS
from asvhil.config.registry import SENSORS
from asvhil.dynamics.blendermann import Blendermann
from asvhil.geo import LocalFrame, wrap_rad
from asvhil.simplant.ardurover.vehicle import SimulatedArduRover
from asvhil.simplant.boat.devices import SimulatedNmea, SimulatedSensor, SimulatedVn300
from asvhil.simplant.boat.faults import all_faults, motor_signals_us
from asvhil.simplant.boat.metronome import Metronome
from asvhil.simplant.boat.sensors import EVEN, Anemometer, Navigation, TrueMotion, mwv_sentence
from asvhil.simplant.boat.vessel import Vessel
from asvhil.simplant.boat.weather import Weather
from asvhil.simplant.px4.vehicle import SimulatedPx4
from asvhil.simplant.vehicle.powered import BATTERY_V
from asvhil.types import Frame, record


@record
class Truth:
    """The true state: pose in NED, velocity over ground in body axes, true wind, and the motors."""

    t_ns: int
    n_m: float
    e_m: float
    psi_rad: float
    u_mps: float
    v_mps: float
    r_radps: float
    wind_n_mps: float
    wind_e_mps: float
    thrust_n: tuple[float, float]
    outputs_us: tuple[int, int]


def with_lines_read(config: Config) -> Config:
    """The config without those lines of the simulated boat's own sensors that the daemon does not read."""
    lines = config.plant.links
    unread = {port: None for port in (ANEMOMETER, GNSS, INS) if getattr(config.links, port) is None}
    plant = config.plant.model_copy(update={"links": lines.model_copy(update=unread)})
    return config.model_copy(update={"plant": plant})


class AttachedAutopilot(Protocol):
    """An autopilot that drives the motors: bytes in by `receive`, one main loop by `loop`, bytes out."""

    @property
    def outputs_us(self) -> tuple[int, int]: ...

    def receive(self, frame: Frame) -> None: ...

    def loop(self, t_ns: int) -> list[Frame]: ...


class Moored:
    """The motion of a boat held in place: the pose of a vessel, and no velocity."""

    r_radps = ax_mps2 = ay_mps2 = 0.0

    def __init__(self, vessel: Vessel) -> None:
        self._vessel = vessel
        self.n_m, self.e_m, self.psi_rad = vessel.n_m, vessel.e_m, vessel.psi_rad
        self.roll_rad, self.pitch_rad = vessel.roll_rad, vessel.pitch_rad

    @property
    def motor_commands(self) -> tuple[float, float]:
        """Those of the vessel: motors turn while it is held."""
        return self._vessel.motor_commands

    def ground_velocity_ned(self) -> tuple[float, float]:
        return 0.0, 0.0


class Plant:
    """The simulated boat: `receive` bytes, `advance` time, and get the bytes it has sent.

    Same config and same inputs give the same bytes: all randomness comes from `plant.seed`, one stream for each
    sensor, gust component and the waves, none of which depends on what the companion asks for.
    """

    def __init__(self, config: Config, t_ns: int, autopilot: AttachedAutopilot | None = None) -> None:
        """`autopilot` drives the motors in place of the simulated one, `frontseat`, which is then never switched on."""
        plant = config.plant
        vessel = config.plant_vessel
        pwm = config.vehicle.pwm
        seeds = np.random.SeedSequence(plant.seed).spawn(5 + len(config.links.sensors))
        weather_seed, navigation_seed, anemometer_seed, ins_seed, nmea_seed, *sensor_seeds = seeds
        self._step_ns = round(1e9 * plant.step_s)
        self._t_ns = t_ns
        self._neutral_us = pwm.neutral_us
        self._loop = Metronome(t_ns, plant.frontseat.loop_hz)
        self._sentence = Metronome(t_ns, plant.sensors.anemometer.rate_hz)
        self.weather = Weather(plant.weather, plant.step_s, weather_seed)
        self._vessel = Vessel(
            vessel,
            pwm,
            plant.step_s,
            (plant.start_n_m, plant.start_e_m, np.radians(plant.start_heading_deg).item()),
            (self.weather.current_n_mps, self.weather.current_e_mps),
            self.weather.waves,
            None if plant.wind_load is None else Blendermann(plant.wind_load),
            plant.motors,
            plant.tilt,
        )
        self._navigation = Navigation(
            plant.sensors,
            plant.frontseat.loop_hz,
            t_ns,
            navigation_seed,
            filtered=True,
            tilt=plant.tilt or EVEN,
        )
        self._anemometer = Anemometer(plant.sensors.anemometer, anemometer_seed)
        self._has_anemometer = config.links.anemometer is not None or plant.links.anemometer is not None
        self.origin = LocalFrame(lat_deg=plant.origin_lat_deg, lon_deg=plant.origin_lon_deg)
        kind = SimulatedPx4 if plant.autopilot == "px4" else SimulatedArduRover
        self.frontseat: SimulatedArduRover | SimulatedPx4 = kind(
            plant.frontseat, pwm, plant.sensors.gnss, self.origin, self._navigation, self._vessel, t_ns
        )

        self._autopilot: AttachedAutopilot = autopilot or self.frontseat
        self._start_ns, self._all_faults = t_ns, all_faults(plant)
        self._faults = Faults(self._all_faults, t_ns)
        self._devices: list[SimulatedVn300 | SimulatedNmea] = []
        if "ins" in config.plant_devices:
            self._devices.append(SimulatedVn300(plant.sensors, self.origin, t_ns, ins_seed))
        if "nmea" in config.plant_devices:
            self._devices.append(SimulatedNmea(plant.sensors, self.origin, t_ns, nmea_seed))
        self._sensors = [
            SimulatedSensor(port, SENSORS.find(link.kind), link, plant.sensors, self.origin, t_ns, seed)
            for (port, link), seed in zip(sorted(config.links.sensors.items()), sensor_seeds, strict=True)
        ]
        self._moored: Moored | None = None
        self._has_receiver = plant.frontseat.rc_receiver
        self._drawn_ns = t_ns  # until then the battery has given what it has
        self._power = config.vehicle.power if plant.frontseat.current_sensor else None
        self._transmitter_lost = False

    @property
    def motion(self) -> TrueMotion:
        """The boat as its sensors see it after the last step, without their errors."""
        return self._moored or self._vessel

    @property
    def t_ns(self) -> int:
        """The time of the last step."""
        return self._t_ns

    @property
    def navigation(self) -> Navigation:
        """The GNSS/INS, with what it measured last."""
        return self._navigation

    @property
    def faults(self) -> Present:
        """The faults that are present."""
        return self._faults.at(self._t_ns)

    def break_in(self, faults: Iterable[FaultConfig]) -> None:
        """Add faults to those of the config; their times count from power-on, as there."""
        self._all_faults = (*self._all_faults, *faults)
        self._faults = Faults(self._all_faults, self._start_ns)

    def moor(self, on: bool) -> None:
        """Hold the boat in place while time and weather go on, or release it, at rest in the water as at the start.

        It can be moored only before the first step.
        """
        self._moored = Moored(self._vessel) if on else None

    def set_step(self, step_s: float, loop_hz: float | None = None) -> None:
        """Steps of another length from now on, and another rate at which the autopilot reads its sensors."""
        self._step_ns = round(1e9 * step_s)
        if loop_hz is not None:
            self._loop.set_rate(self._t_ns, loop_hz)
        self._vessel.set_step(step_s)
        self.weather.set_step(step_s)

    @property
    def truth(self) -> Truth:
        """The state after the last step."""
        vessel, weather = self._vessel, self.weather
        u_mps, v_mps = (0.0, 0.0) if self._moored else vessel.ground_velocity_body()
        return Truth(
            t_ns=self._t_ns,
            n_m=vessel.n_m,
            e_m=vessel.e_m,
            psi_rad=wrap_rad(vessel.psi_rad),
            u_mps=u_mps,
            v_mps=v_mps,
            r_radps=self.motion.r_radps,
            wind_n_mps=weather.wind_n_mps,
            wind_e_mps=weather.wind_e_mps,
            thrust_n=(vessel.thrust_port_n, vessel.thrust_starboard_n),
            outputs_us=vessel.outputs_us,
        )

    def receive(self, frame: Frame) -> None:
        """Bytes from the companion; only the autopilot listens."""
        if frame.port == AUTOPILOT:
            self._autopilot.receive(frame)

    def step(self) -> list[Frame]:
        """One step, with the autopilot's outputs at its begin: the frames sent during it."""
        self._drive(self._faults.at(self._t_ns))
        return self.advance(self._t_ns + self._step_ns)

    def _drive(self, faults: Present) -> None:
        """The motors by the autopilot's present outputs."""
        signals_us = motor_signals_us(self._autopilot.outputs_us, faults, self._neutral_us)
        self._vessel.drive(signals_us, faults.thrust_left)

    def advance(self, t_ns: int) -> list[Frame]:
        """Step up to, never beyond, a time: the frames sent until then, in order of time."""
        sent: list[Frame] = []
        vessel, weather, motion = self._vessel, self.weather, self.motion
        now_ns, step_ns = self._t_ns, self._step_ns
        while now_ns + step_ns <= t_ns:
            self._t_ns = now_ns = now_ns + step_ns
            faults = self._faults.at(now_ns)
            if self._moored is None:
                vessel.step(weather.wind_n_mps, weather.wind_e_mps)
            weather.advance()
            if self._has_receiver and ("transmitter" in faults) is not self._transmitter_lost:
                self._transmitter_lost = not self._transmitter_lost
                self.frontseat.set_receiver(not self._transmitter_lost)
            if now_ns >= self._loop.due_ns and self._loop.take_due(now_ns):
                drawn_w = None if self._power is None else self._power.drawn_w(vessel.motor_commands)
                volts = BATTERY_V if faults.battery_v is None else faults.battery_v
                self.frontseat.set_battery(volts, drawn_w, (now_ns - self._drawn_ns) * 1e-9)
                self._drawn_ns = now_ns
                self._navigation.sample(now_ns, motion, faults.of("autopilot"))
                sent += self._autopilot.loop(now_ns)
                self._drive(faults)
            if now_ns >= self._sentence.due_ns and self._sentence.take_due(now_ns):
                stuck = "anemometer-stuck" in faults
                speed_mps, from_deg = self._anemometer.sample(
                    motion,
                    weather.wind_n_mps,
                    weather.wind_e_mps,
                    vane_stuck=stuck or "vane" in faults,
                    cups_stuck=stuck or "cups" in faults,
                )
                if self._has_anemometer and "anemometer" not in faults:
                    data = mwv_sentence(speed_mps, from_deg)
                    sent.append(Frame(t_ns=now_ns, port=ANEMOMETER, data=data))
            for device in self._devices:
                sent += device.advance(now_ns, motion, faults)
            for sensor in self._sensors:
                sent += sensor.advance(now_ns, motion, (weather.wind_n_mps, weather.wind_e_mps))
        return sent
