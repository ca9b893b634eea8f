"""The plant as the physics of an autopilot outside of this process: motor outputs in, one step, motion out."""

from __future__ import annotations

from asvhil.config import Config
from asvhil.config.fault_spans import Present
from asvhil.simplant.boat.sensors import Navigation, TrueMotion
from asvhil.simplant.boat.vessel import NO_SIGNAL_US
from asvhil.simplant.plant import Plant, Truth
from asvhil.types import Frame

OFF = (NO_SIGNAL_US, NO_SIGNAL_US)


class ExternalAutopilot:
    """Outputs that somebody else sets; it says nothing and hears nothing on the boat's own link."""

    def __init__(self) -> None:
        self.outputs_us: tuple[int, int] = OFF

    def receive(self, frame: Frame) -> None:
        """Nothing: the autopilot has a link of its own."""

    def loop(self, t_ns: int) -> list[Frame]:
        """Nothing to send; its sensors have been sampled."""
        return []


def on_an_even_keel(config: Config) -> Config:
    """The same without roll and pitch: the interfaces to other autopilots tell a level attitude, and forces with it."""
    plant = config.plant
    waves = plant.weather.waves.model_copy(update={"tilt": 0.0})
    weather = plant.weather.model_copy(update={"waves": waves})
    return config.model_copy(update={"plant": plant.model_copy(update={"tilt": None, "weather": weather})})


class HilPlant:
    """Same boat, weather, sensors and faults as in loopback, in steps that the autopilot asks for.

    `restart` puts the boat back to its start with the same weather. It is moored until the outputs have been neutral
    for `plant.hil.neutral_first_s` on end: an autopilot that boots may drive them anywhere (ArduPilot: full astern).
    """

    def __init__(self, config: Config, step_s: float, *, sample_each_step: bool) -> None:
        """`sample_each_step`: the sensors are read at each step, else at `plant.frontseat.loop_hz`."""
        config.check_faults()
        self._config = on_an_even_keel(config)
        self._sample_each_step = sample_each_step
        self._asked_s = step_s
        self._neutral_ns = round(1e9 * config.plant.hil.neutral_first_s)
        self.restart()

    def restart(self) -> None:
        """Power-on: the boat at its start pose, time at 0."""
        self._autopilot = ExternalAutopilot()
        self._plant = Plant(self._config, 0, self._autopilot)
        self._step_s = 0.0
        self.set_step(self._asked_s)
        self._neutral_since_ns: int | None = None
        self.moored = self._neutral_ns > 0
        self._plant.moor(self.moored)

    @property
    def t_ns(self) -> int:
        """Time since power-on."""
        return self._plant.t_ns

    @property
    def truth(self) -> Truth:
        return self._plant.truth

    @property
    def motion(self) -> TrueMotion:
        return self._plant.motion

    @property
    def navigation(self) -> Navigation:
        return self._plant.navigation

    @property
    def faults(self) -> Present:
        return self._plant.faults

    def lat_lon_e7(self, n_m: float, e_m: float) -> tuple[int, int]:
        """A position in units of 1e-7 degrees."""
        lat_deg, lon_deg = self._plant.origin.to_geodetic(n_m, e_m)
        return round(lat_deg * 1e7), round(lon_deg * 1e7)

    def set_step(self, step_s: float) -> None:
        """Steps of another length from now on; nothing where it is the same."""
        self._asked_s = step_s
        if step_s != self._step_s:
            self._step_s = step_s
            self._plant.set_step(step_s, 1.0 / step_s if self._sample_each_step else None)

    def step(self, outputs_us: tuple[int, int], *, neutral: bool) -> list[Frame]:
        """One step with these pulse widths (port, starboard); what other sensors sent on their own links."""
        if self.moored:
            self._let_go_when_ready(neutral)
        self._autopilot.outputs_us = outputs_us
        return self._plant.step()

    def _let_go_when_ready(self, neutral: bool) -> None:
        t_ns = self.t_ns
        if not neutral:
            self._neutral_since_ns = None
        elif self._neutral_since_ns is None:
            self._neutral_since_ns = t_ns
        elif t_ns - self._neutral_since_ns >= self._neutral_ns:
            self.moored = False
            self._plant.moor(False)
