"""SIGTERM ends long work as Ctrl-C does: a word on how to go on, status 130, and nothing left behind."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from asvhil.commands.termination import termination_interrupts
from tests.support.waiting import wait_until

SPEC = """
config: sitl
design: {kind: grid}
parameters: {wind_speed: [3, 6]}
variants: {LOITER: {controller.name: loiter}}
window_s: [5, 15]
worst: 0
repeats: 500
"""


def test_a_sigterm_is_an_interrupt_within_and_what_it_was_thereafter() -> None:
    with pytest.raises(KeyboardInterrupt), termination_interrupts():
        os.kill(os.getpid(), signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    try:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        with termination_interrupts():
            os.kill(os.getpid(), signal.SIGTERM)
        assert signal.getsignal(signal.SIGTERM) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


@pytest.mark.real_time
@pytest.mark.parametrize("group", [False, True])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_campaign_that_is_ended_says_how_to_go_on(tmp_path: Path, number: int, group: bool) -> None:
    (tmp_path / "many.yaml").write_text(SPEC)
    with subprocess.Popen(
        [sys.executable, "-m", "asvhil", "campaign", "many.yaml", "-o", "out", "--workers", "2"],
        cwd=tmp_path,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as campaign:
        store = tmp_path / "out" / "many.jsonl"
        try:
            wait_until(lambda: store.exists() and store.read_bytes().count(b"\n") >= 2, 120.0)
            (os.killpg if group else os.kill)(campaign.pid, number)
            _, words = campaign.communicate(timeout=60.0)
        finally:
            campaign.kill()
    assert campaign.returncode == 130
    assert words == "asvhil: campaign: interrupted; the same command goes on where it was\n"
    assert b"error" not in store.read_bytes(), "a process that was ended has not failed"
