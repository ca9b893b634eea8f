"""What `bench.fuzz` feeds bytes to: every codec, the whole backseat and the simulated boats, and readers of files.

A target raises on nothing but a fault. Each has seeds, which are real bytes of its kind, so that coverage guides the
changes of something that is understood to begin with.
"""

from __future__ import annotations

import json
import struct
import tempfile
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

from mcap.writer import CompressionType, Writer

from asvhil.backseat.build import build_backseat
from asvhil.config import Config, load_config
from asvhil.config.link_spec import parse_spec
from asvhil.config.ports import AUTOPILOT, GNSS, INS, OPERATOR
from asvhil.config.yaml_text import parse_yaml
from asvhil.dynamics.weights import read_model
from asvhil.errors import AsvhilError, LogError
from asvhil.io.mavlink.file_transfer import decode_packet, refusal_text
from asvhil.io.mavlink.frames import CRC_EXTRA, Parser, checksum, decode, target
from asvhil.io.mavlink.signature_filter import SignatureFilter
from asvhil.io.mavlink.signing import SigningClock, Verifier, derive_key, sign
from asvhil.io.sensors.nmea import NmeaCodec
from asvhil.io.sensors.nmea_checksum import nmea_sentence
from asvhil.io.sensors.vectornav.codec import VectorNavCodec
from asvhil.logs.encoding import decode_outputs, encode_outputs
from asvhil.logs.export import export_log
from asvhil.logs.info import log_info
from asvhil.logs.reader import LogFile
from asvhil.logs.recover import recover
from asvhil.logs.run import read_run
from asvhil.logs.tlog import read_tlog
from asvhil.simplant.lockstep import Lockstep
from asvhil.simplant.plant import Plant
from asvhil.types import Frame, Inputs

Target = Callable[[bytes], None]

START_NS = 1_700_000_000_000_000_000
TICK_NS = 50_000_000
SENTENCES = ("GGA", "GLL", "GNS", "RMC", "VTG", "HDT", "THS", "HDM", "HDG", "ROT", "MWV", "MWV_T", "VWR", "VWT", "MWD")
MESSAGE_IDS = sorted(CRC_EXTRA)
LASTS = 100  # inputs that one boat gets, one after the other
MOST_TICKS = 10


def recorded(config: str, port: str, direction: str = "in") -> list[bytes]:
    """Frames of one port in the first seconds of a run of the simulated boat."""
    lockstep = Lockstep(load_config(config))
    found: list[bytes] = []
    for _ in range(160):
        inputs, outputs = lockstep.tick()
        frames = inputs.frames if direction == "in" else outputs.frames
        found += [frame.data for frame in frames if frame.port == port]
    return found


# --- codecs of streams -----------------------------------------------------------------------------------------


def mavlink() -> tuple[Target, Iterable[bytes]]:
    """Frames out of bytes that are cut anywhere, and messages out of frames."""

    def run(data: bytes) -> None:
        parser = Parser()
        cut = len(data) // 2
        for part in (data[:cut], data[cut:]):
            for frame in parser.receive("", part):
                decode(frame)
                target(frame)

    return run, recorded("sitl", AUTOPILOT)[:300:7]


def signatures() -> tuple[Target, Iterable[bytes]]:
    """A link that takes signed frames alone."""
    key = derive_key("a pass phrase")

    def run(data: bytes) -> None:
        verifier = Verifier(key, SigningClock(), start_ns=START_NS)
        SignatureFilter(("*/*",), verifier).receive(Frame(t_ns=START_NS, port=OPERATOR, data=data), START_NS)

    frames = recorded("sitl", AUTOPILOT)[:200:20]
    return run, [sign(frame, key, 1, 10**12 + number) for number, frame in enumerate(frames)]


def file_transfer() -> tuple[Target, Iterable[bytes]]:
    """Payloads of FILE_TRANSFER_PROTOCOL."""

    def run(data: bytes) -> None:
        packet = decode_packet(data)
        if packet is not None:
            refusal_text(packet.data)
            packet.encode()

    return run, [struct.pack("<HBBBBBxI", 1, 0, opcode, 4, 3, 0, 0) + bytes(239) for opcode in range(16)]


