"""Reports that a link delivers several at once."""

from __future__ import annotations

from asvhil.autopilot.bursts import Bursts

MS = 1_000_000


def silences(times_ms: list[float]) -> list[int]:
    """The silence (ms) before the burst that each report is one of; 0: it came alone."""
    bursts, found = Bursts(), []
    for t_ms in times_ms:
        bursts.take(round(t_ms * MS))
        found.append(bursts.silence_ns // MS)
    return found


def test_reports_that_come_together_after_a_silence_are_a_burst() -> None:
    assert silences([0, 100, 200, 800, 801, 802, 1400, 1401]) == [0, 0, 0, 0, 600, 600, 0, 598]


def test_a_fast_stream_with_a_pause_is_no_burst_that_goes_on() -> None:
    """Such as of 100 Hz: after a pause two reports may be near the first; the others came in their time."""
    times = [10.0 * k for k in range(20)] + [500.0 + 10.0 * k for k in range(200)]
    found = silences(times)
    assert found[:21] == [0] * 21 and found[21:23] == [310, 310] and found[23:] == [0] * 197
