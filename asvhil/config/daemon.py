"""The daemon's own keys: the rate of its ticks, and where and how it writes its log."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from asvhil.config.base import Positive, Section


class DaemonConfig(Section):
    """When the daemon cuts its inputs into a tick, and how often a tick computes a new control."""

    control_hz: float = Field(
        default=5.0,
        ge=1.0,
        le=100.0,
        description="Rate at which the controller computes a new command; the shipped gains are tuned at 5 Hz.",
    )
    tick_hz: float = Field(
        default=20.0,
        ge=10.0,
        le=100.0,
        description=(
            "Rate of the timer's ticks, a whole multiple of control_hz. Each tick decodes what has arrived, updates "
            "the estimate, checks for the pilot and sends the motor command again."
        ),
    )
    cut_on: Literal["timer", "arrival"] = Field(
        default="timer",
        description=(
            "`timer`: ticks only at tick_hz. `arrival`: also as soon as a frame of the autopilot or of a sensor has "
            "arrived, which shortens the delay from sensor to motor; the control rate stays."
        ),
    )
    arrival_hz_max: float = Field(
        default=200.0,
        ge=10.0,
        le=1000.0,
        description="With `cut_on: arrival`: the highest mean rate of ticks that arrivals may cause.",
    )

    terminal_lost: Literal["hold", "release"] = Field(
        default="hold",
        description=(
            "What becomes of a run whose terminal hangs up (SIGHUP), as when a connection by ssh breaks. `hold`: it "
            "goes on without a terminal, in whatever phase, with a note: nobody has asked for an end, and a boat that "
            "is held is safer than one adrift; `asvhil release`, the pilot and SIGTERM reach it as before. `release`: "
            "neutral, release and the end, as on SIGTERM."
        ),
    )

    guardian: bool = Field(
        default=True,
        description=(
            "Whether a small process of its own sends neutral and release if the daemon dies without having done so "
            "(killed, crashed, out of memory). It does nothing else. Without it the autopilot's own time-out remains."
        ),
    )
    guardian_lost: Literal["hold", "release"] = Field(
        default="hold",
        description=(
            "What becomes of a hold when the guardian dies. It is started again at once in either case, with a note. "
            "`hold`: the hold goes on. `release`: neutral and release, as by an operator."
        ),
    )

    @model_validator(mode="after")
    def _check_rates(self) -> DaemonConfig:
        ratio = self.tick_hz / self.control_hz
        if abs(ratio - round(ratio)) > 1e-9:
            raise ValueError("tick_hz must be a whole multiple of control_hz")
        return self

    @property
    def ticks_per_control(self) -> int:
        """How many ticks of the timer there are for each control."""
        return round(self.tick_hz / self.control_hz)


class RecorderConfig(Section):
    """The log of a run: one MCAP file, or segments of it."""

    directory: str = Field(
        default="runs",
        description=(
            "Folder for the logs, absolute or relative to the working directory. Each run makes a folder in it."
        ),
    )
    chunk_kib: int = Field(
        default=128,
        ge=16,
        le=4096,
        description="Size (KiB) at which a chunk of the file is compressed and written.",
    )
    sync_period_s: Positive = Field(
        default=0.25,
        description="At the latest after this time a chunk is written and synced to disk: what a power cut can cost.",
    )
    segment_mb: float = Field(
        default=0.0,
        ge=0.0,
        description=(
            "Size (MB) at which a log's file is ended and the log goes on in another: log.mcap, log-001.mcap, ... Each "
            "opens by itself; 0: one file. A file is larger by up to a chunk, its index, and what a run's config and "
            "model take."
        ),
    )
    segment_s: float = Field(
        default=0.0,
        ge=0.0,
        description="The same by time (s); 0: never. Both may be given, the first that is reached counts.",
    )

    @model_validator(mode="after")
    def _check_segments(self) -> RecorderConfig:
        if 0.0 < self.segment_mb < 1.0 or 0.0 < self.segment_s < 10.0:
            raise ValueError("segment_mb must be 0 or at least 1, segment_s 0 or at least 10")
        return self
