"""Output read-back: what the autopilot's outputs do, held against what they were told, and why they differ. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence

import numpy as np

from asvhil.autopilot.distortions import Pulses, slewed, ways
from asvhil.config import PwmConfig, ReadbackConfig
from asvhil.types import Cause, FrontseatStatus, record

WINDOW_NS = 2_500_000_000  # of reports that are judged together
SETTLE_NS = 250_000_000  # after taking the motors: what is reported may still be of before
KEEP_SENT_NS = WINDOW_NS + 1_500_000_000
LEAST_SPAN_NS = 700_000_000  # of outputs that differ, before anything is said
LEAST_REPORTS, LEAST_REPORTS_SLOW = 4, 2
SLOW_SPAN_NS = 1_500_000_000  # after which few reports must do
UNEXPLAINED_SPAN_NS = 1_900_000_000
UNEXPLAINED_SHARE = 0.6
SPARED_SHARE = 0.1  # of the reports that an explanation may leave over
PLAIN_US = 60.0  # a command this far from neutral must show, whatever the dead zone
STILL_US = 2.0
SLEW_RATES_US_PER_S = (50.0, 75.0, 100.0, 150.0, 200.0, 250.0, 300.0, 400.0, 500.0, 600.0, 800.0, 1000.0, 1500.0)
SLEW_LAG_S = 0.25
SLEW_STEP_S = 0.05  # between two commands
RC_TOLERANCE_US = 3.0
HEARD_US = 10.0  # an override must differ this much from the stick to be told from it


@record
class Fault:
    """Why the outputs do not do what they are told; `motor` is port or starboard, empty for both.

    `size` is that of a dead zone (us). `blind`: the sticks were never reported, so it may be that nobody listens to us.
    """

    cause: Cause
    motor: str = ""
    size: float = 0.0
    blind: bool = False


@record
class _Report:
    """What one report said, and whether it fits anything that it may be an answer to."""

    t_ns: int
    us: tuple[float, float]
    fits: bool


class Readback:
    """Judges each report of the outputs while we drive. An answer may come within `lag_s`, so each report is held
    against all that was sent in that time: it differs only where it fits none.

    `fault` is what was found, until the motors are taken anew; None while all is well, or undecided.
    """

    def __init__(self, config: ReadbackConfig, pwm: PwmConfig, *, overrides_sticks: bool = True) -> None:
        self._config = config
        self._neutral_us = float(pwm.neutral_us)
        self._channels = (pwm.port_channel - 1, pwm.starboard_channel - 1)
        self._overrides_sticks = overrides_sticks
        self._lag_ns = round(config.lag_s * 1e9)
        self._groups = ways(self._neutral_us)
        self._sent: deque[tuple[int, tuple[int, int]]] = deque()
        self._outputs: deque[_Report] = deque()
        self._sticks: deque[_Report] = deque()
        self._seen_ns = {"outputs": 0, "rc": 0}
        self._last: dict[str, tuple[float, float] | None] = {"outputs": None, "rc": None}
        self._start_ns: int | None = None
        self._start_us: tuple[float, float] | None = None
        self._stick_us: tuple[float, float] | None = None
        self._judged_ns = 0
        self.heard = False  # an override of ours was seen among the sticks since the motors were taken
        self.follows = False  # outputs that left neutral were seen to follow
        self.fault: Fault | None = None

    def unread_ns(self, t_ns: int) -> int:
        """For how long the motors have been driven without a report of the outputs."""
        return 0 if self._start_ns is None else t_ns - max(self._start_ns, self._seen_ns["outputs"])

    # --- in ------------------------------------------------------------------------------------------------

    def stop(self) -> None:
        """The motors are not ours."""
        self._start_ns = None

    def sent(self, t_ns: int, pulses_us: tuple[int, int]) -> None:
        """Pulses go out while we drive; the first after `stop` begin anew."""
        if self._start_ns is None:
            self._start_ns = t_ns
            self._start_us, self._stick_us = self._last["outputs"], self._last["rc"]
            self._sent.clear()
            self._outputs.clear()
            self._sticks.clear()
            self.heard = self.follows = False
            self.fault = None
        self._sent.append((t_ns, pulses_us))
        while self._sent[0][0] < t_ns - KEEP_SENT_NS:
            self._sent.popleft()

    def on_status(self, status: FrontseatStatus) -> None:
        """A report of the autopilot, which counts once."""
        for name, t_ns, values in (
            ("rc", status.rc_ns, status.rc_us),
            ("outputs", status.outputs_ns, status.outputs_us),
        ):
            if t_ns <= self._seen_ns[name] or len(values) <= max(self._channels):
                continue
            self._seen_ns[name] = t_ns
            port, starboard = self._channels
            us = self._last[name] = (float(values[port]), float(values[starboard]))
            if self._start_ns is None or t_ns < self._start_ns + SETTLE_NS:
                continue
            if name == "outputs":
                self._keep(self._outputs, t_ns, us, self._config.tolerance_us)
                plain = max(abs(us[0] - self._neutral_us), abs(us[1] - self._neutral_us)) > PLAIN_US
                self.follows = self.follows or (plain and self._outputs[-1].fits)
            elif self._overrides_sticks:
                self._keep(self._sticks, t_ns, us, RC_TOLERANCE_US)
                self.heard = self.heard or self._is_ours(t_ns, us)

    def _keep(self, reports: deque[_Report], t_ns: int, us: tuple[float, float], tolerance_us: float) -> None:
        fits = any(
            abs(sent[0] - us[0]) <= tolerance_us and abs(sent[1] - us[1]) <= tolerance_us for sent in self._recent(t_ns)
        )
        reports.append(_Report(t_ns=t_ns, us=us, fits=fits))
        while reports[0].t_ns < t_ns - WINDOW_NS:
            reports.popleft()

    def _recent(self, t_ns: int) -> Iterator[tuple[int, int]]:
        """What a report may be an answer to: sent within the lag, and what stood when that began."""
        for sent_ns, us in reversed(self._sent):
            if sent_ns <= t_ns:
                yield us
            if sent_ns <= t_ns - self._lag_ns:
                return

    def _is_ours(self, t_ns: int, us: tuple[float, float]) -> bool:
        """Whether sticks show an override that differs from where they were before."""
        before = self._stick_us or (self._neutral_us, self._neutral_us)
        return any(
            abs(sent[motor] - us[motor]) <= RC_TOLERANCE_US and abs(sent[motor] - before[motor]) > HEARD_US
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
        reports = list(self._outputs)[first:]  # what was right before tells nothing of what is wrong since
        missed = sum(not report.fits for report in reports)
        span_ns = t_ns - reports[0].t_ns
        slow = missed < LEAST_REPORTS
        if missed < LEAST_REPORTS_SLOW or span_ns < (SLOW_SPAN_NS if slow else LEAST_SPAN_NS):
            return None
        self.fault = self._explain(t_ns, reports, missed)
        if self.fault is None and missed >= UNEXPLAINED_SHARE * len(reports) and span_ns >= UNEXPLAINED_SPAN_NS:
            self.fault = Fault(cause=Cause.UNEXPLAINED)
        return self.fault

    def _explain(self, t_ns: int, reports: list[_Report], missed: int) -> Fault | None:
        """The plainest explanation that leaves hardly a report over; None where there is none (yet)."""
        if self._unheard():
            return Fault(cause=Cause.IGNORED)
        reported_ns = [report.t_ns for report in reports]
        reported = np.array([report.us for report in reports])
        told = SentPulses(self._sent, reported_ns, self._lag_ns)
        still = self._still(told, reported)
        if still is not None:
            # Sticks that were reported before will be again, and then it is known whether we are listened to.
            waits = still.blind and self._stick_us is not None and t_ns - reported_ns[0] < SLOW_SPAN_NS
            return None if waits else still
        good = min(SPARED_SHARE * len(reported), missed - LEAST_REPORTS_SLOW)
        for group in self._groups:
            scores = [told.score(way.apply(told.pulses), reported, self._config.tolerance_us) for way in group]
            best = min(range(len(group)), key=scores.__getitem__)
            if scores[best][0] <= good:
                return Fault(cause=group[best].cause, motor=group[best].motor, size=group[best].size)
        return Fault(cause=Cause.SLEW) if self._slew_misses(reported_ns, reported) <= good else None

    def _unheard(self) -> bool:
        """Whether the autopilot shows sticks that have never been our overrides."""
        missed = sum(not report.fits for report in self._sticks)
        return not self.heard and missed > SPARED_SHARE * len(self._sticks)

    def _still(self, told: SentPulses, reported: Pulses) -> Fault | None:
        """Outputs that are where they were before, whatever plain commands they get."""
        start = reported[0] if self._start_us is None else np.array(self._start_us)
        moves = (np.abs(reported - start) > STILL_US).any(axis=0)
        plain = told.least(np.abs(told.pulses - start)) > PLAIN_US
        still = ~moves & (np.count_nonzero(plain, axis=0) >= LEAST_REPORTS_SLOW)
        if still.all():
            blind = self._overrides_sticks and not self._sticks and bool(reported.any())
            return Fault(cause=Cause.STUCK, blind=blind)
        if not still.any():
            return None
        other = int(np.flatnonzero(~still)[0])
        misses, _ = told.score(told.pulses[:, [other]], reported[:, [other]], self._config.tolerance_us)
        return Fault(cause=Cause.STUCK, motor="starboard" if other == 0 else "port") if misses == 0 else None

    def _slew_misses(self, reported_ns: list[int], reported: Pulses) -> int:
        """Reports that no limit on the throttle's rate explains: steering as told, throttle on its way there."""
        first_ns = self._sent[0][0]
        t_s = np.array([sent_ns - first_ns for sent_ns, _ in self._sent]) * 1e-9
        pulses = np.array([us for _, us in self._sent], dtype=float)
        throttle, steering = pulses.mean(axis=1), pulses[:, 0] - pulses[:, 1]
        start_us = throttle[0] if self._start_us is None else float(np.mean(self._start_us))
        tolerance_us = self._config.tolerance_us
        at_s = (np.array(reported_ns) - first_ns) * 1e-9
        age_s = at_s[:, None] - t_s[None, :]
        recent = (age_s >= 0.0) & (age_s <= SLEW_LAG_S)
        turned = np.abs((reported[:, 0] - reported[:, 1])[:, None] - steering) <= 2.0 * tolerance_us
        turns = (turned & recent).any(axis=1)
        mean_us = reported.mean(axis=1)
        # Steering on top of a throttle that lags may be more than a motor can: then both are cut to keep their ratio.
        beyond_us = np.abs(reported - self._neutral_us).max(axis=1) - np.abs(pulses - self._neutral_us).max()
        counts = beyond_us <= tolerance_us
        least = len(reported)
        for rate in SLEW_RATES_US_PER_S:
            path_us = slewed(t_s, throttle, rate, start_us)
            low_us = np.where(recent, path_us, np.inf).min(axis=1)
            high_us = np.where(recent, path_us, -np.inf).max(axis=1)
            slack_us = tolerance_us + rate * SLEW_STEP_S
            on_way = (mean_us >= low_us - slack_us) & (mean_us <= high_us + slack_us)
            least = min(least, int(np.count_nonzero(~(on_way & turns) & counts)))
        return least


