"""Specs of links: which are good, and what is said of those that are not."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asvhil.errors import ConfigError, LinkError
from asvhil.links.endpoint import open_endpoint, parse_spec
from tests.support.endpoints import Clock, pair, run

pytestmark = pytest.mark.real_time


async def refused(spec: str) -> str:
    with pytest.raises(LinkError) as caught:
        await open_endpoint(spec, "x", Clock())
    message = str(caught.value)
    assert message.startswith(spec + ": ") and "\n" not in message
    return message


def test_opening_errors_name_the_spec_and_the_cause(tmp_path: Path) -> None:
    async def body() -> None:
        for kind in ("udpin", "tcpin"):
            holder = await open_endpoint(f"{kind}:127.0.0.1:0", "holder", Clock())
            assert "another program has this port" in await refused(f"{kind}:{holder.address}")
            assert "no interface" in await refused(f"{kind}:192.0.2.1:14560")
            gone = holder.address
            await holder.close()
        assert "no server listens there" in await refused(f"tcp:{gone}")
        for scheme in ("udpin", "udpout", "tcp", "tcpin"):
            assert "does not resolve" in await refused(f"{scheme}:no-such-host.invalid:5760")
            assert "does not resolve" in await refused(f"{scheme}:{'a' * 70}:5760")
        assert "is it plugged in" in await refused(f"serial:{tmp_path}/ttyUSB7:115200")
        (tmp_path / "file").touch()
        await refused(f"serial:{tmp_path}/file:115200")
        assert "symlink" in await refused(f"pty:{tmp_path}/no/such/folder")
        near, far = await pair("serial", tmp_path)
        assert "another program has it open" in await refused(far.spec)
        await near.close()
        await far.close()

    run(body)


@pytest.mark.parametrize(
    ("spec", "fields"),
    [
        ("udpin:0.0.0.0:14560", ("udpin", "0.0.0.0", 14560, "", 0)),
        ("udpin:127.0.0.1:0", ("udpin", "127.0.0.1", 0, "", 0)),
        ("udpout:[::1]:14550", ("udpout", "::1", 14550, "", 0)),
        ("tcp:boat.local:5760", ("tcp", "boat.local", 5760, "", 0)),
        ("tcpin:localhost:65535", ("tcpin", "localhost", 65535, "", 0)),
        ("serial:/dev/ttyACM0:115200", ("serial", "", 0, "/dev/ttyACM0", 115200)),
        ("serial:/dev/by-path/pci-0:00:14.0-port0:57600", ("serial", "", 0, "/dev/by-path/pci-0:00:14.0-port0", 57600)),
        ("serial:anemometer:115200", ("serial", "", 0, "anemometer", 115200)),
        ("pty:run/anemometer", ("pty", "", 0, "run/anemometer", 0)),
    ],
)
def test_good_specs(spec: str, fields: tuple[str, str, int, str, int]) -> None:
    parsed = parse_spec(spec)
    assert (parsed.scheme, parsed.host, parsed.ip_port, parsed.path, parsed.baud) == fields
    assert parsed.text == spec


@pytest.mark.parametrize(
    ("spec", "hint"),
    [
        ("", "udpin:HOST:PORT"),
        ("udp:127.0.0.1:14560", "udpin:HOST:PORT"),
        ("serail:/dev/ttyACM0:115200", "serial:PATH:BAUD"),
        ("/dev/ttyACM0", "serial:PATH:BAUD"),
        ("memory", "pairs"),
        ("memory:x", "pairs"),
        ("udpin:14560", "udpin:HOST:PORT"),
        ("udpin::14560", "udpin:HOST:PORT"),
        ("udpin:127.0.0.1:", "0..65535"),
        ("udpin:127.0.0.1:70000", "0..65535"),
        ("udpin:127.0.0.1:-1", "0..65535"),
        ("udpout:127.0.0.1:0", "1..65535"),
        ("tcp:127.0.0.1:0", "1..65535"),
        ("tcp:127.0.0.1:http", "1..65535"),
        ("tcp:127.0.0.1:1\u0663", "1..65535"),
        ("tcp:::1:5760", "brackets"),
        ("tcp:[::g]:5760", "IPv6"),
        ("tcp:two words:5760", "host name"),
        ("tcp:-x:5760", "host name"),
        ("serial:/dev/ttyACM0", "serial:PATH:BAUD"),
        ("serial::115200", "serial:PATH:BAUD"),
        ("serial:/dev/ttyACM0:fast", "baud"),
        ("serial:/dev/ttyACM0:0", "baud"),
        ("/dev/ttyACM0:115200", "serial:PATH:BAUD"),
        ("/dev/ttyACM0,115200", "serial:PATH:BAUD"),
        ("serial:/dev/ttyACM0,115200", "serial:PATH:BAUD"),
        ("serial:/dev/ttyACM0@115200", "serial:PATH:BAUD"),
        ("serial:/dev/ttyACM0:115200:8N1", "baud"),
        ("serial:/dev/ttyACM0:115200,8N1", "baud"),
        ("serial:/dev/ttyACM0:115_200", "baud"),
        ("serial:/dev/ttyACM0:115200 ", "baud"),
        ("serial:/dev/ttyACM0:1e5", "baud"),
        ("serial:/dev/ttyACM0:115200.0", "baud"),
        ("udpin:[::]", "udpin:HOST:PORT"),
        ("udpin:[::]14550", "udpin"),
        ("udpin:::14550", "brackets"),
        ("udpin:*:14550", "host name"),
        ("udp:[::]:14550", "udpin:HOST:PORT"),
        ("udpin:0.0.0.0:14550,", "0..65535"),
        ("UDPIN:0.0.0.0:14550", "udpin:HOST:PORT"),
        ("pty:", "pty:PATH"),
        ("pty", "pty:PATH"),
        ("pty:a\nb", "control"),
    ],
)
def test_bad_specs(spec: str, hint: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_spec(spec)
    message = str(caught.value)
    assert repr(spec) in message and hint in message and "\n" not in message

    async def body() -> None:
        with pytest.raises(ConfigError):
            await open_endpoint(spec, "x", Clock())

    run(body)


@given(
    st.text(max_size=40)
    | st.builds(
        ":".join, st.tuples(st.sampled_from(["udpin", "udpout", "tcp", "tcpin", "serial", "pty"]), st.text(max_size=30))
    )
)
def test_any_text_is_a_spec_or_a_config_error_in_one_line(spec: str) -> None:
    try:
        assert parse_spec(spec).text == spec
    except ConfigError as exc:
        assert len(str(exc).splitlines()) == 1