def nmea() -> tuple[Target, Iterable[bytes]]:
    """Sentences of every kind; a second reading repairs the checksum, so that fields are reached."""

    def run(data: bytes) -> None:
        codec = NmeaCodec(GNSS, SENTENCES)
        for part in (data, *(nmea_sentence(line.decode("latin-1")) for line in data.split(b"\n") if line.isascii())):
            codec.decode(Frame(t_ns=START_NS, port=GNSS, data=part))
        codec.counters()

    bodies = [
        *("GPGGA,120000,4025.42,N,08655.27,W,4,12,0.8,180.0,M,,M,,", "GPHDT,12.3,T", "HCHDG,10.0,1.0,E,2.0,W"),
        *("GPRMC,120000,A,4025.42,N,08655.27,W,1.0,90.0,271126,2.0,E,A,S", "GPVTG,90.0,T,92.0,M,1.0,N,1.9,K,A"),
        *("WIMWV,90.0,R,3.0,M,A", "WIMWD,90.0,T,92.0,M,5.8,N,3.0,M", "TIROT,1.0,A", "IIVWR,45.0,L,5.8,N,3.0,M,10.8,K"),
        *("GPGLL,4025.42,N,08655.27,W,120000,A,A", "GNGNS,120000,4025.42,N,08655.27,W,RR,12,0.8,180.0,-33.0,,,S"),
    ]
    return run, [body.encode() + b"\n" for body in bodies]


def vectornav() -> tuple[Target, Iterable[bytes]]:
    """Binary packets and sentences of a VN-300."""

    def run(data: bytes) -> None:
        codec = VectorNavCodec(INS)
        cut = len(data) // 3
        for part in (data[:cut], data[cut:]):
            codec.decode(Frame(t_ns=START_NS, port=INS, data=part))
        codec.counters()

    return run, recorded("sitl-vn300", INS)[:60:3]


# --- what frames mean ------------------------------------------------------------------------------------------


def frames_of(data: bytes) -> list[tuple[int, bytes]]:
    """(first byte, whole MAVLink 2 frame) of each piece: its fields are the fuzzer's, its checksum is right.

    A piece is a byte of choice, two of the message's place in the dialect, one of its length, and the payload.
    """
    found = []
    at = 0
    while at + 4 <= len(data):
        choice, place, length = data[at], int.from_bytes(data[at + 1 : at + 3], "little"), data[at + 3]
        payload = data[at + 4 : at + 4 + length]
        at += 4 + length
        msg_id = MESSAGE_IDS[place % len(MESSAGE_IDS)]
        sender = (1, 1) if choice & 1 else (255, 190)
        body = struct.pack("<BBBBBB", len(payload), 0, 0, at & 0xFF, *sender) + msg_id.to_bytes(3, "little") + payload
        found.append((choice, b"\xfd" + body + checksum(body, CRC_EXTRA[msg_id])))
    return found


def pieces_of(frames: Iterable[bytes], choice: int) -> Iterable[bytes]:
    """The reverse, for seeds: two frames each."""
    cut = [
        bytes([choice])
        + MESSAGE_IDS.index(int.from_bytes(frame[7:10], "little")).to_bytes(2, "little")
        + bytes([frame[1]])
        + frame[10 : 10 + frame[1]]
        for frame in frames
        if frame[0] == 0xFD and int.from_bytes(frame[7:10], "little") in CRC_EXTRA
    ]
    return [a + b for a, b in zip(cut[::2], cut[1::2], strict=False)]


