"""Which codec reads which sensor link."""

from __future__ import annotations

from asvhil.config import Config
from asvhil.config.registry import SENSORS
from asvhil.io.sensors.protocol import SensorCodec


def build_codecs(config: Config) -> dict[str, SensorCodec]:
    """A codec for each sensor link that the config has, by its port."""
    links = config.links
    messages: dict[str, set[str]] = {}
    for sources in config.sources.resolved(links).values():
        for source in sources:
            messages.setdefault(source.link, set()).add(source.message)
    return {
        port: SENSORS.find(links.kind_of(port)).make(link, port, frozenset(messages.get(port, ())))
        for port, link in links.sensor_links().items()
    }
