"""The other end of the operator's port: one command to a running daemon, and its answer."""

from __future__ import annotations

import socket
import time

from asvhil.errors import LinkError
from asvhil.io.mavlink import FrameSplitter, decode


def send_and_wait(data: bytes, endpoint: str, mav_cmd: int, timeout_s: float = 2.0) -> tuple[int, str]:
    """Send a command frame to the daemon's operator port until it answers: (MAV_RESULT, its words).

    Raises LinkError where nobody answers.
    """
    host, _, port = endpoint.removeprefix("udpin:").removeprefix("udpout:").rpartition(":")
    words = ""
    splitter = FrameSplitter(datagrams=True)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.settimeout(0.5)
        end_s = time.monotonic() + timeout_s
        while time.monotonic() < end_s:
            try:
                link.sendto(data, (host, int(port)))
                while True:
                    message = next(iter(map(decode, splitter.feed(link.recv(4096)))), None)
                    if message is None:
                        continue
                    if message.get_type() == "STATUSTEXT":
                        words = message.text
                    elif message.get_type() == "COMMAND_ACK" and message.command == mav_cmd:
                        return int(message.result), words
            except (TimeoutError, ConnectionRefusedError):
                continue
            except (OSError, ValueError) as error:
                raise LinkError(f"{endpoint}: cannot be reached ({error})") from None
    raise LinkError(f"{endpoint}: no answer; is `asvhil run` up, with its operator link there?")
