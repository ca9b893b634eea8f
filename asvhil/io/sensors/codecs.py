"""Which codec reads which sensor link."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from asvhil.config import Config
from asvhil.io.sensors.nmea import NmeaCodec
from asvhil.io.sensors.nmea_sentences import VARIATION
from asvhil.io.sensors.protocol import SensorCodec
from asvhil.io.sensors.vectornav.codec import VectorNavCodec

# (port, the link's section of the config, messages that the sources name) -> codec
MakeCodec = Callable[[str, Any, frozenset[str]], SensorCodec]


def _nmea(port: str, link: Any, messages: frozenset[str]) -> SensorCodec:
    declination_rad = None if link.declination_deg is None else math.radians(link.declination_deg)
    return NmeaCodec(port, messages | VARIATION, declination_rad)


def _vectornav(port: str, link: Any, messages: frozenset[str]) -> SensorCodec:
    return VectorNavCodec(port)


CODECS: dict[str, MakeCodec] = {"anemometer": _nmea, "gnss": _nmea, "ins": _vectornav}


def build_codecs(config: Config) -> dict[str, SensorCodec]:
    """A codec for each sensor link that the config has, by its port."""
    messages: dict[str, set[str]] = {port: set() for port in CODECS}
    for sources in config.sources.resolved(config.links).values():
        for source in sources:
            messages.setdefault(source.link, set()).add(source.message)
    links = ((port, getattr(config.links, port)) for port in CODECS)
    return {port: CODECS[port](port, link, frozenset(messages[port])) for port, link in links if link is not None}
