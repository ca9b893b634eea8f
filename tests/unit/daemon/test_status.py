"""The status of a daemon: the reason as text and as a code, and what to do about it."""

import dataclasses
import io

import pytest
from rich.console import Console

from asvhil.commands.status import _rows
from asvhil.config import load_config
from asvhil.daemon.status import StatusTeller, energy_text, in_the_way, render, shares_text, status_of
from asvhil.supervisor.reasons import Reason, describe, explain, remedy
from asvhil.types import EnergyUse, FrontseatStatus, Note, Outputs, Phase
from tests.support.log_samples import sample_outputs


def test_the_status_has_the_reason_its_code_and_the_remedy() -> None:
    outputs = sample_outputs(5)
    why = explain(Reason.STICK_MOVED, channel=4)
    health = dataclasses.replace(outputs.health, reason=describe(why), code=why.reason.value)
    status = status_of(dataclasses.replace(outputs, health=health), {}, 0, 0)
    assert (status["reason"], status["code"]) == (describe(why), Reason.STICK_MOVED)
    assert status["remedy"] == remedy(Reason.STICK_MOVED)
    console = Console(file=io.StringIO(), width=200)
    console.print(render(status, "asvhil"))
    shown = console.file.getvalue()  # type: ignore[attr-defined]
    assert describe(why) in shown and remedy(Reason.STICK_MOVED) in shown


def standby(why: Reason, *, link_ok: bool, estimate_ok: bool) -> Outputs:
    outputs = sample_outputs(5)
    health = dataclasses.replace(outputs.health, code=why.value, link_ok=link_ok, estimate_ok=estimate_ok)
    return dataclasses.replace(outputs, phase=Phase.STANDBY, health=health)


def vehicle(*, armed: bool, fault: str = "") -> FrontseatStatus:
    return FrontseatStatus(t_ns=1, armed=armed, mode="MANUAL", ready=True, rc_us=(), outputs_us=(), arming_fault=fault)


@pytest.mark.parametrize(
    ("link_ok", "estimate_ok", "told", "words"),
    [
        (False, False, None, "no heartbeat from the autopilot"),
        (False, True, vehicle(armed=True), "no heartbeat from the autopilot"),
        (True, False, vehicle(armed=True), "no valid position and heading yet"),
        (
            *(True, False, vehicle(armed=False, fault="bad compass")),
            "vehicle is not armed (bad compass), no valid position and heading yet",
        ),
        (True, True, vehicle(armed=True), ""),
    ],
)
def test_a_standby_that_waits_for_a_hold_tells_what_would_refuse_it(
    link_ok: bool, estimate_ok: bool, told: FrontseatStatus | None, words: str
) -> None:
    outputs = standby(Reason.WAITING_FOR_HOLD, link_ok=link_ok, estimate_ok=estimate_ok)
    teller = StatusTeller(load_config("sitl", ("supervisor.engage=command", "controller.name=loiter")))
    teller.see(outputs)
    status = teller.status(outputs, {}, 0, told)
    assert status["in_the_way"] == words
    console = Console(file=io.StringIO(), width=200)
    console.print(render(status, "asvhil"))
    shown = console.file.getvalue()  # type: ignore[attr-defined]
    assert ("refuses a hold" in shown) == bool(words) and words in shown
    why = standby(Reason.WAITING_FOR_AUTOPILOT, link_ok=link_ok, estimate_ok=estimate_ok)
    assert in_the_way(why, told) == in_the_way(dataclasses.replace(outputs, phase=Phase.HOLD), told) == ""


def test_the_status_has_what_the_sensors_have_dropped_by_cause() -> None:
    outputs = sample_outputs(5)
    counters = (
        *(("anemometer.sentences", 9), ("anemometer.bad_checksum", 3), ("anemometer.out_of_range", 1)),
        *(("anemometer.void", 0), ("anemometer.unused", 5), ("autopilot.bad_crc", 7), ("mast.lines", 4)),
        *(("anemometer.bad", 4), ("mast.bad", 2), ("aft.bad", 0)),
    )
    health = dataclasses.replace(outputs.health, counters=counters)
    status = status_of(dataclasses.replace(outputs, health=health), {}, 0, 0)
    assert status["dropped"] == {"anemometer": {"bad checksum": 3, "out of range": 1}, "mast": {"bad": 2}}
    console = Console(file=io.StringIO(), width=200)
    console.print(render(status, "asvhil"))
    assert "3 bad checksum, 1 out of range" in console.file.getvalue()  # type: ignore[attr-defined]


def test_the_links_are_one_row() -> None:
    outputs = sample_outputs(5)
    silent = Note(subject="links", text="autopilot up, nothing heard yet", ok=False)
    health = dataclasses.replace(outputs.health, notes=(silent,))
    links = {"autopilot": "up, nothing heard yet; signed"}
    status = status_of(dataclasses.replace(outputs, health=health), links, 0, 0)
    console = Console(file=io.StringIO(), width=200)
    console.print(render(status, "asvhil"))
    shown = console.file.getvalue()  # type: ignore[attr-defined]
    assert shown.count("nothing heard yet") == 1 and "nothing heard yet; signed" in shown
    assert status["notes"] == {"links": silent.text}


def test_the_status_has_what_is_taken_from_the_battery() -> None:
    use = EnergyUse(hold_wh=12.34, power_w=300.0, mean_w=245.6, hours_left=2.05, by="curve")
    status = status_of(dataclasses.replace(sample_outputs(5), energy=use), {}, 0, 0)
    assert status["energy"] == {"hold_wh": 12.34, "mean_w": 245.6, "hours_left": 2.05, "by": "curve"}
    console = Console(file=io.StringIO(), width=200)
    console.print(render(status, "asvhil"))
    assert "12.3 Wh in this hold, 246 W (curve), 2.0 h left" in console.file.getvalue()  # type: ignore[attr-defined]
    assert energy_text({"hold_wh": None, "mean_w": None, "hours_left": None, "by": ""}) == "not known yet"
    assert status_of(sample_outputs(5), {}, 0, 0)["energy"] is None


def test_shares_of_sources_name_what_changed_and_never_round_to_all_or_nothing() -> None:
    shares = {
        "position": {"ins.BINARY": 0.999, "gnss.RMC": 0.001},
        "heading": {"ins.BINARY": 1.0},
        "wind": {"mast.MWV": 0.8, "": 0.2},
    }
    assert shares_text(shares) == "position ins.BINARY >99 %, gnss.RMC <1 %; wind mast.MWV 80 %, not heard 20 %"
    assert shares_text({}) == shares_text({"heading": {"ins.BINARY": 1.0}}) == ""


@pytest.mark.parametrize(
    ("boat", "words"),
    [
        ({"armed": None, "estimate_ok": 0.0}, "no heartbeat from the autopilot"),
        ({"armed": 0.0, "estimate_ok": None}, "vehicle is not armed, no valid position and heading yet"),
        ({"armed": 1.0, "estimate_ok": 1.0}, None),
        (None, None),
    ],
)
def test_the_command_tells_what_would_refuse_a_hold_by_the_link(
    boat: dict[str, float | None] | None, words: str | None
) -> None:
    look = {"phase": "standby", "reason": "waiting for a hold command", "state": None, "notes": {}, "boat": boat}
    assert dict(_rows(look)).get("refuses a hold") == words
    assert "refuses a hold" not in dict(_rows(look | {"phase": "hold", "reason": "holding"}))
