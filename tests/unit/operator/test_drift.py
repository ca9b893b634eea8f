"""A boat adrift after its autopilot has disarmed by itself: until a person acts."""

import numpy as np
import pytest

from asvhil.operator.drift import SETTLED_NS, SILENT_NS, DriftWatch
from asvhil.supervisor.decision import Decision
from asvhil.supervisor.reasons import Reason, explain
from asvhil.types import FrontseatStatus, Phase, changed
from tests.support.supervisor_bench import SupervisorBench, status

S = 1_000_000_000
STANDBY = SupervisorBench().step()


def told(reason: Reason, phase: Phase = Phase.STANDBY) -> Decision:
    return changed(STANDBY, phase=phase, why=explain(reason))


HOLDING, REBOOTED = told(Reason.HOLDING, Phase.HOLD), told(Reason.AUTOPILOT_REBOOTED)


def at(t_s: float, mode: str) -> FrontseatStatus:
    return changed(status(armed=False, mode=mode, disarmed_itself="reboot"), t_ns=round(t_s * S))


def hear(watch: DriftWatch, since_s: float, until_s: float, mode: str) -> bool:
    """Whether it is adrift after one mode, told twice a second."""
    for t_s in (*np.arange(since_s, until_s, 0.5), until_s):
        watch.step(at(t_s, mode), REBOOTED)
    return watch.adrift


def rebooted() -> DriftWatch:
    """Seen at 10 s, in the mode of before; in that of the boot from 11 s on."""
    watch = DriftWatch()
    watch.step(status(), HOLDING)
    assert hear(watch, 10.0, 10.5, "MANUAL")
    assert hear(watch, 11.0, 11.0, "HOLD"), "the boot has chosen"
    return watch


SETTLED_S, SILENT_S = SETTLED_NS / S, SILENT_NS / S


@pytest.mark.parametrize(("stands_s", "adrift"), [(SETTLED_S - 0.1, True), (SETTLED_S, False)])
def test_a_mode_that_is_chosen_after_the_boots_own_has_stood_ends_the_emergency(stands_s: float, adrift: bool) -> None:
    watch = rebooted()
    assert hear(watch, 11.5, 11.0 + stands_s, "HOLD")
    assert hear(watch, 11.0 + stands_s, 11.0 + stands_s, "MANUAL") is adrift


@pytest.mark.parametrize(("silent_s", "adrift"), [(SILENT_S, False), (SILENT_S + 0.1, True)])
def test_a_mode_after_a_silence_may_be_that_of_one_more_boot(silent_s: float, adrift: bool) -> None:
    watch = rebooted()
    assert hear(watch, 11.5, 30.0, "HOLD")
    assert hear(watch, 30.0 + silent_s, 30.0 + silent_s, "MANUAL") is adrift


def test_a_boot_that_takes_long_is_nobodys_choice() -> None:
    watch = rebooted()
    assert hear(watch, 11.5, 30.0, "HOLD")
    assert hear(watch, 30.5, 60.0, "INITIALISING")
    assert hear(watch, 60.5, 60.5 + SETTLED_S, "MANUAL")
    assert not hear(watch, 61.0 + SETTLED_S, 61.0 + SETTLED_S, "HOLD")


def test_a_release_ends_the_emergency() -> None:
    watch = rebooted()
    watch.release()
    assert not hear(watch, 11.5, 12.0, "HOLD")
