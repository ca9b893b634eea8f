"""The other end of the operator's port: one command to a running daemon, and its answer."""

from __future__ import annotations

import socket
import time
from pathlib import Path

from asvhil.config.mavlink import SigningConfig
from asvhil.config.ports import OPERATOR
from asvhil.errors import LinkError
from asvhil.io.mavlink.frames import decode
from asvhil.io.mavlink.signature_filter import SignatureFilter
from asvhil.io.mavlink.signing import Signer, SigningClock, Verifier
from asvhil.links.keyfile import read_key
from asvhil.operator.reports import TextReader
from asvhil.types import Frame


def send_and_wait(
    data: bytes, endpoint: str, mav_cmd: int, timeout_s: float = 2.0, signing: SigningConfig | None = None
) -> tuple[int, str]:
    """Send a command frame to the daemon's operator port until it answers: (MAV_RESULT, its words).

    With `signing` each attempt is signed anew, as a repeated frame would be taken for an attack, and only answers
    signed with the same key are heard. Raises LinkError where nobody answers.
    """
    signer, verifier = _with_key(signing)
    host, _, port = endpoint.removeprefix("udpin:").removeprefix("udpout:").rpartition(":")
    words, texts = "", TextReader()
    signature_filter = SignatureFilter((), verifier)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.settimeout(0.5)
        end_s = time.monotonic() + timeout_s
        while time.monotonic() < end_s:
            try:
                link.sendto(data if signer is None else signer.sign(data, time.time_ns()), (host, int(port)))
                while True:
                    heard = Frame(t_ns=time.monotonic_ns(), port=OPERATOR, data=link.recv(4096), peer=endpoint)
                    message = next(iter(map(decode, signature_filter.receive(heard, time.time_ns()))), None)
                    if message is None:
                        continue
                    if message.get_type() == "STATUSTEXT":
                        words = texts.receive(message) or words
                    elif message.get_type() == "COMMAND_ACK" and message.command == mav_cmd:
                        return int(message.result), words
            except (TimeoutError, ConnectionRefusedError):
                continue
            except (OSError, ValueError) as error:
                raise LinkError(f"{endpoint}: cannot be reached ({error})") from None
    raise LinkError(f"{endpoint}: no answer; is `asvhil run` up, with its operator link there?")


def _with_key(signing: SigningConfig | None) -> tuple[Signer | None, Verifier | None]:
    if signing is None:
        return None, None
    key, _ = read_key(Path(signing.key_file).expanduser())
    clock = SigningClock()
    return Signer(key, signing.link_id, clock), Verifier(key, clock, start_ns=time.monotonic_ns())
