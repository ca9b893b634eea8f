"""The state of boat and backseat in numbers, for a display: two DEBUG_FLOAT_ARRAYs, sent to whoever asks for them.

Pure functions, for both ends of the link. docs/mavlink.md lists the fields.
"""

from __future__ import annotations

import itertools
import math
import struct
from typing import Any

from asvhil.geo import wrap_rad
from asvhil.io.mavlink.frames import dialect
from asvhil.supervisor.energy import MEASURED
from asvhil.types import Control, DockingWindow, EnergyUse, Estimate, Station, Wind, record

STATE_ID, PLAN_ID = 1, 2  # DEBUG_FLOAT_ARRAY.array_id
CELLS = 58
# Seconds that the docking window has been open, 0 while it is not, and how likely it stays open for another 30 s ...
DOCKING_FIELDS = ("dock_open", "dock_30", "dock_60", "dock_150")
# Energy of the hold (Wh), mean power (W), hours left, and whether the power is measured (1) or by the curve (0).
ENERGY_FIELDS = ("hold_wh", "mean_w", "hours_left", "w_measured")
# In their order in the array; what is not known is NaN. Metres are in the local NED frame, `origin_*` is where it is:
# the sum of two floats, as one tells degrees to half a metre only. `wind_*` is the velocity of the air over ground.
STATE_FIELDS = (
    *("n_m", "e_m", "heading_deg", "u_mps", "v_mps", "r_degps", "position_std_m", "heading_std_deg", "estimate_ok"),
    *("station_n_m", "station_e_m", "station_heading_deg", "distance_m", "heading_error_deg"),
    *("wind_n_mps", "wind_e_mps", "wind_std_mps", "wind_ok"),
    *("port", "starboard", "port_us", "starboard_us"),
    *("solve_ms", "solve_iterations", "solve_ok"),
    *("armed", "battery_v", "battery_percent", "fix", "satellites"),
    *("origin_lat_deg", "origin_lat_rest_deg", "origin_lon_deg", "origin_lon_rest_deg"),
    *DOCKING_FIELDS,
    *ENERGY_FIELDS,
    *("station_vn_mps", "station_ve_mps"),  # over ground; 0 while it rests, or waits for the boat
)
PLAN_ROW = 3  # north and east (m), heading (degrees)
PLAN_ROWS = CELLS // PLAN_ROW


@record
class BoatState:
    """What a display shows of one tick, as far as it is known. `pulses_us`: of both motors; None while not ours.

    `sources` is as in `Health`; `station` and `point` are as in `Decision`.
    """

    estimate: Estimate | None = None
    station: Station | None = None
    point: Station | None = None
    wind: Wind | None = None
    control: Control | None = None
    pulses_us: tuple[int, int] | None = None
    solve_ms: float = math.nan
    mode: str = ""
    armed: bool | None = None
    battery_v: float | None = None
    battery_percent: float | None = None
    fix: int | None = None
    satellites: int | None = None
    origin_deg: tuple[float, float] | None = None
    sources: tuple[tuple[str, str], ...] = ()
    docking: DockingWindow | None = None
    energy: EnergyUse | None = None

    def words(self) -> list[tuple[str, str]]:
        """(subject, text): the autopilot's mode, and the source of each quantity."""
        mode = f"{self.mode}, {'armed' if self.armed else 'not armed'}" if self.mode else "not known"
        sources = ", ".join(f"{quantity} {name or 'not heard'}" for quantity, name in self.sources)
        return [("mode", mode), *([("sources", sources)] if sources else [])]


def state_arrays(t_us: int, state: BoatState) -> list[Any]:
    """The messages: the state, and the predicted path where there is one."""
    values = _values(state)
    found = [_array(t_us, b"state", STATE_ID, [values.get(name, math.nan) for name in STATE_FIELDS])]
    plan = state.control.plan if state.control is not None else ()
    if plan:
        rows = (plan[round(i * (len(plan) - 1) / (PLAN_ROWS - 1))] for i in range(PLAN_ROWS))
        if len(plan) <= PLAN_ROWS:
            rows = (row for row in plan)
        found.append(
            _array(t_us, b"plan", PLAN_ID, [x for _, n, e, psi in rows for x in (n, e, math.degrees(psi) % 360.0)])
        )
    return found


