"""Readback: the outputs that an autopilot reports, compared with the pulses that were sent. Pure.

A residual test decides whether the outputs follow. What they do instead is named only where it turns or exchanges
motors, or where nothing moves: only the parameters show dead zones, scaling and slew limits.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from asvhil.autopilot.bursts import Bursts
from asvhil.autopilot.distortions import Pulses, distortions
from asvhil.autopilot.sent_pulses import SentPulses
from asvhil.config import ReadbackConfig
from asvhil.types import Cause, FrontseatStatus, changed, record

WINDOW_NS = 2_500_000_000  # of reports that are judged together
SETTLE_NS = 250_000_000  # after taking the motors: what is reported may still be of before
KEEP_SENT_NS = WINDOW_NS + 1_500_000_000
MOST_SILENCE_NS = 1_000_000_000  # before a burst of reports, that counts as lag
LEAST_SPAN_NS = 700_000_000  # since the first report that differs, before anything is said
LEAST_DIFFERENCE_NS = 350_000_000  # for which outputs differ, in sum
REPORT_NS = 250_000_000  # a report speaks for the time since the last one, at most for this
STALE_SPAN_NS, STALE_SHARE = 1_900_000_000, 0.6  # of reports that differ, where the outputs only stay as they are
IGNORED_SHARE = 0.1  # of the sticks' reports that differ from all overrides
PLAIN_US = 60.0  # a command this far from neutral must show, whatever the dead zone
STILL_US = 2.0
RC_TOLERANCE_US = 3.0
REST_NS = 1_000_000_000  # for so long sticks of a station that rests explain outputs
DIFFERENT_US = 10.0  # an override must differ this much from the stick to be told from it
RESIDUAL_CAP_US = 100.0  # one late report must not decide
EXPLAINS_SHARE = 0.5  # of the residual that a distortion may leave over to be named
EQUAL_US = 2.0  # residuals closer than this are equal: the simpler distortion is named


@record
class Fault:
    """Why the outputs do not follow the commands; `motor` is port or starboard, empty for both.

    `blind`: the sticks were never reported, so it may be that the autopilot ignores the overrides. `late`: the reports
    come in bursts, so it may be that the link is slow.
    """

    cause: Cause
    motor: str = ""
    blind: bool = False
    late: bool = False


@record
class _Report:
    """One report of two channels (us). `fits`: pulses that it may answer differ from it by the tolerance at most.

    `stale`: none do, but the outputs fitted and have not changed since, as while the link loses commands. `lag_ns`: for
    how long it may have been on its way, with the command. `burst`: it is the last of several that came together.
    """

    t_ns: int
    us: tuple[float, float]
    fits: bool
    stale: bool
    lag_ns: int
    burst: bool


class Readback:
    """The residual test of the outputs while the motors are driven.

    A report may answer any pulses sent within `lag_s` before it came, and differs where it fits none of them. Of those
    that a link delivers together, after a silence, the last one counts alone, and the silence is added to the lag: what
    was not heard meanwhile proves nothing.
    `fault` is what was found, until the motors are taken anew; None while the outputs follow, or it is undecided.
    `differing_ns` is the time of the first report that it was found by.
    """

    def __init__(
        self, config: ReadbackConfig, neutral_us: float, *, overrides_sticks: bool = True, rest_us: float = 60.0
    ) -> None:
        """`neutral_us`: of `vehicle.pwm`, in whose pulses everything here counts, however the boat is wired.

        `rest_us`: how far from neutral the sticks of a ground station may rest that come in turn with our commands.
        """
        self._config = config
        self._neutral_us = neutral_us
        self._overrides_sticks = overrides_sticks
        self._rest_us = rest_us
        self._rests: tuple[int, tuple[float, float]] | None = None  # sticks of a station, and when they were seen
        self._lag_ns = round(config.lag_s * 1e9)
        self._distortions = distortions(self._neutral_us)
        self._sent: deque[tuple[int, tuple[int, int]]] = deque()
        self._outputs: deque[_Report] = deque()
        self._sticks: deque[_Report] = deque()
        self._reported_ns = {"outputs": 0, "rc": 0}
        self._bursts = {"outputs": Bursts(), "rc": Bursts()}
        self._last: dict[str, tuple[float, float] | None] = {"outputs": None, "rc": None}
        self._start_ns: int | None = None
        self._start_us: tuple[float, float] | None = None
        self._stick_us: tuple[float, float] | None = None
        self._judged_ns = 0
        self.override_seen = False  # an override among the sticks, since the motors were taken
        self.follows = False  # outputs that left neutral were seen to follow
        self.fault: Fault | None = None
        self.differing_ns = 0

    def unread_ns(self, t_ns: int) -> int:
        """For how long the motors have been driven without a report of the outputs."""
        return 0 if self._start_ns is None else t_ns - max(self._start_ns, self._reported_ns["outputs"])

    # --- in ------------------------------------------------------------------------------------------------

    def stop(self) -> None:
        """The motors are no longer driven."""
        self._start_ns = None

    def note_sent(self, t_ns: int, pulses_us: tuple[int, int]) -> None:
        """Pulses (port, starboard) that were sent; the first after `stop` begin anew."""
        if self._start_ns is None:
            self._start_ns = t_ns
            self._start_us, self._stick_us = self._last["outputs"], self._last["rc"]
            self._sent.clear()
            self._outputs.clear()
            self._sticks.clear()
            self._rests = None
            self.override_seen = self.follows = False
            self.fault = None
        self._sent.append((t_ns, pulses_us))
        while self._sent[0][0] < t_ns - KEEP_SENT_NS:
            self._sent.popleft()

    def on_status(self, status: FrontseatStatus) -> None:
        """A report of the autopilot, which counts once."""
        if status.sticks_us is not None and status.rc_ns > self._reported_ns["rc"]:
            self._on_report("rc", status.rc_ns, status.sticks_us)
        if status.motors_us is not None and status.outputs_ns > self._reported_ns["outputs"]:
            self._on_report("outputs", status.outputs_ns, status.motors_us)

    def _on_report(self, name: str, t_ns: int, pulses: tuple[int, int]) -> None:
        self._reported_ns[name] = t_ns
        self._bursts[name].take(t_ns)
        us = self._last[name] = (float(pulses[0]), float(pulses[1]))
        if self._start_ns is None or t_ns < self._start_ns + SETTLE_NS:
            return
        if name == "outputs":
            self._keep(self._outputs, t_ns, us, self._config.tolerance_us, self._bursts[name].silence_ns)
            plain = _apart_us(us, (self._neutral_us, self._neutral_us)) > PLAIN_US
            self.follows = self.follows or (plain and self._outputs[-1].fits)
        elif self._overrides_sticks:
            self._note_rest(t_ns, us)
            self._keep(self._sticks, t_ns, us, RC_TOLERANCE_US, self._bursts[name].silence_ns)
            self.override_seen = self.override_seen or self._is_override(t_ns, us)

    def note_station(self, t_ns: int, us: tuple[int, int]) -> None:
        """What the sticks of a ground station command, by its own messages, in turn with ours."""
        pulses = float(us[0]), float(us[1])
        if _apart_us(pulses, (self._neutral_us, self._neutral_us)) <= self._rest_us:
            self._rests = t_ns, pulses

    def _note_rest(self, t_ns: int, us: tuple[float, float]) -> None:
        """Sticks that rest and are not our override: a station's, whose turn it was, once ours have been seen."""
        rests = _apart_us(us, (self._neutral_us, self._neutral_us)) <= self._rest_us
        if rests and self.override_seen and all(_apart_us(sent, us) > RC_TOLERANCE_US for sent in self._recent(t_ns)):
            self._rests = t_ns, us

    def _keep(
        self, reports: deque[_Report], t_ns: int, us: tuple[float, float], tolerance_us: float, silence_ns: int
    ) -> None:
        burst = silence_ns > 0
        if burst and reports:
            reports.pop()  # the one that came just before, which is older
        lag_ns = self._lag_ns + min(silence_ns, MOST_SILENCE_NS)
        fits = any(_apart_us(sent, us) <= tolerance_us for sent in self._recent(t_ns, lag_ns))
        if not fits and self._rests is not None and t_ns - self._rests[0] < REST_NS:
            fits = _apart_us(self._rests[1], us) <= tolerance_us
        last = reports[-1] if reports else None
        stale = not fits and last is not None and (last.fits or last.stale) and _apart_us(last.us, us) <= STILL_US
        reports.append(_Report(t_ns=t_ns, us=us, fits=fits, stale=stale, lag_ns=lag_ns, burst=burst))
        while reports[0].t_ns < t_ns - WINDOW_NS:
            reports.popleft()

    def _recent(self, t_ns: int, lag_ns: int | None = None) -> Iterator[tuple[int, int]]:
        """What a report may be an answer to: sent within the lag, and what stood when that began."""
        lag_ns = self._lag_ns if lag_ns is None else lag_ns
        for sent_ns, us in reversed(self._sent):
            if sent_ns <= t_ns:
                yield us
            if sent_ns <= t_ns - lag_ns:
                return

    def _is_override(self, t_ns: int, us: tuple[float, float]) -> bool:
        """Whether sticks show an override that differs from where they were before."""
        before = self._stick_us or (self._neutral_us, self._neutral_us)
        return any(
            abs(sent[motor] - us[motor]) <= RC_TOLERANCE_US and abs(sent[motor] - before[motor]) > DIFFERENT_US
            for sent in self._recent(t_ns)
            for motor in (0, 1)
        )

    # --- judgement -----------------------------------------------------------------------------------------

    def judge(self, t_ns: int) -> Fault | None:
        """The fault, if there is one. Costs nothing while the outputs follow."""
        if self._start_ns is None or self.fault is not None or not self._outputs:
            return self.fault
        if self._outputs[-1].t_ns == self._judged_ns:
            return None  # nothing new
        self._judged_ns = self._outputs[-1].t_ns
        first = next((n for n, report in enumerate(self._outputs) if not report.fits), None)
        if first is None:
            return None
        reports = list(self._outputs)[first:]  # what fitted before says nothing about what does not since
        span_ns = t_ns - reports[0].t_ns
        if span_ns >= LEAST_SPAN_NS and _time_ns(reports, stale=True) >= LEAST_DIFFERENCE_NS:
            self.fault = self._explain(t_ns, reports)
            self.differing_ns = reports[0].t_ns
        return self.fault

    def _explain(self, t_ns: int, reports: list[_Report]) -> Fault | None:
        """What the outputs do instead; None while it is not certain that they do not follow."""
        if self._is_ignored():
            return Fault(cause=Cause.IGNORED)
        span_ns = t_ns - reports[0].t_ns
        sent = SentPulses(self._sent, [report.t_ns for report in reports], [report.lag_ns for report in reports])
        reported = np.array([report.us for report in reports])
        stuck = self._stuck(sent, reported)
        if stuck is not None:
            # Sticks that were reported before will be again, and show then whether the overrides are ignored.
            waits = stuck.blind and self._stick_us is not None and span_ns < 2 * LEAST_SPAN_NS
            return None if waits else stuck
        missed = sum(not report.fits for report in reports)
        stays = span_ns >= STALE_SPAN_NS and missed >= STALE_SHARE * len(reports)
        if _time_ns(reports, stale=False) < LEAST_DIFFERENCE_NS and not stays:
            return None
        return changed(self._named(sent, reported), late=any(report.burst for report in reports))

    def _is_ignored(self) -> bool:
        """Whether the autopilot shows sticks that have never been our overrides."""
        missed = sum(not report.fits for report in self._sticks)
        return not self.override_seen and missed > IGNORED_SHARE * len(self._sticks)

    def _stuck(self, sent: SentPulses, reported: Pulses) -> Fault | None:
        """Outputs that are where they were before the motors were taken, whatever plain commands they get."""
        start = reported[0] if self._start_us is None else np.array(self._start_us)
        moves = (np.abs(reported - start) > STILL_US).any(axis=0)
        plain = sent.least(np.abs(sent.pulses - start)) > PLAIN_US
        still = ~moves & (np.count_nonzero(plain, axis=0) >= 2)
        if still.all():
            blind = self._overrides_sticks and not self._sticks and bool(reported.any())
            return Fault(cause=Cause.STUCK, blind=blind)
        if not still.any():
            return None
        other = int(np.flatnonzero(~still)[0])
        follows = sent.residuals_us(sent.pulses[:, [other]], reported[:, [other]]).max() <= self._config.tolerance_us
        return Fault(cause=Cause.STUCK, motor="starboard" if other == 0 else "port") if follows else None

    def _named(self, sent: SentPulses, reported: Pulses) -> Fault:
        """The simplest distortion that explains the reports plainly better than the commands themselves do."""
        expected = [sent.pulses, *(distortion.apply(sent.pulses) for distortion in self._distortions)]
        residuals = [np.minimum(sent.residuals_us(pulses, reported), RESIDUAL_CAP_US).mean() for pulses in expected]
        undistorted_us, *distorted_us = residuals
        if min(distorted_us) > EXPLAINS_SHARE * undistorted_us:
            return Fault(cause=Cause.UNEXPLAINED)
        best = next(n for n, residual_us in enumerate(distorted_us) if residual_us <= min(distorted_us) + EQUAL_US)
        return Fault(cause=self._distortions[best].cause, motor=self._distortions[best].motor)


def _apart_us(a: tuple[float, float], b: tuple[float, float]) -> float:
    """How far two pairs of pulses are apart, by the worse motor."""
    return max(abs(a[0] - b[0]), abs(a[1] - b[1]))


def _time_ns(reports: Sequence[_Report], *, stale: bool) -> int:
    """For how long reports have differed, in sum; `stale`: those that only stay as they were count too."""
    # Each report speaks for the time until the next, the last for as long as the one before it.
    spans = [later.t_ns - report.t_ns for report, later in pairwise(reports)]
    spans.append(spans[-1] if spans else REPORT_NS)
    return sum(
        min(span_ns, REPORT_NS)
        for report, span_ns in zip(reports, spans, strict=True)
        if not report.fits and (stale or not report.stale)
    )
