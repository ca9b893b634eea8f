"""`engage: auto`: what has to be there before a simulated boat holds by itself, and how that ends."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from asvhil.config import SupervisorConfig
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.types import Phase, Station
from tests.support.supervisor_bench import ESTIMATE, SupervisorBench, status

STRANGER = explain(Reason.TWO_VEHICLES, system=1)
WAITING = explain(Reason.WAITING_FOR_AUTOPILOT)
AUTO_WAITS: dict[str, tuple[dict[str, Any], Explanation]] = {
    "no status": ({"status": None}, WAITING),
    "not ready": ({"status": status(ready=False)}, WAITING),
    "link": ({"age_s": 3.0}, WAITING),
    "no estimate": ({"estimate": None}, WAITING),
    "estimate": ({"estimate": replace(ESTIMATE, valid=False)}, WAITING),
    "no frame": ({"frame": None}, WAITING),
    "stranger": ({"stranger": STRANGER}, STRANGER),
    "outputs": ({"fault": explain(Reason.OUTPUTS_SWAPPED)}, explain(Reason.OUTPUTS_SWAPPED)),
    "hidden": ({"status": status(motor_channels=(1, 4))}, explain(Reason.STICK_HIDDEN, channel=4)),
}


def auto(**told: object) -> SupervisorBench:
    at = {"lat_deg": 40.0, "lon_deg": -86.0, "heading_deg": 90.0}
    bench = SupervisorBench(SupervisorConfig.model_validate({"engage": "auto", "station": at}))
    bench.status = status(**told)
    return bench


def idles(bench: SupervisorBench, spoil: dict[str, Any]) -> list[bool]:
    """Whether a release is said, tick by tick, while nothing else is."""
    for name, value in spoil.items():
        setattr(bench, name, value)
    decisions = [bench.step() for _ in range(8)]
    assert all(d.phase is Phase.STANDBY and not (d.drive or d.neutral or d.prepare) for d in decisions)
    return [d.release for d in decisions]


@pytest.mark.parametrize("name", AUTO_WAITS)
def test_auto_waits_without_a_word_to_the_motors_and_releases_what_it_has_prepared(name: str) -> None:
    spoil, why = AUTO_WAITS[name]
    bench, prepared = auto(), auto(armed=False)
    decision = prepared.step()
    assert decision.prepare and decision.neutral
    assert decision.why == explain(Reason.TAKING_MODE_AND_ARMING, mode="MANUAL")
    assert idles(prepared, spoil) == [True] * 3 + [False] * 5
    assert idles(bench, spoil) == [False] * 8
    assert prepared.step().why == bench.step().why == why


@pytest.mark.parametrize("told", [{"armed": False}, {"mode": "HOLD"}])
def test_auto_asks_for_what_is_missing_of_mode_and_arming_and_then_holds_where_the_config_says(
    told: dict[str, object],
) -> None:
    bench = auto(**told)
    assert bench.step().prepare
    bench.status = status()
    decision = bench.step()
    assert decision.drive and not decision.prepare and decision.why == explain(Reason.HOLDING)
    assert isinstance(decision.station, Station) and (decision.station.n_m, decision.station.e_m) == (0.0, 0.0)
    assert bench.move(n_m=99.0) is None
    refusal = bench.move(n_m=120.0)
    assert refusal is not None and refusal.reason is Reason.STATION_UNCONFIRMED
    assert bench.release().ask_mode == (None if "armed" in told else "HOLD"), "as it was"


def test_a_release_ends_auto_even_before_it_has_begun() -> None:
    bench = auto(ready=False)
    bench.step()
    assert bench.release().answers == (None,)
    bench.status = status()
    assert idles(bench, {}) == [False] * 8
