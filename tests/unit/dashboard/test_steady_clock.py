"""The page's clock goes on where the computer's is set, and tells how far the two are apart."""

from __future__ import annotations

import time

import pytest

from asvhil.dashboard.picture import BoatPicture
from asvhil.dashboard.steady_clock import behind_s, steady_s
from asvhil.io.mavlink.frames import decode, dialect
from asvhil.operator.state_arrays import BoatState, state_arrays

DAEMON = dialect.MAVLink(None, srcSystem=1, srcComponent=191)


@pytest.mark.parametrize("step_s", [-900.0, 900.0])
def test_a_computer_whose_clock_is_set_makes_nothing_old_and_history_goes_on(
    step_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    picture = BoatPicture()
    real, monotonic, passed_s = time.time, time.monotonic, 0.0
    monkeypatch.setattr(time, "monotonic", lambda: monotonic() + passed_s)
    assert behind_s() == pytest.approx(0.0, abs=0.5)
    for clock in (real, lambda: real() + step_s):
        monkeypatch.setattr(time, "time", clock)
        (state,) = state_arrays(0, BoatState())
        picture.receive(steady_s(), decode(bytes(state.pack(DAEMON))))
        assert not picture.live(steady_s())["stale"]
        passed_s += 1.1
    assert len(picture.history()["rows"]) == 2
    assert behind_s() == pytest.approx(step_s - passed_s, abs=0.5), "monotonic is ahead here by what has passed"
