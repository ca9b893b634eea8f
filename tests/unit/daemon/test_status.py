"""The status of a daemon: the reason as text and as a code, and what to do about it."""

import dataclasses
import io

from rich.console import Console

from asvhil.daemon.status import render, status_of
from asvhil.supervisor.reasons import Reason, describe, explain, remedy
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