class SentPulses:
    """Pulses sent (rows), and for each report which of them it may be an answer to."""

    def __init__(self, sent: Sequence[tuple[int, tuple[int, int]]], reported_ns: list[int], lag_ns: int) -> None:
        times = np.array([t_ns for t_ns, _ in sent])
        self.pulses: Pulses = np.array([us for _, us in sent], dtype=float)
        self._answers = np.zeros((len(reported_ns), len(times)), dtype=bool)
        for row, t_ns in enumerate(reported_ns):
            stood = int(np.searchsorted(times, t_ns - lag_ns, side="right")) - 1
            self._answers[row, max(stood, 0) : int(np.searchsorted(times, t_ns, side="right"))] = True

    def score(self, expected: Pulses, reported: Pulses, tolerance_us: float) -> tuple[int, int]:
        """How many reports are not as expected of anything they may answer, and the mean error of the others, whole us.

        Both motors must fit by the same pulses: they went out in one message.
        """
        off_us = np.abs(reported[:, None, :] - expected[None, :, :]).max(axis=2)
        least_us = np.where(self._answers, off_us, np.inf).min(axis=1)
        fits = least_us <= tolerance_us
        return int(np.count_nonzero(~fits)), round(float(least_us[fits].mean())) if fits.any() else 0

    def least(self, values: Pulses) -> Pulses:
        """The least of a value of the pulses among those that a report may answer, by report and motor."""
        found: Pulses = np.where(self._answers[:, :, None], values[None, :, :], np.inf).min(axis=1)
        return found
