"""The one way from frames to measurements: decoded, of the source in use, at their time and place, calibrated.

Sans-IO, and a pure function of the frames. Backseat, training, calibration and preflight all have their measurements
from here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import chain

from asvhil.config import Config, EstimatorConfig
from asvhil.config.ports import AUTOPILOT
from asvhil.geo import wrap_2pi, wrap_rad
from asvhil.io.sensors.codecs import build_codecs
from asvhil.io.sensors.compass import true_heading
from asvhil.io.sensors.protocol import NamedMeasurement, SensorCodec
from asvhil.io.sensors.sources import SourceSelector, Switch
from asvhil.types import ApparentWind, BowWind, Frame, Heading, Measurement, changed, record

Decode = Callable[[Frame], Sequence[NamedMeasurement]]


@record
class SensorCalibration:
    """Coefficients A to E of the compass deviation, and how far the vane's zero is turned clockwise from the bow."""

    deviation_rad: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    vane_offset_rad: float = 0.0

    @classmethod
    def from_config(cls, config: EstimatorConfig) -> SensorCalibration:
        """What `asvhil calibrate` has found: `ekf.compass.deviation_deg` and `wind.vane_offset_deg`."""
        return cls(
            deviation_rad=tuple(math.radians(degrees) for degrees in config.ekf.compass.deviation_deg),
            vane_offset_rad=math.radians(config.wind.vane_offset_deg),
        )

    @property
    def is_trivial(self) -> bool:
        """Whether there is nothing to take out."""
        return not any(self.deviation_rad) and self.vane_offset_rad == 0.0

    def apply(self, m: Measurement) -> Measurement:
        """A heading without the deviation, a wind angle from the bow; whatever else as it is."""
        match m:
            case Heading() if any(self.deviation_rad):
                return changed(m, psi_rad=wrap_rad(true_heading(m.psi_rad, self.deviation_rad)))
            case ApparentWind() | BowWind() if self.vane_offset_rad:
                return changed(m, from_rad=wrap_2pi(m.from_rad + self.vane_offset_rad))
            case _:
                return m


class Decoder:
    """Frames of the autopilot and of all sensor links to measurements.

    The deviation is taken from every heading and the offset from every wind angle, whichever source is in use: they are
    calibrated with the source that is used.
    """

    def __init__(
        self,
        autopilot: Decode,
        codecs: Mapping[str, SensorCodec],
        selector: SourceSelector,
        calibration: SensorCalibration,
    ) -> None:
        self._codecs = codecs
        self._decode = {AUTOPILOT: autopilot, **{port: codec.decode for port, codec in codecs.items()}}
        self._selector = selector
        self._calibration = calibration
        self._is_calibrated = not calibration.is_trivial

    @classmethod
    def from_config(cls, config: Config, autopilot: Decode) -> Decoder:
        """`autopilot` decodes the frames of the autopilot's port: the `receive` of its conversation."""
        return cls(
            autopilot,
            build_codecs(config),
            SourceSelector(config.sources.resolved(config.links), config.sources.return_after_s),
            SensorCalibration.from_config(config.estimator),
        )

    def decode(self, frame: Frame) -> list[Measurement]:
        """The measurements in a frame that are to be used, in the order of its bytes; none of an unknown port."""
        port, select = frame.port, self._selector.select
        decode = self._decode.get(port)
        chosen: list[Measurement] = []
        for message, m in () if decode is None else decode(frame):
            used = select(f"{port}.{message}", m)
            if used is not None:
                chosen.append(used)
        return [self._calibration.apply(m) for m in chosen] if self._is_calibrated else chosen

    def decode_every_source(self, frame: Frame) -> list[NamedMeasurement]:
        """(LINK.MESSAGE, measurement) of all in a frame, in use or not, as the sensors tell them.

        Codecs remember the rest of a stream, so a frame goes to this method or to `decode`, never to both.
        """
        decode = self._decode.get(frame.port)
        return [] if decode is None else [(f"{frame.port}.{message}", m) for message, m in decode(frame)]

    def sources(self, t_ns: int) -> tuple[tuple[str, str], ...]:
        """The source in use for each quantity, empty where none is heard."""
        return self._selector.current(t_ns)

    def switches(self, t_ns: int) -> list[Switch]:
        """The changes of source since the last call, of quantities that have a choice."""
        return self._selector.switches(t_ns)

    def counters(self) -> tuple[tuple[str, int], ...]:
        """Cumulative counts of what came in on the sensor links and what was dropped."""
        return tuple(chain.from_iterable([codec.counters() for codec in self._codecs.values()]))
