"""Parses link specs such as `udpin:HOST:PORT` and `serial:PATH:BAUD`: text to a checked record; nothing is opened."""

from __future__ import annotations

import dataclasses
import difflib
import functools
import ipaddress
import re
from collections.abc import Callable

from asvhil.config.registry import LINKS, LinkKind
from asvhil.errors import ConfigError
from asvhil.types import record

MAX_BAUD = 20_000_000
_ALL_HOSTS = ("0.0.0.0", "::")
_HOST = re.compile(r"[A-Za-z0-9_]([A-Za-z0-9._-]*[A-Za-z0-9_.])?")


@record
class LinkSpec:
    """A parsed spec: `rest` is what stands behind `scheme:`.

    `host` and `ip_port` for udp and tcp, `path` for serial and pty, `baud` for serial.
    """

    text: str
    scheme: str
    rest: str
    host: str = ""
    ip_port: int = 0
    path: str = ""
    baud: int = 0


def parse_spec(spec: str) -> LinkSpec:
    """The spec as a record. Raises ConfigError, one line with the spec and the right form, where it is invalid."""
    scheme, _, rest = spec.partition(":")
    if scheme == "memory":
        raise ConfigError(f"link {spec!r}: memory links are made in pairs by tests and in lockstep, not from a spec")
    kind = LINKS.get(scheme)
    if kind is None:
        forms = {kind.name: kind.form for kind in LINKS}
        near = difflib.get_close_matches(scheme, forms, n=1)
        known = forms[near[0]] if near else ", ".join(forms.values())
        raise ConfigError(f"link {spec!r}: unknown kind {scheme!r}; would be right: {known}")
    if any(not c.isprintable() for c in spec):
        raise ConfigError(f"link {spec!r}: holds a control character; would be right: {kind.form}")
    found = LinkSpec(text=spec, scheme=scheme, rest=rest)
    if kind.parse is None:
        return found
    try:
        parsed: LinkSpec = kind.parse(found)
    except ValueError as error:
        raise ConfigError(f"link {spec!r}: {error}") from None
    return parsed


def shared_place(one: str, other: str) -> str:
    """What two link specs both want and only one can have: a serial device, or a port of this computer. Empty: none."""
    first, second = parse_spec(one), parse_spec(other)
    if first.scheme != second.scheme:
        return ""
    if first.scheme == "serial":
        return first.path if first.path == second.path else ""
    hosts = {first.host, second.host}
    met = len(hosts) == 1 or not hosts.isdisjoint(_ALL_HOSTS)
    bound = first.scheme in ("udpin", "tcpin") and 0 != first.ip_port == second.ip_port
    return f"{first.scheme[:3]} port {first.ip_port}" if bound and met else ""


# --- what stands behind the colon of each kind ---------------------------------------------------------------


def _path(spec: LinkSpec, form: str) -> LinkSpec:
    if not spec.rest:
        raise ValueError(f"no path; would be right: {form}")
    return dataclasses.replace(spec, path=spec.rest)


def _device(spec: LinkSpec, form: str) -> LinkSpec:
    path, number = _two_parts(spec, form)
    return dataclasses.replace(spec, path=path, baud=_number("baud", number, 1, MAX_BAUD, form))


def _address(spec: LinkSpec, form: str, *, ours: bool) -> LinkSpec:
    """`ours`: the port is bound here, and may be 0, any free one."""
    place, number = _two_parts(spec, form)
    ip_port = _number("port", number, 0 if ours else 1, 65535, form)
    return dataclasses.replace(spec, host=_host(place, form, spec.scheme), ip_port=ip_port)


def _two_parts(spec: LinkSpec, form: str) -> tuple[str, str]:
    place, colon, number = spec.rest.rpartition(":")
    if not colon or not place:
        raise ValueError(f"a part is missing; would be right: {form}")
    return place, number


def _number(name: str, text: str, low: int, high: int, form: str) -> int:
    if not re.fullmatch(r"[0-9]{1,9}", text) or not low <= int(text) <= high:
        raise ValueError(f"{name} {text!r} is not a number in {low}..{high}; form: {form}")
    return int(text)


def _host(text: str, form: str, scheme: str) -> str:
    if text.startswith("[") and text.endswith("]"):
        try:
            return str(ipaddress.IPv6Address(text[1:-1]))
        except ValueError:
            raise ValueError(f"{text[1:-1]!r} is not an IPv6 address") from None
    if ":" in text:
        raise ValueError(f"an IPv6 host stands in brackets, as in {scheme}:[::1]:14550")
    if not _HOST.fullmatch(text):
        raise ValueError(f"{text!r} is not a host name or address; form: {form}")
    return text


def host_port(host: str, ip_port: int) -> str:
    """An address as text, IPv6 in brackets: `127.0.0.1:14560`, `[::1]:14560`."""
    return f"[{host}]:{ip_port}" if ":" in host else f"{host}:{ip_port}"


def _kind(form: str, build: str, parse: Callable[..., LinkSpec], **settings: bool) -> LinkKind:
    name = form.partition(":")[0]
    return LinkKind(name=name, form=form, build=build, parse=functools.partial(parse, form=form, **settings))


LINKS.fill(
    (
        _kind("udpin:HOST:PORT", "asvhil.links.udp:open_udp", _address, ours=True),
        _kind("udpout:HOST:PORT", "asvhil.links.udp:open_udp", _address, ours=False),
        _kind("tcp:HOST:PORT", "asvhil.links.tcp:open_tcp", _address, ours=False),
        _kind("tcpin:HOST:PORT", "asvhil.links.tcp:open_tcpin", _address, ours=True),
        _kind("serial:PATH:BAUD", "asvhil.links.tty:open_serial", _device),
        _kind("pty:PATH", "asvhil.links.tty:open_pty", _path),
    )
)
