"""A client of the operator's port: one request to a running daemon, and its answer."""

from __future__ import annotations

import math
import re
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Generic, TypeVar

from asvhil.config.link_spec import LinkSpec, host_port, parse_spec
from asvhil.config.mavlink import SigningConfig
from asvhil.config.ports import OPERATOR
from asvhil.errors import LinkError
from asvhil.io.mavlink.frames import decode, dialect, renumbered, source, target
from asvhil.io.mavlink.signature_filter import SignatureFilter
from asvhil.io.mavlink.signing import Signer, SigningClock, Verifier
from asvhil.io.mavlink.texts import TextReader
from asvhil.links.keyfile import read_key
from asvhil.links.link import why
from asvhil.types import Frame

Answer = TypeVar("Answer")
RESEND_S = 0.5  # the command is sent again if no answer has come
REASON_S = 1.2  # for the reason of a refusal: two repetitions, each answered with it
# What a daemon tells of itself as a warning too, at any time: a note's subject, of a few words, with its text; a
# quantity without a source. A refusal begins with a sentence, or with a parameter's name.
REMARK = re.compile(r"[a-z][^\s:]*( [^\s:]+){0,2}: .+|.+ from nowhere", re.DOTALL)
KINDS = {"udpin": socket.SOCK_DGRAM, "tcpin": socket.SOCK_STREAM}
OURS = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # where to call a daemon that listens on all addresses


def send_and_wait(
    data: bytes, endpoint: str, mav_cmd: int, timeout_s: float = 2.0, signing: SigningConfig | None = None
) -> tuple[int, str]:
    """Send a command frame to the daemon's operator port until it answers: (MAV_RESULT, text). As `ask`."""

    def result(message: Any, words: str) -> int | None:
        if message.get_type() == "COMMAND_ACK" and message.command == mav_cmd:
            return int(message.result)
        return None

    return ask(data, endpoint, result, timeout_s, signing)


def read_parameter(
    data: bytes, endpoint: str, name: str, timeout_s: float = 2.0, signing: SigningConfig | None = None
) -> float:
    """Send a PARAM_REQUEST_READ frame until the daemon tells the parameter. As `ask`."""

    def value(message: Any, words: str) -> float | None:
        return _value_of(message, name)

    return ask(data, endpoint, value, timeout_s, signing)[0]


def set_parameter(
    data: bytes, endpoint: str, name: str, wanted: float, timeout_s: float = 2.0, signing: SigningConfig | None = None
) -> tuple[float, str]:
    """Send a PARAM_SET frame until the daemon answers: (the value that the parameter now has, text). As `ask`.

    Values go to every operator, so another one than is wanted may tell of somebody else's change, and a network may put
    it before the reason: the text is waited for, some repetitions long, but not beyond the time of an answer.
    """
    since_s: float | None = None
    known: float | None = None
    reason = ""

    def answered(message: Any, words: str) -> float | None:
        nonlocal since_s, known, reason
        reason = reason if REMARK.fullmatch(words) else words
        told = _value_of(message, name)
        known = known if told is None else told
        if known is None or is_value(known, wanted) or reason:
            return known
        since_s = since_s or time.monotonic()
        return known if time.monotonic() - since_s > REASON_S else None

    try:
        value, _ = ask(data, endpoint, answered, timeout_s, signing)
    except LinkError:
        if known is None:
            raise
        value = known  # it has answered, and the reason has not come in time
    return value, reason


def is_value(told: float, wanted: float) -> bool:
    """Whether a value of the link, a 32-bit float, is the one that was sent."""
    return math.isclose(told, wanted, rel_tol=1e-5, abs_tol=1e-6)


def _value_of(message: Any, name: str) -> float | None:
    if message.get_type() == "PARAM_VALUE" and message.param_id == name:
        return float(message.param_value)
    return None


