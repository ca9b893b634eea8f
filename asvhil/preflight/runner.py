"""The asyncio shell of a preflight: the daemon's own links, with a survey at their end in the place of the backseat."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Coroutine
from typing import Any

from asvhil.autopilot.requirements import Finding
from asvhil.config import Config
from asvhil.config.ports import AUTOPILOT
from asvhil.errors import AsvhilError, LinkError
from asvhil.preflight.survey import Survey
from asvhil.preflight.visit import Visit, in_brackets, unopened_text
from asvhil.supervisor.reasons import describe

TICK_S = 0.05
BROKEN_S = 2.0  # a link that cannot be opened is told after this
FIX_S = 30.0
BOOT_S = 60.0  # of an autopilot that sets itself up, beyond the wait for its first heartbeat

Choose = Callable[[list[Finding]], Coroutine[Any, Any, bool]]


class Preflight:
    """One look at the vehicle, and what is written to it if that is asked for."""

    def __init__(
        self, config: Config, timeout_s: float, on_tick: Callable[[Survey], None] = lambda survey: None
    ) -> None:
        self._config = config
        self._timeout_s = timeout_s
        self._on_tick = on_tick
        self.survey = Survey(config)
        self._visit = Visit(config)

    async def run(self, choose: Choose | None = None) -> list[Finding]:
        """Look, until all is known. With `choose`, ask it whether to write what is wrong; what was written.

        Raises LinkError in one line where no autopilot is heard.
        """
        async with self._visit:
            await self._until_done()
            wrong = self.survey.fixable
            write = choose is not None and bool(wrong) and await self._chosen(choose(wrong))
            if write:
                await self._write(wrong)
            await self._until_done()  # an autopilot that has restarted since is looked at anew
            return wrong if write else []

    async def _chosen(self, answer: Coroutine[Any, Any, bool]) -> bool:
        """The answer. The survey goes on meanwhile: a vehicle that is armed during the question is not written to."""
        asked = asyncio.create_task(answer)
        try:
            await self._until(asked.done)
        finally:
            asked.cancel()
        return await asked

    async def _write(self, wrong: list[Finding]) -> None:
        """Write these and wait until they are read back. Raises AsvhilError where the vehicle is armed."""
        status = self.survey.status
        if status is None or status.armed:
            raise AsvhilError("the vehicle is armed: nothing was written; disarm it first")
        self.survey.fix(wrong)
        end_s = time.monotonic() + FIX_S
        await self._until(lambda: not self.survey.fixing or time.monotonic() > end_s)

    async def _until_done(self) -> None:
        await self._until(lambda: self.survey.stage == "done", self._complain)

    async def _until(self, condition: Callable[[], bool], complain: Callable[[float], None] | None = None) -> None:
        start_s = time.monotonic()
        while not condition():
            for port, state in self._visit.states().items():
                self.survey.note_link(port, state)
            await self._visit.tick(self.survey.step, TICK_S)
            self._on_tick(self.survey)
            if complain is not None:
                complain(time.monotonic() - start_s)

    def _complain(self, waited_s: float) -> None:
        """LinkError where there is no sense in waiting for the first heartbeat any longer."""
        endpoint = self._config.links.autopilot.endpoint
        if self.survey.stage == "booting" and waited_s > self._timeout_s + BOOT_S:
            raise LinkError(
                f"{endpoint}: the autopilot is still setting itself up after {waited_s:.0f} s: see its texts"
            )
        if self.survey.stage != "waiting":
            return
        state = self._visit.states()[AUTOPILOT]
        if state not in ("up", "connecting") and waited_s > BROKEN_S:
            raise LinkError(unopened_text(state))
        stranger = self.survey.stranger
        if stranger is not None:
            raise LinkError(f"{endpoint}: {describe(stranger)}")
        if waited_s < self._timeout_s:
            return
        heard = self.survey.bytes_heard
        dropped = in_brackets(self._visit.remarks(AUTOPILOT))
        if heard:
            own = self._config.links.autopilot
            what = f"{heard} bytes came, and no heartbeat of {own.autopilot_system_id}/{own.autopilot_component_id}"
            names = self.survey.neighbours
            if names:
                what += f", but of {', '.join(names)},"
            raise LinkError(f"{endpoint}: {what} within {waited_s:.0f} s: wrong speed or system id?{dropped}")
        raise LinkError(
            f"{endpoint}: nothing was heard within {waited_s:.0f} s: is the autopilot on and wired?{dropped}"
        )
