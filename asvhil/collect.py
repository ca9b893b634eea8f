"""Data collection: the predefined manoeuvres on the vehicle, or the simulated boat in real time or in lockstep."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from asvhil.config import Config, config_from_json
from asvhil.config.mean_wind import WindSector, wind_keys
from asvhil.daemon.daemon import Daemon
from asvhil.daemon.status import StatusTeller
from asvhil.errors import AsvhilError, ConfigError
from asvhil.files import is_there
from asvhil.links.clock import Clock
from asvhil.logs.encoding import decode_outputs
from asvhil.logs.opening import make_run_folder, open_recorder
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import config_of
from asvhil.logs.segments import segment_path
from asvhil.simplant.lockstep import Lockstep
from asvhil.sitl import run_realtime
from asvhil.types import FrontseatStatus, Outputs, Phase, record

Mode = Literal["lockstep", "realtime", "vehicle"]
Status = dict[str, Any]

ENGAGE_S = 60.0  # simulated: within this time the boat is armed and engaged, or something is wrong
START_S = 12.0  # what a simulated boat takes to boot and engage, in real time
SETTLE_S = 0.5  # the motors are ours a little longer than the programme lasts
STATUS_HZ = 2.0
TRAINING_SEED = 1000  # added to plant.seed: tests use small ones, and no gust of a test is to be trained on


@record
class Collected:
    """The result of one run: its log, whether the programme was `complete`, and the `reason` if not."""

    log: Path
    note: str
    held_s: float
    complete: bool
    reason: str
    wall_s: float


def with_manoeuvres(
    config: Config, duration_s: float, wind: WindSector | None = None, note: str = "", run: int = 0
) -> Config:
    """The config of one condition: manoeuvres for a time, its weather, and a note of both for the log.

    The seeds of programme, weather and sensors depend on the number of the run, so that no two are alike. Those of
    weather and sensors are `TRAINING_SEED` above the config's.
    """
    tree = config.model_dump(mode="json")
    manoeuvres, weather = tree["controller"]["manoeuvres"], tree["plant"]["weather"]["wind"]
    tree["controller"]["name"] = "manoeuvres"
    manoeuvres["duration_s"] = duration_s
    manoeuvres["seed"] += run
    tree["plant"]["seed"] += TRAINING_SEED + run
    if wind is not None:
        weather |= wind_keys(wind, config)
    manoeuvres["note"] = note or manoeuvres["note"]
    if wind is not None:
        sector = f"wind {wind.speed_mps:g} m/s toward {wind.toward_deg:g} deg from the station's heading"
        manoeuvres["note"] = "; ".join(part for part in (sector, manoeuvres["note"]) if part)
    return config_from_json(json.dumps(tree), "collect")


def log_paths(output: Path | None, folder: Path, winds: Sequence[WindSector | None]) -> list[Path]:
    """A log for each wind: the output as it is where there is one, else its name with the wind in it.

    ConfigError where the output is no name of a log.
    """
    base = output if output is not None else folder / "log.mcap"
    if base.suffix != ".mcap":
        raise ConfigError(f"--output {base}: a log ends in .mcap, such as {base.name}.mcap")
    if len(winds) < 2:
        return [base]
    names = ["" if wind is None else f"-{wind.speed_mps:g}mps-{wind.toward_deg:g}deg" for wind in winds]
    twice = len(set(names)) < len(names)
    return [base.with_name(f"{base.stem}{name}{f'-{i + 1}' if twice else ''}.mcap") for i, name in enumerate(names)]


def collect(
    config: Config,
    mode: Mode,
    duration_s: float = 600.0,
    winds: Sequence[WindSector] = (),
    output: Path | None = None,
    note: str = "",
    on_status: Callable[[int, Status], None] = lambda run, status: None,
    on_start: Callable[[int, Path, str], None] = lambda run, log, note: None,
    watches: Mapping[str, Callable[[], str]] = MappingProxyType({}),
    skip: Collection[Path] = (),
) -> list[Collected]:
    """Drive the manoeuvres once for each wind and write a log each; `on_status` comes twice a second of boat time.

    `skip`: logs that are there already, of which no other drive is made; they are not among the results.

    `watches`, by subject, tell a real vehicle's operators what is wrong outside, such as with the display.

    Ends at the first incomplete run. Raises ConfigError where the mode cannot work with the config, and
    AsvhilError where a simulated boat never engaged.
    """
    if mode == "vehicle":
        if winds:
            raise ConfigError("--wind: nobody makes the wind for a real vehicle; say what it was with --note")
        if config.supervisor.engage != "command":
            raise ConfigError(
                "key supervisor.engage: a real vehicle needs command (the pilot arms, `asvhil hold` engages)"
            )
    elif config.supervisor.engage != "auto":
        raise ConfigError("key supervisor.engage: a simulated boat needs auto (nobody is there to say hold)")
    sectors: list[WindSector | None] = list(winds) or [None]
    # The first run's config: its controller is that of the manoeuvres, whatever the boat's own one needs.
    first = with_manoeuvres(config, duration_s, sectors[0], note, 0)
    given = None if output is None else log_paths(output, output.parent, sectors)
    _refuse_there([log for log in given or () if log not in skip])
    folder = make_run_folder(first, "collect") if output is None or mode == "realtime" else output.parent
    logs = log_paths(None, folder, sectors) if given is None else given
    results: list[Collected] = []
    for run, (wind, log) in enumerate(zip(sectors, logs, strict=True)):
        if log in skip:
            continue
        settings = with_manoeuvres(config, duration_s, wind, note, run)
        watch = _Watch(settings, duration_s, lambda status, run=run: on_status(run, status))  # type: ignore[misc]
        on_start(run, log, settings.controller.manoeuvres.note)
        start_s = time.perf_counter()
        if mode == "lockstep":
            _lockstep(settings, log, watch)
        elif mode == "realtime":
            run_realtime(settings, _subfolder(folder, run, len(sectors)), log, START_S + duration_s, watch.see_status)
        else:
            _vehicle(settings, log, watch, watches)
        results.append(watch.result(log, time.perf_counter() - start_s))
        if not results[-1].complete:
            break
    return results


def _refuse_there(logs: Sequence[Path]) -> None:
    """ConfigError, before the first drive, where the log of any is there already, or the next segment of one."""
    for log in logs:
        for path in (log, segment_path(log, 1)):
            if is_there(path):
                raise ConfigError(f"{path}: is there already, and no log is overwritten; give another name")


def recorded(log: Path) -> Collected:
    """What a log holds of its programme, as `collect` told it at the end, but for the time that the drive took.

    LogError where it is no log, or damaged in the middle; ConfigError where it is of no manoeuvres.
    """
    file = LogFile(log)
    config = config_of(file, log, known_only=True)
    if config.controller.name != "manoeuvres":
        raise ConfigError(f"{log}: is of the controller {config.controller.name}, and a drive of manoeuvres is needed")
    watch = _Watch(config, config.controller.manoeuvres.duration_s)
    start_ns: int | None = None
    for inputs, outputs in file.ticks():
        start_ns = inputs.t_ns if start_ns is None else start_ns
        if outputs is not None:
            found = decode_outputs(outputs, log)
            watch.note_phase((inputs.t_ns - start_ns) * 1e-9, found.phase, found.health.reason)
    return watch.result(log, 0.0)


class _Watch:
    """Monitors one run by its ticks or its status: since when it holds, and how it ended."""

    def __init__(
        self, config: Config, duration_s: float, on_status: Callable[[Status], None] = lambda status: None
    ) -> None:
        self._note = config.controller.manoeuvres.note
        self._duration_s = duration_s
        self._on_status = on_status
        self._every = max(1, round(config.daemon.tick_hz / STATUS_HZ))
        self._ticks = 0
        self._teller = StatusTeller(config)
        self._start_ns: int | None = None
        self._held_from_s: float | None = None
        self.held_s = 0.0
        self.over = False  # the programme is at its end, or the motors were given back before it
        self._reason = "never engaged"

    def see(
        self, outputs: Outputs, links: dict[str, str] | None = None, vehicle: FrontseatStatus | None = None
    ) -> None:
        """One tick of a backseat in this process; `vehicle`: what its autopilot says of itself."""
        self._teller.see(outputs)
        self._start_ns = outputs.t_ns if self._start_ns is None else self._start_ns
        t_s = (outputs.t_ns - self._start_ns) * 1e-9
        self.note_phase(t_s, outputs.phase, outputs.health.reason)
        self._ticks += 1
        if self._ticks % self._every == 0:
            self._tell(self._teller.status(outputs, links or {}, 0, vehicle))

    def see_status(self, status: Status) -> None:
        """One status line of a daemon in another process."""
        self.note_phase(float(status["t_s"]), str(status["phase"]), str(status["reason"]))
        self._tell(status)

    @property
    def holding(self) -> bool:
        """Whether the hold has begun."""
        return self._held_from_s is not None

    @property
    def complete(self) -> bool:
        """Whether the motors were held for the whole programme; a status line comes only twice a second."""
        return self.held_s >= self._duration_s - 1.5 / STATUS_HZ

    def result(self, log: Path, wall_s: float) -> Collected:
        return Collected(
            log=log,
            note=self._note,
            held_s=min(self.held_s, self._duration_s),
            complete=self.complete,
            reason="" if self.complete else self._reason,
            wall_s=wall_s,
        )

    def note_phase(self, t_s: float, phase: str, reason: str) -> None:
        """The phase at a time (s) since the first tick."""
        if self.over:
            return
        if phase in (Phase.HOLD, Phase.FAILSAFE):
            self._held_from_s = t_s if self._held_from_s is None else self._held_from_s
            self.held_s = t_s - self._held_from_s
            self.over = self.held_s >= self._duration_s + SETTLE_S
        elif self.holding:
            self._reason, self.over = reason, True
        if not self.over and reason:
            self._reason = reason

    def _tell(self, status: Status) -> None:
        self._on_status({**status, "held_s": self.held_s, "duration_s": self._duration_s})


def _lockstep(config: Config, log: Path, watch: _Watch) -> None:
    recorder = open_recorder(config, log, "lockstep", threaded=False)  # virtual time waits for the disk
    try:
        loop = Lockstep(config, recorder)
        while not watch.over:
            _, outputs = loop.tick()
            watch.see(outputs)
            if not watch.holding and loop.ticks > ENGAGE_S * config.daemon.tick_hz:
                raise AsvhilError(f"the simulated boat did not engage in {ENGAGE_S:.0f} s: {outputs.health.reason}")
        loop.run(0.0, watch.see)  # let go
    finally:
        recorder.close()
    if recorder.error is not None:
        raise recorder.error


def _vehicle(config: Config, log: Path, watch: _Watch, watches: Mapping[str, Callable[[], str]]) -> None:
    """Run the daemon as `asvhil run` does: it waits for `asvhil hold`, and releases at the end of the programme."""
    recorder = open_recorder(config, log, "live")
    try:
        daemon: Daemon

        def see(outputs: Outputs, links: dict[str, str]) -> None:
            watch.see(outputs, links, daemon.vehicle)
            if watch.over:
                daemon.stop()

        daemon = Daemon(config, recorder, Clock(), on_tick=see, watches=watches)
        asyncio.run(daemon.run())
    finally:
        recorder.close()
    if recorder.error is not None:
        raise recorder.error


def _subfolder(folder: Path, run: int, runs: int) -> Path:
    """The folder for the files of a run of two processes."""
    if runs < 2:
        return folder
    own = folder / f"run-{run + 1}"
    own.mkdir(exist_ok=True)
    return own