class _Boat:
    """A backseat that keeps its station. It goes on from input to input, and is built anew after `LASTS` of them."""

    def __init__(self, settings: Config, history: list[Inputs]) -> None:
        self._settings = settings
        self._history = history
        self._left = 0

    def __call__(self, data: bytes) -> None:
        """Frames for the autopilot's and the operator's link; bit 2 of the choice starts another tick."""
        if self._left == 0:
            self._left = LASTS
            self._backseat = build_backseat(self._settings)
            for inputs in self._history:
                self._backseat.step(inputs)
            self._t_ns = self._history[-1].t_ns
        self._left -= 1
        ticks: list[list[Frame]] = [[]]
        for choice, frame in frames_of(data):
            if choice & 4 and len(ticks) < MOST_TICKS:
                ticks.append([])
            port = OPERATOR if choice & 2 else AUTOPILOT
            t_ns = self._t_ns + TICK_NS * len(ticks)
            ticks[-1].append(Frame(t_ns=t_ns, port=port, data=frame, peer="p"))
        for frames in ticks:
            self._t_ns += TICK_NS
            outputs = self._backseat.step(Inputs(t_ns=self._t_ns, frames=tuple(frames)))
            encode_outputs(outputs)
            if outputs.pwm_us is not None and not all(800 <= pulse_us <= 2200 for pulse_us in outputs.pwm_us):
                raise AssertionError(f"pulses of {outputs.pwm_us} us")


def _backseat(config: str) -> tuple[Target, Iterable[bytes]]:
    """Any frames from autopilot and operator, with right checksums, to a boat that keeps its station."""
    settings = load_config(config, ("controller.name=backstepping",))
    warm = Lockstep(settings)
    history = [warm.tick()[0] for _ in range(100)]
    received = [frame.data for inputs in history for frame in inputs.frames if frame.port == AUTOPILOT]
    seeds = [*pieces_of(received[:400:5], 1), *pieces_of(recorded(config, AUTOPILOT, "out")[:60:4], 2)]
    return _Boat(settings, history), seeds


def backseat_ardurover() -> tuple[Target, Iterable[bytes]]:
    """The backseat with an ArduRover."""
    return _backseat("sitl")


def backseat_px4() -> tuple[Target, Iterable[bytes]]:
    """The backseat with a PX4."""
    return _backseat("sitl-px4")


def backseat_script() -> tuple[Target, Iterable[bytes]]:
    """The backseat with the script on the autopilot as its way to the motors."""
    return _backseat("sitl-blueboat")


def _plant(config: str) -> tuple[Target, Iterable[bytes]]:
    settings = load_config(config)
    plant = Plant(settings, START_NS)
    left = 0

    def run(data: bytes) -> None:
        nonlocal plant, left
        if left == 0:
            left, plant = LASTS, Plant(settings, START_NS)
            for _ in range(200):
                plant.step()
        left -= 1
        for _, frame in frames_of(data):
            plant.receive(Frame(t_ns=plant.t_ns, port=AUTOPILOT, data=frame, peer="p"))
            plant.step()

    return run, pieces_of(recorded(config, AUTOPILOT, "out")[:120:4], 0)


def simulated_ardurover() -> tuple[Target, Iterable[bytes]]:
    """The simulated ArduRover, which a user's own programs talk to."""
    return _plant("sitl")


def simulated_px4() -> tuple[Target, Iterable[bytes]]:
    """The simulated PX4."""
    return _plant("sitl-px4")


# --- files -----------------------------------------------------------------------------------------------------


def _file(ending: str, read: Callable[[Path], object]) -> Target:
    """A reader of files may raise an AsvhilError of one line that names the file, and nothing else."""
    path = Path(tempfile.mkdtemp()) / f"odd{ending}"

    def run(data: bytes) -> None:
        path.write_bytes(data)
        try:
            read(path)
        except AsvhilError as error:
            if path.name not in str(error) or "\n" in str(error):
                raise AssertionError(f"not one line that names the file: {error}") from error

    return run