def read_state(message: Any) -> dict[str, float | None]:
    """The fields of a state array by name; None: not known."""
    return {name: _known(value) for name, value in zip(STATE_FIELDS, message.data, strict=False)}


def read_plan(message: Any) -> list[tuple[float, float, float]]:
    """The rows of a plan array: north and east (m), heading (degrees)."""
    rows = (message.data[i : i + PLAN_ROW] for i in range(0, PLAN_ROWS * PLAN_ROW, PLAN_ROW))
    return [(n, e, heading) for n, e, heading in itertools.takewhile(lambda row: all(map(math.isfinite, row)), rows)]


def _values(state: BoatState) -> dict[str, float]:
    """What is known, by field."""
    known: dict[str, float | None] = {"solve_ms": state.solve_ms}
    estimate, station, wind, control = state.estimate, state.station, state.wind, state.control
    if estimate is not None:
        known |= {"n_m": estimate.n_m, "e_m": estimate.e_m, "heading_deg": math.degrees(estimate.psi_rad) % 360.0}
        known |= {"u_mps": estimate.u_mps, "v_mps": estimate.v_mps, "r_degps": math.degrees(estimate.r_radps)}
        known |= {"position_std_m": math.hypot(*estimate.std[:2]), "heading_std_deg": math.degrees(estimate.std[2])}
        known |= {"estimate_ok": float(estimate.valid)}
    if state.point is not None:
        known |= {"station_n_m": state.point.n_m, "station_e_m": state.point.e_m}
        known |= {"station_heading_deg": math.degrees(state.point.psi_rad) % 360.0}
        known |= {"station_vn_mps": state.point.vn_mps, "station_ve_mps": state.point.ve_mps}
    if station is not None and estimate is not None:
        known |= {"distance_m": math.hypot(estimate.n_m - station.n_m, estimate.e_m - station.e_m)}
        known |= {"heading_error_deg": math.degrees(wrap_rad(estimate.psi_rad - station.psi_rad))}
    if wind is not None:
        known |= {"wind_n_mps": wind.vn_mps, "wind_e_mps": wind.ve_mps, "wind_std_mps": wind.std_mps}
        known |= {"wind_ok": float(wind.valid)}
    if control is not None:
        known |= {"port": control.command[0], "starboard": control.command[1]}
        known |= {"solve_iterations": float(control.iterations), "solve_ok": float(control.ok)}
    if state.pulses_us is not None:
        known |= {"port_us": float(state.pulses_us[0]), "starboard_us": float(state.pulses_us[1])}
    known |= {"armed": state.armed, "battery_v": state.battery_v, "battery_percent": state.battery_percent}
    known |= docking_values(state.docking)
    known |= energy_values(state.energy)
    known |= {"fix": state.fix, "satellites": state.satellites}
    for axis, degrees in zip(("lat", "lon"), state.origin_deg or (), strict=False):
        near = struct.unpack("<f", struct.pack("<f", degrees))[0]
        known |= {f"origin_{axis}_deg": near, f"origin_{axis}_rest_deg": degrees - near}
    return {name: float(value) for name, value in known.items() if value is not None}


def docking_values(window: DockingWindow | None) -> dict[str, float | None]:
    """The `DOCKING_FIELDS` that are known: none without a station, no probabilities where too little is known."""
    if window is None:
        return {}
    stays = (0.0,) * 3 if window.open_s is None else window.stays
    return dict(zip(DOCKING_FIELDS, (window.open_s or 0.0, *stays), strict=False))


def energy_values(use: EnergyUse | None) -> dict[str, float | None]:
    """The `ENERGY_FIELDS`, None where they are not known; none where nothing is to be told of the battery."""
    if use is None:
        return {}
    measured = float(use.by == MEASURED) if use.by else None
    return dict(zip(ENERGY_FIELDS, (use.hold_wh, use.mean_w, use.hours_left, measured), strict=True))


def _array(t_us: int, name: bytes, array_id: int, values: list[float]) -> Any:
    ended = [*values, math.nan][:CELLS]
    data = [*ended, *[0.0] * (CELLS - len(ended))]  # MAVLink 2 leaves out zeros at the end
    return dialect.MAVLink_debug_float_array_message(t_us, name, array_id, data)


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
