"""The anemometer's real firmware on a simulated Arduino in real time, with the wind of the simulated weather.

The simulator around the firmware is a program of the tests (tests/firmware/harness), at the place where `make
firmware-sim` builds it; it is not a part of this package. It opens the pseudo terminal that the daemon reads as its
serial port.
"""

from __future__ import annotations

import contextlib
import math
import os
import socket
import subprocess
import tempfile
import threading
from pathlib import Path
from types import TracebackType

from asvhil.errors import AsvhilError
from asvhil.io.sensors.nmea import NmeaCodec
from asvhil.types import ApparentWind, Frame

TREE = Path(__file__).resolve().parents[3]
FOLDER = TREE / "tests" / "firmware" / "build"
HARNESS, ELF = "simulated-arduino", "uno.elf"
START_S = 10.0
STOP_S = 5.0
LISTEN_S = 0.2
HARNESS_MAX_MPS = 100.0


class SimulatedArduino:
    """A context manager: inside it `pty` is the serial port of the running board, and wind comes from `udp_port`.

    The wind comes as the sentences of the simulated anemometer, one or more a datagram. Raises AsvhilError on entry
    where the simulator or the firmware is not built or does not start.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._harness, self._elf = ((folder or FOLDER) / name for name in (HARNESS, ELF))
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._blow, name="wind", daemon=True)
        self.pty = ""
        self.udp_port = 0

    def check(self) -> None:
        """Raise AsvhilError where a file is missing."""
        for file in (self._harness, self._elf):
            if not file.is_file():
                raise AsvhilError(f"{file}: not built; run `make firmware-sim` in the source tree first")

    def __enter__(self) -> SimulatedArduino:
        self.check()
        self._words = tempfile.TemporaryFile("w+")
        try:
            self.child = subprocess.Popen(
                [self._harness, self._elf, "--real"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._words,
                text=True,
                start_new_session=True,  # an interrupt at the terminal must reach the daemon first
            )
        except OSError as error:
            self._words.close()
            raise AsvhilError(f"{self._harness}: cannot be run ({error.strerror})") from None
        assert self.child.stdout is not None
        watch = threading.Timer(START_S, self.child.kill)
        watch.start()
        word, _, self.pty = self.child.stdout.readline().strip().partition(" ")
        watch.cancel()
        if word != "pty":
            self.child.kill()
            self.child.wait()
            words = self._last_words()
            self._end()
            raise AsvhilError(f"{self._harness}: did not start: {words}")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(LISTEN_S)
        self.udp_port = int(self._socket.getsockname()[1])
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self._thread.join()
        self._socket.close()
        self._end()

    @property
    def failure(self) -> str | None:
        """Why the board has ended, None while it runs."""
        status = self.child.poll()
        return None if status is None else f"the simulated Arduino ended early ({status}): {self._last_words()}"

    def _blow(self) -> None:
        assert self.child.stdin is not None
        codec = NmeaCodec("weather")
        while not self._stop.is_set():
            try:
                data = self._socket.recv(4096)
            except TimeoutError:
                continue
            for _, sample in codec.decode(Frame(t_ns=0, port="weather", data=data)):
                if not isinstance(sample, ApparentWind):
                    continue
                speed_mps, degrees = min(sample.speed_mps, HARNESS_MAX_MPS), math.degrees(sample.from_rad)
                try:
                    os.write(self.child.stdin.fileno(), f"wind {speed_mps:.3f} {degrees:.2f}\n".encode())
                except OSError:  # the board has ended: see `failure`
                    return

    def _last_words(self) -> str:
        self._words.seek(0)
        lines = self._words.read().split("\n")
        return next((line for line in reversed(lines) if line.strip()), "it said nothing")

    def _end(self) -> None:
        """End the board by closing its standard input."""
        for stream in (self.child.stdin, self.child.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        try:
            self.child.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self.child.kill()
            self.child.wait()
        self._words.close()
