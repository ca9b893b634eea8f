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
