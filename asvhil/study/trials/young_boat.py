"""A boat that is new, in a process of its own: what a tick takes on this computer now, whatever has run before."""

from __future__ import annotations

import multiprocessing
import signal
import time
from concurrent.futures import ProcessPoolExecutor
from types import TracebackType

from asvhil.config import Config, config_from_json
from asvhil.config.plugins import PluginFile, load_files
from asvhil.simplant.lockstep import Lockstep
from asvhil.study.trials.interrupts import interrupts_held_back, let_through
from asvhil.types import Outputs

SETTLES_S = 20.0
_boats: list[Lockstep] = []  # of the process that runs it


class YoungBoat:
    """Within `with`; built anew by `renew`. Its memory is that of its process alone."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._process = ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"))

    def __enter__(self) -> YoungBoat:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._process.shutdown(cancel_futures=True)

    def renew(self) -> None:
        """Another new boat, which has settled."""
        with interrupts_held_back():  # the first call starts the process
            renewed = self._process.submit(_renew, self._config.plugins, self._config.canonical_json())
        renewed.result()

    def ticks_ms(self, count: int) -> list[float]:
        """The processor time of so many of its ticks (ms)."""
        return self._process.submit(_ticks_ms, count).result()


def timed_ms(loop: Lockstep) -> tuple[float, Outputs]:
    """The processor time of a tick (ms), and its outputs."""
    start_s = time.process_time()
    _, outputs = loop.tick()
    return 1e3 * (time.process_time() - start_s), outputs


def _renew(plugins: tuple[PluginFile, ...], text: str) -> None:
    let_through(signal.SIGTERM)
    load_files(plugins)
    config = config_from_json(text, "the config of the new boat")
    _boats[:] = [Lockstep(config)]
    _ticks_ms(round(SETTLES_S * config.daemon.tick_hz))


def _ticks_ms(count: int) -> list[float]:
    return [timed_ms(_boats[0])[0] for _ in range(count)]
