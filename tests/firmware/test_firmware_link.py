"""From the simulated board's serial port to the daemon: its own serial endpoint, its codec, its version check."""

import asyncio
import json
import math
import re
import subprocess
import sys
from pathlib import Path

import pytest

from asvhil.backseat.build import build_decoder
from asvhil.config import load_config
from asvhil.errors import AsvhilError
from asvhil.estimator.wind import WindFilter
from asvhil.io.sensors.firmware import FIRMWARE as NAME
from asvhil.io.sensors.firmware import QUERY, VERSION, FirmwareWatch
from asvhil.io.sensors.nmea import NmeaCodec
from asvhil.links.endpoint import open_endpoint
from asvhil.logs.encoding import decode_outputs
from asvhil.logs.reader import LogFile
from asvhil.simplant.boat.arduino import SimulatedArduino
from asvhil.types import ApparentWind, Estimate, Frame
from tests.support.arduino_driver import BUILD, FIRMWARE, Board
from tests.support.command_line import call, refused
from tests.support.nmea import sentence


def winds(codec: NmeaCodec, frame: Frame) -> list[ApparentWind]:
    return [m for _, m in codec.decode(frame) if isinstance(m, ApparentWind)]


def test_daemon_and_firmware_agree_on_name_and_version() -> None:
    source = (FIRMWARE / "sentence.h").read_text()
    assert re.findall(r'#define FIRMWARE_(?:NAME|VERSION) "(.+)"', source) == [NAME, VERSION]


@pytest.mark.real_time
async def test_the_daemons_serial_endpoint_reads_the_board(uno: Path) -> None:
    """Simulated time, a real pseudo terminal: every sentence arrives, also after the port was closed and opened."""
    codec, watch = NmeaCodec("anemometer"), FirmwareWatch("anemometer", NAME)
    samples: list[ApparentWind] = []
    with Board(uno) as board:
        board.tell("wind 7.5 292.5")
        for round_ in range(2):
            port = await open_endpoint(f"serial:{board.pty}:115200", "anemometer", lambda: 0)
            await port.send(QUERY)
            told = [text for _, text in await asyncio.to_thread(lambda: board.run(5.0)) if "MWV" in text]
            assert len(told) == 25 - (round_ == 0)
            young = [text for text in told if text.endswith(",V")]  # a second's mean is not known in the first one
            assert young == (told[:5] if round_ == 0 else [])
            expected = len(told) - len(young)
            samples.clear()
            while len(samples) < expected:
                frame = await asyncio.wait_for(port.recv(), 5.0)
                samples += winds(codec, frame)
                watch.receive(frame)
            await port.close()
            board.run(3.0)  # nobody listens: this is lost, not kept for the next reader
    assert dict(codec.counters())["anemometer.bad"] == 0
    note = watch.note()
    assert note is not None and note.ok and note.text == f"{NAME} {VERSION}"
    assert all(sample.speed_mps == 7.5 and math.degrees(sample.from_rad) == 292.5 for sample in samples)


@pytest.mark.real_time
async def test_in_real_time_the_wind_of_the_weather_blows_on_the_board(uno: Path) -> None:
    codec = NmeaCodec("anemometer")
    samples: list[ApparentWind] = []
    with SimulatedArduino(BUILD) as board:
        weather = await open_endpoint(f"udpout:127.0.0.1:{board.udp_port}", "weather", lambda: 0)
        port = await open_endpoint(f"serial:{board.pty}:115200", "anemometer", lambda: 0)
        try:
            await weather.send(sentence("WIMWV,91.0,R,12.00,M,A"))
            for _ in range(5000):  # a serial port gives a few bytes at a time
                frame = await asyncio.wait_for(port.recv(), 10.0)
                samples += winds(codec, frame)
                if samples and abs(samples[-1].speed_mps - 12.0) < 0.02:
                    break
            assert samples and abs(samples[-1].speed_mps - 12.0) < 0.02
            assert math.degrees(samples[-1].from_rad) == 90.0
            assert board.failure is None
        finally:
            await port.close()
            await weather.close()


@pytest.mark.real_time
def test_a_board_that_dies_says_so(uno: Path) -> None:
    with SimulatedArduino(BUILD) as board:
        assert board.failure is None
        board.child.kill()
        board.child.wait()
        assert board.failure == "the simulated Arduino ended early (-9): it said nothing"


def test_what_is_not_built_is_told_in_one_line(tmp_path: Path, uno: Path) -> None:
    with pytest.raises(AsvhilError, match=r"simulated-arduino: not built; run `make firmware-sim`"):
        SimulatedArduino(tmp_path).check()
    (tmp_path / "simulated-arduino").write_bytes((BUILD / "simulated-arduino").read_bytes())
    (tmp_path / "simulated-arduino").chmod(0o755)
    (tmp_path / "uno.elf").write_bytes(b"no ELF file")
    with (
        pytest.raises(AsvhilError, match=r"did not start: .*uno.elf: no ELF file of an AVR program"),
        SimulatedArduino(tmp_path),
    ):
        pass


