"""Parses link specs such as `udpin:HOST:PORT` and `serial:PATH:BAUD`: text to a checked record; nothing is opened."""

from __future__ import annotations

import difflib
import ipaddress
import re

from asvhil.errors import ConfigError
from asvhil.types import record

FORMS = {
    "udpin": "udpin:HOST:PORT",
    "udpout": "udpout:HOST:PORT",
    "tcp": "tcp:HOST:PORT",
    "tcpin": "tcpin:HOST:PORT",
    "serial": "serial:PATH:BAUD",
    "pty": "pty:PATH",
}
MAX_BAUD = 20_000_000
_HOST = re.compile(r"[A-Za-z0-9_]([A-Za-z0-9._-]*[A-Za-z0-9_.])?")


@record
class LinkSpec:
    """A parsed spec; `host` and `ip_port` of udp and tcp, `path` of serial and pty, `baud` of serial."""

    text: str
    scheme: str
    host: str = ""
    ip_port: int = 0
    path: str = ""
    baud: int = 0


def parse_spec(spec: str) -> LinkSpec:
    """The spec as a record. Raises ConfigError, one line with the spec and the right form, where it is invalid."""
    scheme, _, rest = spec.partition(":")
    if scheme == "memory":
        raise ConfigError(f"link {spec!r}: memory links are made in pairs by tests and in lockstep, not from a spec")
    if scheme not in FORMS:
        near = difflib.get_close_matches(scheme, FORMS, n=1)
        known = FORMS[near[0]] if near else ", ".join(FORMS.values())
        raise ConfigError(f"link {spec!r}: unknown kind {scheme!r}; would be right: {known}")
    if any(not c.isprintable() for c in spec):
        raise ConfigError(f"link {spec!r}: holds a control character; would be right: {FORMS[scheme]}")
    if scheme == "pty":
        if not rest:
            raise ConfigError(f"link {spec!r}: no path; would be right: {FORMS[scheme]}")
        return LinkSpec(text=spec, scheme=scheme, path=rest)
    place, colon, number = rest.rpartition(":")
    if not colon or not place:
        raise ConfigError(f"link {spec!r}: a part is missing; would be right: {FORMS[scheme]}")
    if scheme == "serial":
        return LinkSpec(text=spec, scheme=scheme, path=place, baud=_number(spec, scheme, "baud", number, 1, MAX_BAUD))
    # Port 0 (any free port) makes sense only where the port is ours.
    lowest = 0 if scheme in ("udpin", "tcpin") else 1
    ip_port = _number(spec, scheme, "port", number, lowest, 65535)
    return LinkSpec(text=spec, scheme=scheme, host=_host(spec, scheme, place), ip_port=ip_port)


def _number(spec: str, scheme: str, name: str, text: str, low: int, high: int) -> int:
    if not re.fullmatch(r"[0-9]{1,9}", text) or not low <= int(text) <= high:
        raise ConfigError(f"link {spec!r}: {name} {text!r} is not a number in {low}..{high}; form: {FORMS[scheme]}")
    return int(text)


def _host(spec: str, scheme: str, text: str) -> str:
    if text.startswith("[") and text.endswith("]"):
        try:
            return str(ipaddress.IPv6Address(text[1:-1]))
        except ValueError:
            raise ConfigError(f"link {spec!r}: {text[1:-1]!r} is not an IPv6 address") from None
    if ":" in text:
        raise ConfigError(f"link {spec!r}: an IPv6 host stands in brackets, as in {scheme}:[::1]:14550")
    if not _HOST.fullmatch(text):
        raise ConfigError(f"link {spec!r}: {text!r} is not a host name or address; form: {FORMS[scheme]}")
    return text


def host_port(host: str, ip_port: int) -> str:
    """An address as text, IPv6 in brackets: `127.0.0.1:14560`, `[::1]:14560`."""
    return f"[{host}]:{ip_port}" if ":" in host else f"{host}:{ip_port}"
