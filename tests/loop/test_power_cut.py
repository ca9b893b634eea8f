"""The log of a whole run whose power is cut: what `asvhil log recover` makes of it. Fifty cuts: bench/power_cuts.py."""

from __future__ import annotations

import pytest

from bench.power_cuts import ASKED_S, TAILS, one


@pytest.mark.real_time
@pytest.mark.parametrize("seed", [TAILS.index("zeros"), TAILS.index("a part")])
def test_a_power_cut_costs_at_most_half_a_second(seed: int) -> None:
    cut = one(seed, rerun=None, node=None)
    assert cut["status"] == 3, cut
    assert cut["lost_s"] <= ASKED_S
    assert cut["exact"] and cut["ticks"] > 5
