"""The simulated boat as the network sees it: vessel, weather, sensors, autopilot and anemometer, sans-IO."""

from __future__ import annotations

import numpy as np

from asvhil.config import Config
from asvhil.geo import LocalFrame, wrap_rad
from asvhil.simplant.frontseat import PORT as AUTOPILOT_PORT
from asvhil.simplant.frontseat import SimulatedArduRover
from asvhil.simplant.sensors import Anemometer, Navigation, mwv_sentence
from asvhil.simplant.vessel import Vessel
from asvhil.simplant.weather import Weather
from asvhil.types import Frame, record

ANEMOMETER_PORT = "anemometer"


@record
class Truth:
    """What really is: pose in NED, velocity over ground in body axes, true wind, and what the motors do."""

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


class Plant:
    """Built whole at power-on; `receive` bytes, `advance` time, and take the bytes it has sent.

    Same config and same inputs give the same bytes: all randomness comes from `plant.seed`, one stream for each
    sensor and gust component, none of which depends on what the companion asks for.
    """

    def __init__(self, config: Config, t_ns: int) -> None:
        plant = config.plant
        vessel = plant.vessel or config.vehicle.vessel
        pwm = config.vehicle.pwm
        weather_seed, navigation_seed, anemometer_seed = np.random.SeedSequence(plant.seed).spawn(3)
        self._step_ns = round(1e9 * plant.step_s)
        self._t_ns = self._start_ns = t_ns
        self._loop_hz = plant.frontseat.loop_hz
        self._anemometer_hz = plant.sensors.anemometer.rate_hz
        self._loops, self._loop_due_ns = self._next(0, self._loop_hz)
        self._sentences, self._sentence_due_ns = self._next(0, self._anemometer_hz)
        self._weather = Weather(plant.weather, plant.step_s, weather_seed)
        self._vessel = Vessel(
            vessel,
            pwm,
            plant.step_s,
            (plant.start_n_m, plant.start_e_m, np.radians(plant.start_heading_deg).item()),
            (self._weather.current_n_mps, self._weather.current_e_mps),
        )
        self._navigation = Navigation(plant.sensors, self._loop_hz, t_ns, navigation_seed)
        self._anemometer = Anemometer(plant.sensors.anemometer, anemometer_seed)
        self.origin = LocalFrame(lat_deg=plant.origin_lat_deg, lon_deg=plant.origin_lon_deg)
        self.frontseat = SimulatedArduRover(
            plant.frontseat, pwm, plant.sensors.gnss, self.origin, self._navigation, self._vessel, t_ns
        )

    @property
    def truth(self) -> Truth:
        """The state after the last step."""
        vessel, weather = self._vessel, self._weather
        u_mps, v_mps = vessel.ground_velocity_body()
        return Truth(
            t_ns=self._t_ns,
            n_m=vessel.n_m,
            e_m=vessel.e_m,
            psi_rad=wrap_rad(vessel.psi_rad),
            u_mps=u_mps,
            v_mps=v_mps,
            r_radps=vessel.r_radps,
            wind_n_mps=weather.wind_n_mps,
            wind_e_mps=weather.wind_e_mps,
            thrust_n=(vessel.thrust_port_n, vessel.thrust_starboard_n),
            outputs_us=vessel.outputs_us,
        )

    def receive(self, frame: Frame) -> None:
        """Bytes from the companion; only the autopilot listens."""
        if frame.port == AUTOPILOT_PORT:
            self.frontseat.receive(frame)

    def advance(self, t_ns: int) -> list[Frame]:
        """Step up to, never beyond, a time; what was sent on the way, in time order."""
        sent: list[Frame] = []
        vessel, weather = self._vessel, self._weather
        while self._t_ns + self._step_ns <= t_ns:
            self._t_ns += self._step_ns
            vessel.step(weather.wind_n_mps, weather.wind_e_mps)
            weather.advance()
            if self._t_ns >= self._loop_due_ns:
                self._loops, self._loop_due_ns = self._next(self._loops, self._loop_hz)
                self._navigation.sample(self._t_ns, vessel)
                sent += self.frontseat.loop(self._t_ns)
                vessel.drive(self.frontseat.outputs_us)
            if self._t_ns >= self._sentence_due_ns:
                self._sentences, self._sentence_due_ns = self._next(self._sentences, self._anemometer_hz)
                speed_mps, from_deg = self._anemometer.sample(vessel, weather.wind_n_mps, weather.wind_e_mps)
                data = mwv_sentence(speed_mps, from_deg)
                sent.append(Frame(t_ns=self._t_ns, port=ANEMOMETER_PORT, data=data))
        return sent

    def _next(self, count: int, rate_hz: float) -> tuple[int, int]:
        """The next tick after now on the grid of a rate, counted from power-on so that it never drifts."""
        due_ns = self._t_ns
        while due_ns <= self._t_ns:
            count += 1
            due_ns = self._start_ns + round(count * 1e9 / rate_hz)
        return count, due_ns
