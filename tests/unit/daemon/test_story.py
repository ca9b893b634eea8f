"""What the terminal shows beside the present tick: the station and its distance at first, events, the boat."""

import dataclasses
import io

from rich.console import Console

from asvhil.autopilot.vehicle_text import vehicle_text
from asvhil.config import load_config
from asvhil.daemon.status import StatusTeller, event_text, render, station_text
from asvhil.io.mavlink.frames import dialect
from asvhil.operator.replies import Replies
from asvhil.supervisor.reasons import Reason, describe, explain
from asvhil.types import Address, FrontseatStatus, Note, Outputs, Phase, Station
from tests.support.log_samples import sample_outputs

US = (1, 191)
NEUTRAL = dialect.MAV_CMD_COMPONENT_ARM_DISARM


def teller_after(*ticks: Outputs) -> StatusTeller:
    teller = StatusTeller(load_config("sitl"))
    for outputs in ticks:
        teller.see(outputs)
    return teller


def told(*ticks: Outputs) -> dict:  # type: ignore[type-arg]
    return teller_after(*ticks).status(ticks[-1], {}, 0, None)


def texts(status: dict) -> list[str]:  # type: ignore[type-arg]
    return [event["text"] for event in status["events"]]


def with_reason(outputs: Outputs, reason: str) -> Outputs:
    return dataclasses.replace(outputs, health=dataclasses.replace(outputs.health, reason=reason))


def test_a_station_keeps_the_distance_that_it_had_at_first() -> None:
    far = dataclasses.replace(sample_outputs(1), station=Station(n_m=1.0 / 3.0 + 30.0, e_m=40.0, psi_rad=0.5))
    assert far.estimate is not None
    near = dataclasses.replace(far, estimate=dataclasses.replace(far.estimate, n_m=30.0, e_m=39.0))
    station = told(far, near)["station"]
    assert abs(station["from_m"] - 50.0) < 0.01 and station["heading_deg"] == 28.64788975654116
    assert station_text(station).endswith("heading 28.6 deg; 50.0 m away at the start")
    moved = dataclasses.replace(near, station=Station(n_m=30.0, e_m=42.0, psi_rad=0.5))
    assert abs(told(far, near, moved)["station"]["from_m"] - 3.0) < 0.01
    released = sample_outputs(3, control=False)
    assert told(far, released)["station"] is None
    assert abs(told(far, released, near)["station"]["from_m"] - 1.05) < 0.01  # a new hold of the same station


def test_a_station_that_moves_or_turns_with_the_weather_is_given_once() -> None:
    first = dataclasses.replace(sample_outputs(1), station=Station(n_m=30.0, e_m=40.0, psi_rad=0.5, vn_mps=0.3))
    moving = [Station(n_m=30.0 + 0.1 * k, e_m=40.0, psi_rad=0.5, vn_mps=0.3) for k in range(20)]
    turning = [Station(n_m=30.0, e_m=40.0, psi_rad=0.5 + 0.01 * k) for k in range(20)]
    given = told(first)["station"]
    for stations in (moving, turning):
        ticks = [dataclasses.replace(first, t_ns=first.t_ns + k, station=at) for k, at in enumerate(stations)]
        station = told(*ticks)["station"]
        assert (station["given_ns"], station["from_m"]) == (first.t_ns, given["from_m"])
    turned = dataclasses.replace(first, t_ns=first.t_ns + 9, station=Station(n_m=30.0, e_m=40.0, psi_rad=0.6))
    assert told(first, turned)["station"]["given_ns"] == turned.t_ns


def test_a_refused_hold_is_an_event_with_its_reason() -> None:
    replies, why = Replies(US), explain(Reason.STATION_UNCONFIRMED, metres=1123.0, limit="100 m")
    idle = with_reason(sample_outputs(1, control=False), "waiting for a hold command")
    for command, result in ((dialect.MAV_CMD_DO_REPOSITION, 2), (dialect.MAV_CMD_REQUEST_MESSAGE, 2)):
        replies.send_text(idle.t_ns, dialect.MAV_SEVERITY_NOTICE, "something else", Address("", ""))
        replies.send_refusal(idle.t_ns, why, Address("", ""))
        replies.send(idle.t_ns, dialect.MAVLink_command_ack_message(command, result), Address("", ""))
    asked = dataclasses.replace(idle, frames=tuple(replies.take()))
    said = ["standby: waiting for a hold command", f"refused: {describe(why)}"]
    assert texts(told(idle, asked)) == said
    replies.send(idle.t_ns, dialect.MAVLink_command_ack_message(dialect.MAV_CMD_DO_REPOSITION, 0), Address("", ""))
    granted = dataclasses.replace(idle, frames=tuple(replies.take()))
    assert texts(told(idle, granted)) == said[:1]