def ask(
    data: bytes,
    endpoint: str,
    answer: Callable[[Any, str], Answer | None],
    timeout_s: float = 2.0,
    signing: SigningConfig | None = None,
) -> tuple[Answer, str]:
    """Send a frame to the daemon's operator port until it is answered: what `answer` reads in a message, and why.

    `answer` is given each message with the daemon's last warning, which is the reason of a refusal.

    Each call numbers its frame anew, so that the daemon knows a second call from a repetition of the first. With
    `signing` each attempt is signed anew, as a repeated frame would be taken for an attack, and only answers signed
    with the same key are heard. Raises LinkError where nobody answers, or where the daemon listens on no port.
    """
    signer, verifier = with_key(signing)
    data = renumbered(data, round(10.0 * time.time()))
    spec = parse_spec(endpoint)
    if spec.scheme not in KINDS:
        listens = "udpin: or tcpin:, such as udpin:127.0.0.1:14660"
        raise LinkError(f"{endpoint}: the daemon does not listen there; links.operator.endpoint must be {listens}")
    end_s = time.monotonic() + timeout_s
    reason, strangers = "no answer", ""
    while time.monotonic() < end_s:
        try:
            with called(spec) as link:
                asked = _Answers(endpoint, target(data), answer, SignatureFilter((), verifier))
                while time.monotonic() < end_s:
                    link.sendall(data if signer is None else signer.sign(data, time.time_ns()))
                    result = asked.wait(link, min(time.monotonic() + RESEND_S, end_s))
                    strangers = asked.strangers
                    if result is not None:
                        return result, asked.words
        except ConnectionError as error:  # not up, or not up yet
            reason = "no answer" if spec.scheme == "udpin" else why(error)
            time.sleep(0.1)
        except OSError as error:
            raise LinkError(f"{endpoint}: cannot be reached ({why(error)})") from None
    if strangers:
        raise LinkError(f"{endpoint}: {strangers} answers there, and no daemon: another program has this port")
    raise LinkError(f"{endpoint}: {reason}; is `asvhil run` up, with its operator link there?")


class _Answers(Generic[Answer]):
    """Reads what answers: the message that is looked for of the component asked, and its last warning."""

    def __init__(
        self,
        endpoint: str,
        daemon: tuple[int, int],
        answer: Callable[[Any, str], Answer | None],
        accepts: SignatureFilter,
    ) -> None:
        self._endpoint, self._daemon, self._answer, self._accepts = endpoint, daemon, answer, accepts
        self._texts = TextReader()
        self.words = ""
        self.strangers = ""

    def wait(self, link: socket.socket, until_s: float) -> Answer | None:
        """The answer; None if none has come by that time."""
        while (left_s := until_s - time.monotonic()) > 0.0:
            link.settimeout(left_s)
            try:
                data = link.recv(65536)
            except TimeoutError:
                return None
            if not data:
                raise ConnectionResetError
            heard = Frame(t_ns=time.monotonic_ns(), port=OPERATOR, data=data, peer=self._endpoint)
            for frame in self._accepts.receive(heard, time.time_ns()):
                result = self._read(frame)
                if result is not None:
                    return result
        return None

    def _read(self, frame: bytes) -> Answer | None:
        if source(frame) != self._daemon:
            self.strangers = "MAVLink component {}/{}".format(*source(frame))
            return None
        message = decode(frame)
        if message is None:
            return None
        if message.get_type() == "STATUSTEXT" and message.severity <= dialect.MAV_SEVERITY_WARNING:
            self.words = self._texts.receive(message) or self.words
        return self._answer(message, self.words)


def called(spec: LinkSpec) -> socket.socket:
    """A socket that is connected to where the daemon listens. OSError where it cannot be."""
    host = OURS.get(spec.host, spec.host)
    kind = KINDS[spec.scheme]
    try:
        found = socket.getaddrinfo(host, spec.ip_port, type=kind)
    except (socket.gaierror, UnicodeError):
        raise OSError(f"{host_port(host, spec.ip_port)} does not resolve; an IP address would do") from None
    found.sort(key=lambda info: info[0] != socket.AF_INET)  # as the daemon binds a name
    family, _, _, _, address = found[0]
    link = socket.socket(family, kind)
    try:
        link.settimeout(RESEND_S)
        link.connect(address)
    except BaseException:
        link.close()
        raise
    return link


def with_key(signing: SigningConfig | None) -> tuple[Signer | None, Verifier | None]:
    """What signs and checks with the key of a config; None, None without one. ConfigError."""
    if signing is None:
        return None, None
    key, _ = read_key(Path(signing.key_file).expanduser())
    clock = SigningClock()
    return Signer(key, signing.link_id, clock), Verifier(key, clock, start_ns=time.monotonic_ns())
