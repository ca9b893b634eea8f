"""The page's conversation with the daemon by its operator link: questions several times a second, and controls."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import time
from collections.abc import Callable
from functools import partial

from asvhil.config import Config
from asvhil.config.link_spec import parse_spec
from asvhil.config.ports import OPERATOR
from asvhil.dashboard.controls import CHOICES, PageControl, encode_control
from asvhil.dashboard.picture import BoatPicture
from asvhil.errors import LinkError
from asvhil.io.mavlink.frames import decode, dialect, renumbered, source
from asvhil.io.mavlink.signature_filter import SignatureFilter
from asvhil.io.mavlink.texts import TextReader
from asvhil.links.in_thread import open_in_thread
from asvhil.links.link import why
from asvhil.links.operator_client import KINDS, called, with_key
from asvhil.operator.encoding import encode_parameter_question, encode_question
from asvhil.types import Frame

PERIOD_S = 0.2
SELDOM = 5  # the rest is asked for in every fifth period
ARRAYS = dialect.MAVLINK_MSG_ID_DEBUG_FLOAT_ARRAY
RARELY_ASKED = (
    dialect.MAVLINK_MSG_ID_HEARTBEAT,
    dialect.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
    dialect.MAVLINK_MSG_ID_ONBOARD_COMPUTER_STATUS,
    dialect.MAVLINK_MSG_ID_STATUSTEXT,
)
AGAIN_S = 0.3
ANSWER_S = 2.0
GRANTED, NO_ANSWER = "granted", "no answer from the daemon"
REFUSAL_S = 5.5  # the daemon repeats the same refusal of a set-point no more often


class DaemonClient:
    """Keeps a picture of the daemon while `run` runs, and asks it for controls.

    It sends no heartbeat: the daemon would take it for the pilot's ground station, and its end for that one's loss.
    """

    def __init__(self, config: Config, picture: BoatPicture, clock: Callable[[], float] = time.time) -> None:
        """LinkError where the daemon listens nowhere, ConfigError where the key cannot be read."""
        link = config.links.operator
        self._config = config.links.autopilot
        self._picture = picture
        self._clock = clock
        self._daemon = (self._config.system_id, self._config.component_id)
        self._spec = parse_spec(link.endpoint)
        if self._spec.scheme not in KINDS:
            listens = "udpin: or tcpin:, such as udpin:127.0.0.1:14660"
            raise LinkError(f"{link.endpoint}: no daemon listens there; links.operator.endpoint must be {listens}")
        self._signer, verifier = with_key(link.signing)
        self._accepts = SignatureFilter((), verifier)
        self._link: socket.socket | None = None
        self._number = round(10.0 * clock())
        self._texts = TextReader()
        self._acks: dict[int, asyncio.Future[int]] = {}
        self._refusal: tuple[float, str] = (-REFUSAL_S, "")
        self._turn = asyncio.Lock()

    async def run(self) -> None:
        """Ask and listen until cancelled; a daemon that is gone may come back."""
        while True:
            try:
                link = await open_in_thread(called, self._spec)
            except OSError as error:
                self._picture.note_trouble(f"{self._spec.text}: cannot be reached ({why(error)})")
                await asyncio.sleep(PERIOD_S)
                continue
            with link:
                link.setblocking(False)
                self._link = link
                asking = asyncio.create_task(self._ask_on())
                try:
                    await self._listen(link)
                finally:
                    self._link = None
                    asking.cancel()
                    await asyncio.gather(asking, return_exceptions=True)
            await asyncio.sleep(PERIOD_S)

    async def ask(self, control: PageControl) -> tuple[bool, str]:
        """Whether the daemon has granted a control, and its words. One at a time."""
        async with self._turn:
            return await self._ask(control)

    async def _ask(self, control: PageControl) -> tuple[bool, str]:
        frames = [renumbered(data, self._next_number()) for data in encode_control(control, self._config)]
        if control.mav_cmd is not None:
            return await self._command(control.mav_cmd, *frames)
        if not control.settings:
            return await self._until_shown(frames[0], partial(self._is_shown, control))
        for (name, value), data in zip(control.settings, frames, strict=True):
            is_set = partial(self._picture.tells_setting, name, value)
            granted, words = await self._until_shown(data, is_set)
            if not granted:
                return False, words
        return True, GRANTED

    def _is_shown(self, control: PageControl, since_s: float) -> bool:
        """Whether the station is what was asked for at a time, or has gone on from there."""
        way_m = self._picture.station_mps * (self._clock() - since_s + AGAIN_S)
        return control.is_shown_by(self._picture.station_m, way_m)

    async def _command(self, mav_cmd: int, data: bytes) -> tuple[bool, str]:
        """Send a command until it is acknowledged."""
        began_s = self._clock()
        granted = self._acks[mav_cmd] = asyncio.get_running_loop().create_future()
        try:
            while self._clock() < began_s + ANSWER_S:
                self._send(data)
                with contextlib.suppress(TimeoutError):
                    result = await asyncio.wait_for(asyncio.shield(granted), AGAIN_S)
                    return result == 0, GRANTED if result == 0 else self._words(began_s) or f"MAV_RESULT {result}"
        finally:
            self._acks.pop(mav_cmd, None)
        return False, NO_ANSWER

    async def _until_shown(self, data: bytes, is_shown: Callable[[float], bool]) -> tuple[bool, str]:
        """Send what has no acknowledgement until it shows, in what was told since a time of day, or is refused."""
        began_s = self._clock()
        while self._clock() < began_s + ANSWER_S:
            self._send(data)
            await asyncio.sleep(AGAIN_S)
            if is_shown(began_s):
                return True, GRANTED
            if self._refusal[0] >= began_s:
                return False, self._refusal[1]
        return False, self._words(began_s - REFUSAL_S) or NO_ANSWER

    def _words(self, since_s: float) -> str:
        return self._refusal[1] if self._refusal[0] >= since_s else ""

    async def _ask_on(self) -> None:
        """The questions, in their turn."""
        count = 0
        while True:
            for msg_id in (ARRAYS, *(RARELY_ASKED if count % SELDOM == 0 else ())):
                self._send(renumbered(encode_question(self._config, msg_id), self._next_number()))
            if count % SELDOM == 1:
                for name, _ in CHOICES.values():
                    self._send(renumbered(encode_parameter_question(self._config, name), self._next_number()))
            count += 1
            await asyncio.sleep(PERIOD_S)

    async def _listen(self, link: socket.socket) -> None:
        """Take in what comes until the link is lost."""
        loop = asyncio.get_running_loop()
        while True:
            try:
                data = await loop.sock_recv(link, 65536)
            except ConnectionRefusedError:  # UDP: nobody is there now
                self._picture.note_trouble(f"{self._spec.text}: nobody is there")
                await asyncio.sleep(PERIOD_S)
                continue
            except OSError as error:
                self._picture.note_trouble(f"{self._spec.text}: {why(error)}")
                return
            if not data and self._spec.scheme == "tcpin":
                self._picture.note_trouble(f"{self._spec.text}: the daemon has closed the connection")
                return
            self._picture.note_trouble(f"{self._spec.text}: no answer")
            heard = Frame(t_ns=time.monotonic_ns(), port=OPERATOR, data=data, peer=self._spec.text)
            for frame in self._accepts.receive(heard, time.time_ns()):
                self._receive(frame)

    def _receive(self, frame: bytes) -> None:
        message = decode(frame) if source(frame) == self._daemon else None
        if message is None:
            return
        kind, now_s = message.get_type(), self._clock()
        if kind == "STATUSTEXT":
            text = self._texts.receive(message)
            warns = message.severity <= dialect.MAV_SEVERITY_WARNING
            if text is not None and warns and not self._picture.is_note(text):
                self._refusal = now_s, text
        elif kind == "COMMAND_ACK" and (waiting := self._acks.get(message.command)) is not None and not waiting.done():
            waiting.set_result(int(message.result))
        self._picture.receive(now_s, message)

    def _next_number(self) -> int:
        self._number += 1
        return self._number

    def _send(self, data: bytes) -> None:
        """At once, or not at all: what is lost is asked for again."""
        if self._link is None:
            return
        if self._signer is not None:
            data = self._signer.sign(data, time.time_ns())
        with contextlib.suppress(OSError):
            self._link.send(data)
