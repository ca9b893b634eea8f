"""Minimal plug-ins for tests."""

from pathlib import Path

PUSHER = """
from asvhil.config import Section
from asvhil.config.registry import ControllerKind, OperatorParameter, SearchRange
from asvhil.types import Control


class PusherConfig(Section):
    level: float = 0.1


class Pusher:
    def __init__(self, settings):
        self.settings = settings

    def step(self, estimate, wind, station):
        command = (self.settings.level, self.settings.level)
        return Control(command=command, ok=True, iterations=0, cost=0.0)

    def retune(self, config):
        self.settings = config.the_pusher

    def new_station(self):
        pass

    def reset(self):
        pass


KIND = ControllerKind(
    name="the-pusher",
    label="Pusher",
    build=lambda settings, config, model: Pusher(settings),
    section=PusherConfig,
    parameters=(OperatorParameter(name="PUSH_LEVEL", path=("level",), least=0.0, most=100.0, scale=0.01),),
    search=(SearchRange(key="level", start=0.2),),
)
"""


def write_pusher(folder: Path, *, text: str = PUSHER, name: str = "pusher.py", level: float | None = None) -> Path:
    """A plug-in with a controller, and the config `boat.yaml` beside it that uses it; the path of the config."""
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(text)
    settings = "" if level is None else f"\n  the_pusher: {{level: {level}}}"
    config = folder / "boat.yaml"
    config.write_text(f"base: sitl.yaml\nplugins: [{name}]\ncontroller:\n  name: the-pusher{settings}\n")
    return config


def install(folder: Path, module: str, text: str, entry_points: str, version: str = "1.2") -> None:
    """A package as pip leaves it in a folder of `sys.path`: its module, and its metadata."""
    (folder / f"{module}.py").write_text(text)
    info = folder / f"{module}-{version}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module.replace('_', '-')}\nVersion: {version}\n")
    (info / "entry_points.txt").write_text(entry_points)


LINE_WIND = '''
import math

from asvhil.config import SensorKind, SensorLinkConfig
from asvhil.types import ApparentWind


class LineWindLink(SensorLinkConfig):
    factor: float = 1.0


class LineWind:
    """Frames of whole lines such as `4.20 275.0`: m/s, degrees from the bow."""

    def __init__(self, settings, port):
        self.settings, self.port, self.lines = settings, port, 0

    def decode(self, frame):
        found = []
        rows = [tuple(map(float, line.split())) for line in frame.data.split(b"\\n") if line]
        self.lines += len(rows)
        for speed, degrees in rows:
            speed_mps, from_rad = speed * self.settings.factor, math.radians(degrees)
            found.append(("WIND", ApparentWind(t_ns=frame.t_ns, speed_mps=speed_mps, from_rad=from_rad)))
        return found

    def counters(self):
        return ((f"{self.port}.lines", self.lines),)


KIND = SensorKind(
    name="line-wind",
    build=lambda settings, port, messages: LineWind(settings, port),
    section=LineWindLink,
    messages={"WIND": ("wind",)},
    simulate=lambda settings, t_ns, reading: (
        f"{reading.wind_mps / settings.factor:.2f} {math.degrees(reading.wind_from_rad):.1f}\\n".encode()
    ),
)
'''


def write_line_wind(folder: Path) -> Path:
    """A plug-in with a wind sensor, and the config `boat.yaml` beside it, in which it is the only one; its path."""
    folder.mkdir(exist_ok=True)
    (folder / "wind.py").write_text(LINE_WIND)
    config = folder / "boat.yaml"
    config.write_text(
        "base: sitl.yaml\nplugins: [wind.py]\nsources: {wind: [mast.WIND]}\n"
        "links: {anemometer: null, sensors: {mast: {kind: line-wind, endpoint: 'serial:/dev/x:9600', factor: 2.0}}}\n"
    )
    return config