def test_a_refusal_that_answers_a_repetition_is_no_second_event() -> None:
    idle = with_reason(sample_outputs(1, control=False), "waiting for a hold command")
    why = explain(Reason.NOT_ARMED)

    def refused(after_s: float, peer: str, via: str = "", command: int = dialect.MAV_CMD_DO_REPOSITION) -> Outputs:
        replies, t_ns = Replies(US), idle.t_ns + round(after_s * 1e9)
        replies.send_refusal(t_ns, why, Address(via, peer))
        replies.send(t_ns, dialect.MAVLink_command_ack_message(command, 2, 0, 0, 255, 190), Address(via, peer))
        return dataclasses.replace(idle, t_ns=t_ns, frames=tuple(replies.take()))

    said = f"refused: {describe(why)}"
    again = [refused(at_s, "gcs:1") for at_s in (0.0, 0.5, 1.0, 2.5)]  # as a slow link has it, each since the last
    assert texts(told(idle, *again))[1:] == [said]
    assert texts(told(idle, refused(0.0, "w:1", "ground.wifi"), refused(0.1, "r:1", "ground.radio")))[1:] == [said]
    for another in (refused(0.5, "gcs:2"), refused(2.1, "gcs:1"), refused(0.5, "gcs:1", command=NEUTRAL)):
        assert texts(told(idle, refused(0.0, "gcs:1"), another))[1:] == [said] * 2


def test_phases_and_new_notes_are_events_and_the_last_are_kept() -> None:
    hold = with_reason(sample_outputs(1), "holding")
    note = Note(subject="gnss position", text="silent", ok=False)
    wrong = dataclasses.replace(hold, health=dataclasses.replace(hold.health, notes=(note,)))
    adrift = with_reason(dataclasses.replace(hold, phase=Phase.FAILSAFE), "position or heading is stale")
    assert texts(told(hold, wrong, wrong, adrift)) == [
        "hold: holding",
        "gnss position: silent",
        "failsafe: position or heading is stale",
    ]
    many = told(*[hold, adrift] * 10)
    assert len(many["events"]) == 8 and event_text(many["events"][-1])[8:] == " failsafe: position or heading is stale"


def test_the_table_has_the_boat_the_model_and_the_station() -> None:
    outputs = with_reason(sample_outputs(1), "holding")
    vehicle = FrontseatStatus(
        t_ns=0, armed=True, mode="MANUAL", ready=True, rc_us=(), outputs_us=(), battery_v=15.24, battery_percent=80.0,
        fix=3, satellites=12,
    )  # fmt: skip
    status = teller_after(outputs).status(outputs, {"autopilot": "up"}, 0, vehicle)
    assert status["vehicle"] == "armed, MANUAL, 3D fix, 12 satellites, battery 15.2 V, 80 %"
    assert status["model"] == "lagnet-mpc: wamv16-lagnet.npz, lagnet of wamv16"
    console = Console(file=io.StringIO(), width=200)
    console.print(render(status, "asvhil"))
    shown = console.file.getvalue()  # type: ignore[attr-defined]
    for words in (status["vehicle"], status["model"], "m away at the start", "hold: holding"):
        assert words in shown


def test_what_is_not_known_of_the_boat_is_left_out() -> None:
    assert vehicle_text(None) == ""
    silent = FrontseatStatus(t_ns=0, armed=False, mode="", ready=False, rc_us=(), outputs_us=())
    assert vehicle_text(silent) == ""
    assert vehicle_text(dataclasses.replace(silent, mode="HOLD", fix=0)) == "not armed, HOLD, no GNSS"
