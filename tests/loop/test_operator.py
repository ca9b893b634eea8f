"""Ground stations and the daemon in virtual time: parameters, set-points, modes, and that a replay sees it all."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from asvhil.backseat.build import build_backseat, build_controller, build_model
from asvhil.config import Config, load_config
from asvhil.controller.procedure import Procedure
from asvhil.controller.station_mpc import StationMpc
from asvhil.geo import wrap_rad
from asvhil.io.mavlink.frames import dialect
from asvhil.logs.opening import open_recorder
from asvhil.logs.replay import replay
from asvhil.operator.encoding import encode_hold, encode_release
from asvhil.supervisor.reasons import Reason, describe, explain
from asvhil.types import Outputs, Phase
from tests.support.loop import GroundStationLoop
from tests.support.messages import of_type

BASE = (
    "plant.weather.wind.speed_mps=0",
    "plant.start_n_m=0",
    "plant.start_e_m=0",
    "plant.sensors.gnss.slow_bias_m=0",
)


def calm(*overrides: str) -> Config:
    return load_config("sitl", (*BASE, *overrides))


def set_parameter(loop: GroundStationLoop, name: str, value: float) -> float:
    """Set a parameter: the value that is answered."""
    loop.say(dialect.MAVLink_param_set_message(1, 191, name.encode(), value, 9))
    loop.wait(0.3)
    return [m for m in of_type(loop.heard, "PARAM_VALUE") if m.param_id == name][-1].param_value


def test_parameters_take_effect_are_bounded_and_are_replayed(tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    config = calm("controller.name=sd-mpc", "controller.procedure.enabled=true")
    recorder = open_recorder(config, log, "lockstep", threaded=False)
    loop = GroundStationLoop(config, recorder)
    controller = build_controller(config, build_model(config))
    assert isinstance(controller, Procedure) and isinstance(controller.keeper, StationMpc)
    loop.backseat = build_backseat(config, controller=controller)
    assert math.isnan(set_parameter(loop, "ST_HDG", 45.0)) and describe(explain(Reason.NO_STATION_HELD)) in loop.texts
    assert loop.wait(60.0, lambda o: o.phase is Phase.HOLD).phase is Phase.HOLD
    loop.say(dialect.MAVLink_param_request_list_message(1, 191))
    loop.wait(3.0)
    told = {m.param_id: m for m in of_type(loop.heard, "PARAM_VALUE")}
    count = next(iter(told.values())).param_count
    assert len(told) == count and all(len(name) <= 16 for name in told)
    configured = loop.config.controller
    assert told["W_NEAR_HDG"].param_value == configured.mpc.near.heading
    assert told["PROC_R_S"].param_value == configured.procedure.r_s_m
    assert told["ST_LAT"].param_value == pytest.approx(40.4237, abs=1e-5)
    # A weight and a radius: at once, in the controller that runs.
    assert set_parameter(loop, "W_NEAR_HDG", 300.0) == 300.0 and controller.keeper.config.near.heading == 300.0
    assert set_parameter(loop, "PROC_R_S", 12.0) == 12.0 and controller.config.r_s_m == 12.0
    # What cannot be: the old value, and why.
    limits = "2 km at most, and 100 m unless the hold command names more"
    out_of_range, conflict = Reason.PARAMETER_OUT_OF_RANGE, Reason.PARAMETER_CONFLICT
    for name, value, why in (
        ("W_NEAR_SIDE", 1.5, explain(out_of_range, name="W_NEAR_SIDE", range="0.05 to 1")),
        ("W_NEAR_HDG", -1.0, explain(out_of_range, name="W_NEAR_HDG", range="1 to 100000")),
        ("W_NEAR_HDG", 0.0, explain(out_of_range, name="W_NEAR_HDG", range="1 to 100000")),
        ("W_NEAR_POS", 0.0, explain(out_of_range, name="W_NEAR_POS", range="0.1 to 10000")),
        ("W_NEAR_HDG", math.nan, explain(out_of_range, name="W_NEAR_HDG", range="1 to 100000")),
        ("W_NEAR_HDG", math.inf, explain(out_of_range, name="W_NEAR_HDG", range="1 to 100000")),
        ("PROC_R_D", 10.0, explain(conflict, name="PROC_R_D", rule="r_h_m < r_s_m < r_d_m must hold")),
        ("MPC_NEAR_R", 50.0, explain(conflict, name="MPC_NEAR_R", rule="near_radius_m < far_radius_m must hold")),
        ("ST_NORTH", 1e7, explain(Reason.STATION_TOO_FAR, distance_km=10000.0, limits=limits)),
        ("ST_NORTH", math.nan, explain(out_of_range, name="ST_NORTH", range="a finite number")),
        ("ST_LAT", 91.0, explain(out_of_range, name="ST_LAT", range="-90 to 90")),
    ):
        loop.texts.clear()
        before = told[name].param_value if name != "W_NEAR_HDG" else 300.0
        assert set_parameter(loop, name, value) == pytest.approx(before, abs=1e-3), name
        assert loop.texts == [describe(why)]
    # The station: turned and moved, and the boat goes there.
    assert set_parameter(loop, "ST_HDG", 30.0) == pytest.approx(30.0)
    station = loop.outputs.station  # type: ignore[union-attr]
    assert set_parameter(loop, "ST_NORTH", station.n_m + 3.0) == pytest.approx(station.n_m + 3.0)  # type: ignore[union-attr]
    loop.wait(40.0)
    truth, origin = loop.plant.truth, loop.plant.origin
    lat_deg, lon_deg = origin.to_geodetic(truth.n_m, truth.e_m)
    n_m, _ = loop.backseat.frame.to_ned(lat_deg, lon_deg)  # type: ignore[union-attr]
    assert n_m == pytest.approx(station.n_m + 3.0, abs=2.0)  # type: ignore[union-attr]
    assert math.degrees(truth.psi_rad) == pytest.approx(30.0, abs=5.0)
    recorder.close()
    result = replay(log)
    assert result.mismatch is None and result.compared > 1000


def test_a_stream_of_set_points_moves_the_station_and_does_not_take_it_back() -> None:
    loop = GroundStationLoop(calm("controller.name=loiter", "supervisor.engage=command"))
    loop.wait(40.0, lambda o: o.estimate is not None and o.estimate.valid)
    rover = loop.frontseat
    rover.set_receiver(True)
    rover.set_mode(0)
    loop.wait(4.0)
    assert rover.arm(True)
    loop.wait(1.0)
    mask = 0b110111111000

    def stream(seconds: float, lat: float) -> Outputs:
        for _ in range(round(seconds * 5)):
            target = (round(lat * 1e7), round(-86.9212 * 1e7))
            loop.say(dialect.MAVLink_set_position_target_global_int_message(0, 1, 191, 6, mask, *target, *[0.0] * 9))
            loop.wait(0.2)
        assert loop.outputs is not None
        return loop.outputs

    first = stream(2.0, 40.42375)
    assert first.phase is Phase.HOLD and first.station is not None
    second = stream(2.0, 40.42380)
    assert second.station is not None and second.station.n_m - first.station.n_m == pytest.approx(5.55, abs=0.1)
    assert second.station.psi_rad == first.station.psi_rad
    rover.set_sticks({2: 1700})  # the pilot
    assert stream(3.0, 40.42380).phase is Phase.STANDBY
    rover.set_sticks({2: 1500})
    assert stream(5.0, 40.42380).phase is Phase.STANDBY  # still the same stream
    loop.wait(3.5)  # a gap in the radio link
    assert stream(1.0, 40.42380).phase is Phase.STANDBY
    loop.say(dialect.MAVLink_command_long_message(1, 191, dialect.MAV_CMD_NAV_GUIDED_ENABLE, 0, 1.0, *[0.0] * 6))
    assert stream(1.0, 40.42385).phase is Phase.HOLD
    assert loop.outputs is not None and loop.outputs.station is not None
    assert loop.outputs.station.n_m - second.station.n_m == pytest.approx(5.55, abs=0.1)


@pytest.mark.parametrize("by", ["reposition", "loiter"])
def test_the_mode_is_taken_and_given_back(by: str) -> None:
    loop = GroundStationLoop(calm("controller.name=loiter", "supervisor.engage=command", "supervisor.take_mode=true"))
    loop.wait(40.0, lambda o: o.estimate is not None and o.estimate.valid)
    rover = loop.frontseat
    rover.set_receiver(True)
    loop.wait(3.0)
    assert rover.arm(True) and rover.set_mode(15)
    loop.wait(1.0)
    if by == "reposition":
        loop.say(encode_hold(loop.config.links.autopilot, 40.42375, -86.9212, 0.5))
    else:
        loop.say(dialect.MAVLink_command_long_message(1, 191, 17, 0, 0, 0, 0, 30.0, 0.0, 0.0, 0.0))
    assert loop.wait(3.0, lambda o: o.phase is Phase.HOLD).phase is Phase.HOLD
    assert rover.rover.mode == 0
    loop.wait(5.0)
    assert loop.outputs is not None and loop.outputs.phase is Phase.HOLD
    loop.say(encode_release(loop.config.links.autopilot))
    loop.wait(2.0)
    assert rover.rover.mode == 15 and loop.outputs.phase is Phase.STANDBY
    assert f"standby: {describe(explain(Reason.RELEASED))}" in loop.texts
    # Now the pilot changes it while we hold: his choice stands.
    loop.say(encode_hold(loop.config.links.autopilot, None, None, None))
    loop.wait(3.0)
    assert rover.rover.mode == 0 and loop.outputs.phase is Phase.HOLD
    assert rover.set_mode(4)
    loop.wait(5.0)
    assert rover.rover.mode == 4 and loop.outputs.phase is Phase.STANDBY


@pytest.mark.thorough
def test_the_heading_follows_the_weather_once_an_operator_wants_it() -> None:
    """By the parameter, while a station is held across the wind; the boat turns to it, and is nearer than before."""
    keys = ("plant.weather.wind.speed_mps=6", "plant.weather.wind.toward_deg=90", "plant.sensors.gnss.slow_bias_m=0")
    loop = GroundStationLoop(load_config("sitl", keys))
    loop.wait(30.0)
    assert loop.outputs is not None and loop.outputs.station is not None and loop.outputs.station.psi_rad == 0.0
    loop.say(dialect.MAVLink_param_set_message(1, 191, b"ST_POLICY", 1.0, 9))
    loop.wait(1.0)
    values = {m.param_id: m.param_value for m in loop.heard if m.get_type() == "PARAM_VALUE"}
    assert values["ST_POLICY"] == 1.0
    outputs = loop.wait(40.0)
    assert outputs.phase is Phase.HOLD and outputs.station is not None
    assert math.degrees(outputs.station.psi_rad) == pytest.approx(-90.0, abs=25.0)
    assert abs(wrap_rad(loop.plant.truth.psi_rad - outputs.station.psi_rad)) < math.radians(15.0)
