"""Extended Kalman filter over pose, velocity, disturbance and sensor biases, with vessel model and accelerometer.

`states.py` lists the states; the model's motor states are propagated and not corrected. Late readings are processed at
their own time (`out_of_sequence.py`). Each reading is gated; the estimate stays valid without a sensor that is off,
frozen or silent for as long as the others can bridge it (`sensor_health.py`, `validity.py`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from asvhil.config import Config, EstimatorConfig
from asvhil.dynamics.protocol import Dynamics
from asvhil.estimator import sensor_health
from asvhil.estimator.ekf_step import Filter
from asvhil.estimator.measurement_model import Event, corrections
from asvhil.estimator.out_of_sequence import History
from asvhil.estimator.states import D_E, D_N, D_R, PSI, E, Factors, FilterState, Forcing, N, R, U, V
from asvhil.geo import LocalFrame, wrap_rad
from asvhil.types import Estimate, GroundVelocity, Heading, Measurement, Note, Position, YawRate

NAMES = {
    "position": "gnss position",
    "velocity": "gnss velocity",
    "heading": "compass",
    "yaw_rate": "gyro",
    "acceleration": "accelerometer",
}
REJECTED = tuple(f"ekf.rejected_{name}" for name in NAMES)  # the counters
# How a jump of each is told.
SIZES: dict[str, Callable[[float], str]] = {
    "position": lambda m: f"{m:.1f} m",
    "velocity": lambda mps: f"{mps:.1f} m/s",
    "heading": lambda rad: f"{math.degrees(rad):.0f} deg",
    "yaw_rate": lambda radps: f"{math.degrees(radps):.0f} deg/s",
    "acceleration": lambda mps2: f"{mps2:.1f} m/s2",
}
DOUBTED = "left out: receiver and vessel model agree against it; is the boat's tilt taken out, is the compass right?"


class Ekf:
    """Extended Kalman filter: measurements in, `Estimate` out. It starts at the first position with a heading known."""

    def __init__(self, config: EstimatorConfig, model: Dynamics) -> None:
        self._config = config
        self._stale_ns = round(config.ekf.stale_after_s * 1e9)
        self.model = model
        self._filter = Filter(config, model)
        self._history: History[FilterState] | None = None
        self._first_heading: tuple[Heading, YawRate | None] | None = None
        self._forcing = Forcing((0.0, 0.0), None)
        self._factors = Factors(())
        self.frame: LocalFrame | None = None

    @property
    def state(self) -> FilterState | None:
        """The filter's present state; None before the start."""
        return None if self._history is None else self._history.state

    @property
    def rejected(self) -> dict[str, int]:
        """Cumulative counts of rejected readings by kind."""
        tracks = self._history.state.tracks if self._history is not None else {}
        return {name: tracks[name].rejected if name in tracks else 0 for name in NAMES}

    @property
    def resets(self) -> int:
        """How often the filter has reset states to a sensor that it had rejected before."""
        return 0 if self._history is None else self._history.state.resets

    @property
    def too_late(self) -> int:
        """How many readings were dropped since they were older than the history."""
        return 0 if self._history is None else self._history.too_late

    def set_forcing(self, model_input: tuple[float, float], wind_ned: tuple[float, float] | None) -> None:
        """Set what drives the prediction from now on: the model's input (2), and the true wind (m/s, NED) if known."""
        forcing = Forcing(model_input, wind_ned)
        if forcing == self._forcing:  # no event: it drives the prediction already
            return
        self._forcing = forcing
        if self._history is not None:
            self._history.add(self._history.t_ns, self._forcing)

    def set_factors(self, values: tuple[float, ...]) -> None:
        """Set what corrects the model from now on, the last of its motor states (`dynamics.corrected`)."""
        self._factors = Factors(values)
        if self._history is not None:
            self._history.add(self._history.t_ns, self._factors)

    def on_measurements(self, measurements: Sequence[Measurement]) -> None:
        """Correct the state with the positions, velocities, headings and yaw rates of one frame.

        A specific force drives the prediction from its time on, and corrects the disturbance.
        """
        for event in corrections(measurements):
            if self._history is None:
                self._start(event)
            else:
                self._history.add(event[0].t_ns, event)

    def counters(self) -> tuple[tuple[str, int], ...]:
        """Cumulative counts of rejected readings, of those that came too late, and of resets."""
        return (
            *zip(REJECTED, self.rejected.values(), strict=True),
            ("ekf.too_late", self.too_late),
            ("ekf.resets", self.resets),
        )

    def predict(self, t_ns: int) -> None:
        """Predict the state to a time, and evaluate its validity there; earlier times change nothing."""
        history = self._history
        if history is not None and (t_ns > history.t_ns or (t_ns == history.t_ns and history.event is not None)):
            history.add(t_ns, None)

    def estimate(self, t_ns: int) -> Estimate | None:
        """The estimate at a time, None before the start; not valid if sensors have been missing for too long."""
        self.predict(t_ns)
        if self._history is None:
            return None
        state = self._history.state
        x = state.x.tolist()
        return Estimate(
            t_ns=t_ns,
            n_m=x[N],
            e_m=x[E],
            psi_rad=wrap_rad(x[PSI]),
            u_mps=x[U],
            v_mps=x[V],
            r_radps=x[R],
            motor=tuple(state.motor.tolist()),
            std=tuple([math.sqrt(max(variance, 0.0)) for variance in state.p.diagonal()[:6].tolist()]),
            disturbance=(x[D_N], x[D_E], x[D_R]),
            valid=state.invalid_since_ns == sensor_health.NEVER,
        )

    def notes(self, t_ns: int) -> tuple[Note, ...]:
        """Notes on the sensors that are off, frozen or silent."""
        if self._history is None:
            return ()
        found = []
        for name, track in self._history.state.tracks.items():
            text = sensor_health.fault(track, t_ns, self._stale_ns)
            if not text and name == "acceleration" and self._history.state.doubt.open:
                text = DOUBTED
            if not text and sensor_health.is_taken_over(track, t_ns):
                text = f"believed after a jump of {SIZES[name](track.taken_off)}: is it right?"
            if text:
                found.append(Note(subject=NAMES[name], text=text, ok=False))
        return tuple(found)

    def _start(self, event: Event) -> None:
        """Keep a heading; start at a position, if the heading is not stale by then."""
        match event:
            case (Heading() as heading, *rest):
                rate = rest[0] if rest and isinstance(rest[0], YawRate) else None
                self._first_heading = heading, rate
            case (Position() as position, *rest) if self._first_heading is not None:
                heading, rate = self._first_heading
                if position.t_ns - heading.t_ns > self._stale_ns:
                    return
                velocity = rest[0] if rest and isinstance(rest[0], GroundVelocity) else None
                self.frame = LocalFrame(lat_deg=position.lat_deg, lon_deg=position.lon_deg)
                state = self._filter.start(position, velocity, heading, rate, self.frame)
                span_ns = round(self._config.ekf.history_s * 1e9)
                self._history = History(self._filter.step, span_ns, position.t_ns, state)
                self._history.add(position.t_ns, self._forcing)
                if self._factors.values:
                    self._history.add(position.t_ns, self._factors)
            case _:
                pass


def build(settings: None, config: Config, model: Dynamics) -> Ekf:
    """The filter of a config."""
    return Ekf(config.estimator, model)
