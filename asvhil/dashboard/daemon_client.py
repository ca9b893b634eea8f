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
from asvhil.dashboard.controls import CHOICES, MOTION, PageControl, encode_control
from asvhil.dashboard.picture import BoatPicture
from asvhil.dashboard.steady_clock import steady_s
from asvhil.dashboard.turns import Answer, Turns
from asvhil.errors import LinkError
from asvhil.io.mavlink.frames import decode, dialect, renumbered, source
from asvhil.io.mavlink.signature_filter import SignatureFilter
from asvhil.io.mavlink.texts import TextReader
from asvhil.links.in_thread import open_in_thread
from asvhil.links.link import why
from asvhil.links.operator_client import KINDS, called, with_key
from asvhil.operator.encoding import encode_parameter, encode_parameter_question, encode_question
from asvhil.operator.station_parameters import FOLLOW_PARAMETER
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
SHOWN_S = 0.5  # a set-point that is granted shows within it
SETTING = {*CHOICES, "drift", "stay", "follow"}  # what sets parameters of the daemon
STOPPING = ("neutral", "release")  # what comes before all that was asked for earlier
GRANTED, NO_ANSWER = "granted", "no answer yet: it may still be done"
UNCHANGED = "no answer from the daemon: nothing has changed"
REFUSAL_S = 5.5  # the daemon repeats the same refusal of a set-point no more often