def asvhil(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "asvhil", *words], capture_output=True, text=True, check=False, timeout=120.0
    )


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--anemometer", "real"), "--anemometer real: simulated or firmware is expected"),
        (("--anemometer", "firmware", "--lockstep"), "runs in real time only"),
        (("--anemometer", "firmware", "--set", "links.anemometer=null"), "links.anemometer: is null"),
        (("--anemometer", "firmware", "--arduino", "/nowhere"), "/nowhere/simulated-arduino: not built"),
        (("--arduino", "/nowhere"), "goes with --anemometer firmware only"),
    ],
)
def test_a_wrong_option_is_one_line(words: tuple[str, ...], told: str, tmp_path: Path) -> None:
    said = call("sitl", *words, cwd=tmp_path)
    assert said.out == ""
    refused(said, told)


@pytest.mark.real_time
def test_sitl_with_the_firmware_end_to_end(tmp_path: Path) -> None:
    """Simulated weather, simulated Arduino, real serial line, daemon: what it heard is what the firmware says."""
    log, figures = tmp_path / "log.mcap", tmp_path / "figures.json"
    done = asvhil(
        *("sitl", "--anemometer", "firmware", "--duration", "8", "--wind", "6@0", "--no-picture"),
        *("--set", "controller.name=loiter", "--set", f"recorder.directory={tmp_path}"),
        *("--log", str(log), "--json", str(figures)),
    )
    assert done.returncode == 0, done.stderr
    counters = json.loads(figures.read_text())["counters"]
    # The line is opened while the board already talks, so that the first sentence may come without its beginning.
    assert counters["anemometer.bad"] <= 1
    assert f"anemometer firmware: {NAME} {VERSION}" in done.stdout
    data, asked, winds = b"", [], []
    for inputs, recorded in LogFile(log).ticks():
        data += b"".join(frame.data for frame in inputs.frames if frame.port == "anemometer")
        if recorded is not None:
            outputs = decode_outputs(recorded)
            asked += [frame.data for frame in outputs.frames if frame.port == "anemometer"]
            winds += [outputs.wind] if outputs.wind is not None and outputs.wind.valid else []
    # How many there are is the host's to say: the emulated board is slower than real time on a busy one.
    assert data.count(b"$WIMWV,") > 5
    assert counters["anemometer.sentences"] == len(re.findall(rb"\$[A-Z]+,[^$]*\r\n", data))
    assert asked == [QUERY]
    assert b"$PASVV,arduino_anemometer," in data and b"$PASVG," in data
    directions = {float(text) for text in re.findall(rb"\$WIMWV,([\d.]+),R,[\d.]+,M,A", data)}
    assert directions and all((10.0 * direction) % 1.0 == 0.0 for direction in directions)
    assert math.hypot(winds[-1].vn_mps, winds[-1].ve_mps) == pytest.approx(6.0, abs=2.0)
    assert winds[-1].vn_mps > 3.0  # it blows toward north, as the weather does
    replay = asvhil("replay", str(log))
    assert replay.returncode == 0, replay.stdout + replay.stderr


def test_status_v_marks_the_wind_invalid(uno: Path) -> None:
    """A good vane and then an open one, as the board tells them: the daemon's wind is valid, and then no longer."""
    config = load_config("sitl")
    decoder = build_decoder(config)
    wind = WindFilter(config.estimator.wind)
    still = dict.fromkeys(("n_m", "e_m", "psi_rad", "u_mps", "v_mps", "r_radps"), 0.0)
    with Board(uno) as board:
        board.tell("wind 5 90")
        board.run(3.0)
        board.tell("vane open")
        board.run(6.0)
    valid = []
    for t_s, text in board.lines:
        t_ns = round(t_s * 1e9)
        frame = Frame(t_ns=t_ns, port="anemometer", data=sentence(text[1:]))
        estimate = Estimate(t_ns=t_ns, motor=(), std=(), disturbance=(0.0, 0.0, 0.0), valid=True, **still)
        for measurement in decoder.decode(frame):
            assert isinstance(measurement, ApparentWind)
            wind.on_apparent_wind(measurement, estimate)
        now = wind.wind(t_ns)
        valid.append(now is not None and now.valid)
    assert valid[12] and not valid[-1]
    assert dict(decoder.sources(round(board.lines[-1][0] * 1e9)))["wind"] == ""
    assert dict(decoder.counters())["anemometer.void"] >= 25