def _small_logs() -> list[bytes]:
    """A short log as it is, and without compression and CRCs, so that changes of it are read at all."""
    from asvhil.sitl import run_lockstep

    with tempfile.TemporaryDirectory() as folder:
        path, plain = Path(folder) / "log.mcap", Path(folder) / "plain.mcap"
        run_lockstep(load_config("sitl", ("controller.name=sd-mpc",)), path, 0.4)
        log = LogFile(path)
        writer = Writer(str(plain), compression=CompressionType.NONE, enable_crcs=False, chunk_size=2000)
        writer.start(profile="asvhil")
        for name, values in log.metadata.items():
            writer.add_metadata(name, values)
        writer.add_metadata("asvhil", {"layout": "1", "records": str(len(log.metadata))})
        channels: dict[int, int] = {}
        for _, piece in log.pieces():
            for item in [] if isinstance(piece, LogError) else piece:
                if hasattr(item, "topic"):
                    channels[item.id] = writer.register_channel(item.topic, item.message_encoding, 0, item.metadata)
                elif hasattr(item, "channel_id"):
                    writer.add_message(
                        channels[item.channel_id], item.log_time, item.data, item.publish_time, item.sequence
                    )
        writer.finish()
        return [path.read_bytes(), plain.read_bytes()]


def log_files() -> tuple[Target, Iterable[bytes]]:
    """Logs, read by all that reads them."""
    folder = Path(tempfile.mkdtemp())

    def recovered(path: Path) -> None:
        (folder / "new.mcap").unlink(missing_ok=True)
        recover(path, folder / "new.mcap", behind_damage=True)

    def table(path: Path) -> None:
        (folder / "new.csv").unlink(missing_ok=True)
        export_log(path, folder / "new.csv")

    reads = [
        _file(".mcap", read) for read in (read_run, log_info, table, recovered, lambda path: [*LogFile(path).timing()])
    ]

    def run(data: bytes) -> None:
        for read in reads:
            read(data)

    return run, _small_logs()


def telemetry_logs() -> tuple[Target, Iterable[bytes]]:
    """Telemetry logs of ground stations."""
    frames = recorded("sitl", AUTOPILOT)[:40]
    seeds = [
        b"".join(struct.pack(">Q", 10**15 + k) + frame for k, frame in enumerate(frames[i : i + 4])) for i in range(9)
    ]
    return _file(".tlog", lambda path: [decode(frame) for _, frame in read_tlog(path)]), seeds


def models() -> tuple[Target, Iterable[bytes]]:
    """Model files."""
    import numpy as np

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "small.npz"
        np.savez(path, kind=np.array("nnsem"), vehicle=np.array("a"), dt_s=np.array(0.2), w0=np.ones((2, 3)))
        small = path.read_bytes()
    return _file(".npz", read_model), [small]


def outputs_records() -> tuple[Target, Iterable[bytes]]:
    """The record of a tick's outputs in a log."""
    lockstep = Lockstep(load_config("sitl"))
    seeds = [encode_outputs(lockstep.tick()[1]) for _ in range(90)][::15]

    def run(data: bytes) -> None:
        with suppress(LogError):
            decode_outputs(data)

    return run, seeds


def yaml_texts() -> tuple[Target, Iterable[bytes]]:
    """Texts of configs, as far as YAML goes; `bench.yaml_edits` has their keys and values."""

    def run(data: bytes) -> None:
        with suppress(AsvhilError, UnicodeDecodeError):
            json.dumps(parse_yaml(data.decode(), "odd.yaml").tree, default=str)

    return run, [
        b"a: {b: [1, 2.5, x], c: true}\nd: &x {e: null}\nf: *x\n",
        b"links:\n  autopilot: {endpoint: 'udp:1'}\n",
    ]


def link_specs() -> tuple[Target, Iterable[bytes]]:
    """Link specifications, as users write them."""

    def run(data: bytes) -> None:
        with suppress(AsvhilError, UnicodeDecodeError):
            parse_spec(data.decode())

    return run, [b"udpin:127.0.0.1:14550", b"serial:/dev/ttyACM0:115200", b"tcpout:[::1]:5760", b"pty:anemometer"]


TARGETS: dict[str, Callable[[], tuple[Target, Iterable[bytes]]]] = {
    made.__name__: made
    for made in (
        *(mavlink, signatures, file_transfer, nmea, vectornav),
        *(backseat_ardurover, backseat_px4, backseat_script, simulated_ardurover, simulated_px4),
        *(log_files, telemetry_logs, models, outputs_records, yaml_texts, link_specs),
    )
}