class DaemonClient:
    """Keeps a picture of the daemon while `run` runs, and asks it for controls.

    It sends no heartbeat: the daemon would take it for the pilot's ground station, and its end for that one's loss.
    """

    def __init__(self, config: Config, picture: BoatPicture, clock: Callable[[], float] = steady_s) -> None:
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
        self._refused: tuple[float, PageControl, str] | None = None  # the last set-point that was, when and why
        self._turns = Turns()

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

    async def ask(self, control: PageControl) -> Answer:
        """Whether the daemon has granted a control, and its words. One at a time; neutral and release come first."""
        overtaking = control.action if control.action in STOPPING else ""
        return await self._turns.take(partial(self._ask, control), overtaking)

    async def _ask(self, control: PageControl) -> Answer:
        if control.mav_cmd is not None:
            granted, words = await self._command(control.mav_cmd, self._numbered(encode_control(control, self._config)))
        elif control.action in SETTING:
            granted, words = await self._set(control)
        elif control.place_m is not None and self._picture.leader:
            granted, words = False, f"the station follows system {self._picture.leader}: have it stay, then move it"
        else:
            granted, words = await self._set_point(control, self._numbered(encode_control(control, self._config)))
        if granted:
            self._refused = None
            self._send(self._numbered(encode_parameter_question(self._config, FOLLOW_PARAMETER)))
        return granted, words

    async def _set(self, control: PageControl) -> Answer:
        """Set parameters, each once the one before is granted: all of them, or none."""
        before: dict[str, float] = {}
        if control.velocity is not None:
            before = await self._in_force(MOTION)
            if len(before) < len(MOTION):
                return False, UNCHANGED
        done: list[str] = []
        for name, value in control.settings(before):
            granted, words = await self._set_one(name, value)
            if words == NO_ANSWER:  # what is not known to be refused may be done, and then needs the rest
                return False, words
            if not granted:
                return False, words + await self._put_back(done, before)
            done.append(name)
        return True, GRANTED

    async def _set_one(self, name: str, value: float) -> Answer:
        data = self._numbered(encode_parameter(self._config, name, value))
        return await self._until_shown(data, partial(self._picture.tells_setting, name, value))

    async def _put_back(self, names: list[str], before: dict[str, float]) -> str:
        """Set parameters to what they were, the last one first; what has to be said of those that are not."""
        standing = [name for name in reversed(names) if not (await self._set_one(name, before[name]))[0]]
        return f"; set all the same: {', '.join(standing)}" if standing else ""

    async def _in_force(self, names: tuple[str, ...]) -> dict[str, float]:
        """The values of parameters, as far as the daemon tells them in time."""
        began_s, told = self._clock(), dict[str, float]()
        while len(told) < len(names) and self._clock() < began_s + ANSWER_S:
            for name in names:
                self._send(self._numbered(encode_parameter_question(self._config, name)))
            await asyncio.sleep(AGAIN_S)
            values = {name: self._picture.setting(name, began_s) for name in names}
            told = {name: value for name, value in values.items() if value is not None}
        return told

    async def _set_point(self, control: PageControl, data: bytes) -> Answer:
        """Send a set-point. The daemon does not say again why it refuses one, so the words heard last are kept."""
        began_s = self._clock()
        before = ""
        if self._refused is not None and self._refused[1] == control and began_s - self._refused[0] < REFUSAL_S:
            before = self._refused[2]
        granted, words = await self._until_shown(data, partial(self._is_shown, control), before)
        if self._words(began_s):
            self._refused = self._refusal[0], control, words
        elif not granted and words == NO_ANSWER and not self._picture.is_stale(self._clock()):
            words = self._words(began_s - REFUSAL_S) or words
        return granted, words

    def _is_shown(self, control: PageControl, since_s: float) -> bool:
        """Whether the station is what was asked for at a time, or has gone on from there."""
        way_m = self._picture.station_mps * (self._clock() - since_s + AGAIN_S)
        return control.is_shown_by(self._picture.station_m, way_m)

    async def _command(self, mav_cmd: int, data: bytes) -> Answer:
        """Send a command until it is acknowledged."""
        began_s = self._clock()
        granted = self._acks[mav_cmd] = asyncio.get_running_loop().create_future()
        try:
            while self._clock() < began_s + ANSWER_S:
                self._send(data)
                with contextlib.suppress(TimeoutError):
                    result = await asyncio.wait_for(asyncio.shield(granted), AGAIN_S)
                    if result == 0:
                        return True, GRANTED
                    if not self._words(began_s):  # a network has put them after the acknowledgement
                        await asyncio.sleep(AGAIN_S)
                    return False, self._words(began_s) or f"MAV_RESULT {result}"
        finally:
            self._acks.pop(mav_cmd, None)
        return False, NO_ANSWER

    async def _until_shown(self, data: bytes, is_shown: Callable[[float], bool], before: str = "") -> Answer:
        """Send what has no acknowledgement until it shows, in what was told since a time of day, or is refused.

        A refusal comes first: what was asked for may show because it was so already. `before`: why the same was
        refused a moment ago; so it still is where nothing shows.
        """
        began_s = self._clock()
        while self._clock() < began_s + ANSWER_S:
            self._send(data)
            await asyncio.sleep(AGAIN_S)
            words = self._words(began_s)
            if words:
                return False, words
            if is_shown(began_s):
                return True, GRANTED
            if before and self._clock() >= began_s + SHOWN_S and not self._picture.is_stale(self._clock()):
                return False, before
        return False, NO_ANSWER

    def _words(self, since_s: float) -> str:
        return self._refusal[1] if self._refusal[0] >= since_s else ""

    async def _ask_on(self) -> None:
        """The questions, in their turn."""
        count = 0
        while True:
            for msg_id in (ARRAYS, *(RARELY_ASKED if count % SELDOM == 0 else ())):
                self._send(self._numbered(encode_question(self._config, msg_id)))
            if count % SELDOM == 1:
                for name in (*(name for name, _ in CHOICES.values()), FOLLOW_PARAMETER):
                    self._send(self._numbered(encode_parameter_question(self._config, name)))
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
        self._picture.receive(now_s, message)
        if kind == "STATUSTEXT":
            text = self._texts.receive(message)
            warns = message.severity <= dialect.MAV_SEVERITY_WARNING
            if text is not None and warns and not self._picture.is_note(text):
                self._refusal = now_s, text
        elif kind == "COMMAND_ACK" and (waiting := self._acks.get(message.command)) is not None and not waiting.done():
            waiting.set_result(int(message.result))

    def _numbered(self, data: bytes) -> bytes:
        """A frame with a number of its own, by which the daemon knows a new request from one that comes again."""
        self._number += 1
        return renumbered(data, self._number)

    def _send(self, data: bytes) -> None:
        """At once, or not at all: what is lost is asked for again."""
        if self._link is None:
            return
        if self._signer is not None:
            data = self._signer.sign(data, time.time_ns())
        with contextlib.suppress(OSError):
            self._link.send(data)
