"""The ArduRover profile: readiness, mode numbers and parameters of ArduPilot's rover. Sans-IO."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from asvhil.autopilot.after_silence import RECEIVER_IGNORED, AfterSilence, after_silence_of_ardurover
from asvhil.autopilot.ardurover_parameters import FENCE_ACTION, OPTIONAL, TRIM, requirements
from asvhil.autopilot.ardurover_wiring import names_of_wiring, wiring_of
from asvhil.autopilot.ground_stations import is_station, names_of_stations
from asvhil.autopilot.mavlink_autopilot import MavlinkAutopilot
from asvhil.autopilot.parameter_watch import ParameterRules
from asvhil.autopilot.script_output import ScriptOutput
from asvhil.config import AutopilotLinkConfig, Config, PwmConfig
from asvhil.io.mavlink.frames import dialect
from asvhil.types import Measurement, Radio

EKF_HORIZONTAL_POSITION = dialect.EKF_POS_HORIZ_ABS
STATION_WAIT_NS = 5_000_000_000  # for a ground station, since the autopilot was heard first
TERMINATE = 5.0  # FENCE_ACTION: disarm
EKF_CONSTANT_POSITION = dialect.EKF_CONST_POS_MODE


class ArduRoverAutopilot(MavlinkAutopilot):
    """Ready once its EKF uses a position; mode numbers stand in custom_mode as they are."""

    legacy_streams = True
    _obeys_stations = True
    _keeps_overrides = True

    def __init__(self, config: AutopilotLinkConfig, pwm: PwmConfig, *, levels: bool = False) -> None:
        """`levels`: its accelerometer is used, and so it is asked for the trim of its attitude."""
        besides = ((FENCE_ACTION,), *(((name,) for name in TRIM) if levels else ()))
        rules = ParameterRules(
            wiring=partial(wiring_of, config, pwm),
            requirements=partial(requirements, config, pwm),
            names_of_wiring=partial(names_of_wiring, config, pwm),
            names_to_know=lambda values: (*names_of_stations(config, values), *besides),
            receiver_ignored=_ignores_receiver,
            fence_disarms=lambda values: values.get(FENCE_ACTION) == TERMINATE,
            trim_rad=lambda values: (values.get(TRIM[0], 0.0), values.get(TRIM[1], 0.0)),
            optional=OPTIONAL,
        )
        super().__init__(config, pwm, rules)
        self._handlers[dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT] = self._on_ekf_status
        if isinstance(self._output, ScriptOutput):
            self._handlers[dialect.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT] = self._output.on_named_value
        self._first_heard_ns: int | None = None
        self._after_silence: tuple[tuple[int, Radio, bool] | None, AfterSilence | None] = (None, None)  # and of what

    @property
    def after_silence(self) -> AfterSilence | None:
        radio = self.transmitter.radio
        systems = self._neighbours.systems(self._t_ns)
        others = bool(systems) and any(is_station(system, self.parameters.values) for system in systems)
        known = self.parameters.changes, radio, others
        if known != self._after_silence[0]:
            values = self.parameters.values
            self._after_silence = known, after_silence_of_ardurover(self._config, values, radio, others=others)
        return self._after_silence[1]

    def _station_text(self) -> str:
        """With the script, of a pilot without a transmitter: that his station's loss could not be noticed."""
        if self._config.output != "script" or self.station_heard_ns is not None:
            return super()._station_text()
        if self.transmitter.radio is Radio.HEARD and not self._known.receiver_ignored:
            return super()._station_text()
        waited_ns = 0 if self._first_heard_ns is None else self._t_ns - self._first_heard_ns
        return "none is heard: nobody would notice its loss" if waited_ns > STATION_WAIT_NS else ""

    def _on_heartbeat(self, t_ns: int, m: Any) -> Sequence[Measurement]:
        status = super()._on_heartbeat(t_ns, m)
        self._first_heard_ns = t_ns if self._first_heard_ns is None else self._first_heard_ns
        if isinstance(self._output, ScriptOutput):
            self._output.on_vehicle(armed=self._vehicle.armed, mode=self._vehicle.mode)
        return status

    def _on_ekf_status(self, t_ns: int, m: Any) -> Sequence[Measurement]:
        position = bool(m.flags & EKF_HORIZONTAL_POSITION) and not m.flags & EKF_CONSTANT_POSITION
        self._vehicle.note_estimator(t_ns, position=position, attitude=bool(m.flags & dialect.EKF_ATTITUDE))
        return self._vehicle.status(t_ns)


def _ignores_receiver(values: Mapping[str, float]) -> bool:
    return bool(int(values.get("RC_OPTIONS", 0)) & RECEIVER_IGNORED)


def build(config: Config) -> ArduRoverAutopilot:
    """The conversation of a config."""
    estimator = config.estimator
    levels = estimator.kind != "ekf" or estimator.ekf.accelerometer
    return ArduRoverAutopilot(config.links.autopilot, config.vehicle.pwm, levels=levels)
