"""Who may see the page and who may use its controls: by names, origins and the token."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from asvhil.dashboard.access import PageAccess, new_token, read_token
from asvhil.errors import ConfigError

TOKEN = "0123456789abcdef"
ACCESS = PageAccess(TOKEN, hosts=("boat.example",), origins=("http://cockpit.example:8080/",))


@pytest.mark.parametrize(
    "host",
    ["127.0.0.1:8095", "localhost:8095", "[::1]:8095", "192.168.2.2", "boat.example:80", f"{socket.gethostname()}:1"],
)
def test_the_page_is_called_by_an_address_or_a_name_of_its_own(host: str) -> None:
    assert ACCESS.refusal(host, None) == ""
    assert ACCESS.refusal(host, f"http://{host}") == ""


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8095", "127.0.0.1.evil.example", "", None, "[::1", "a]b"]
)
def test_another_name_that_leads_here_gets_nothing(host: str | None) -> None:
    assert ACCESS.refusal(host, None)


@pytest.mark.parametrize(
    "origin",
    [
        *("http://evil.example", "https://evil.example", "null", "", "file://", "http://127.0.0.1:8096"),
        *("http://127.0.0.1", "http://127.0.0.1:8095.evil.example", "ftp://127.0.0.1:8095", "http://[::1"),
    ],
)
def test_a_page_of_another_origin_gets_nothing(origin: str) -> None:
    assert ACCESS.refusal("127.0.0.1:8095", origin)


def test_an_origin_that_was_allowed_may() -> None:
    assert ACCESS.refusal("127.0.0.1:8095", "http://cockpit.example:8080") == ""
    assert ACCESS.refusal("evil.example", "http://cockpit.example:8080"), "by the right name still"


@pytest.mark.parametrize(
    "header",
    [
        None,
        "",
        TOKEN,
        f"Basic {TOKEN}",
        "Bearer",
        "Bearer ",
        f"Bearer {TOKEN}x",
        f"Bearer {TOKEN[:-1]}",
        "Bearer \u00e9",
        "Bearer \udce9",  # as a byte that is no UTF-8 comes
    ],
)
def test_without_the_token_nobody_controls(header: str | None) -> None:
    assert not ACCESS.may_control(header)
    assert not PageAccess(None).may_control(header) and not PageAccess(None).may_control(f"Bearer {TOKEN}")


def test_with_it_one_does() -> None:
    assert ACCESS.may_control(f"Bearer {TOKEN}") and ACCESS.may_control(f"bearer {TOKEN} ")
    assert ACCESS.controllable and not PageAccess(None).controllable


def test_tokens_are_long_and_never_the_same() -> None:
    assert len({new_token() for _ in range(50)}) == 50 and len(new_token()) >= 20


@pytest.mark.parametrize(
    "content",
    [
        *(b"", b"short", b"two words of a token", "0123456789abcdé€".encode(), b"\xff" * 20),
        b"0123456789\x01abcdef",  # which no header may have
    ],
)
def test_a_file_without_a_token_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "token"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match="token"):
        read_token(path)
    with pytest.raises(ConfigError, match="No such file"):
        read_token(tmp_path / "nowhere")


def test_a_token_is_read_without_its_end_of_line(tmp_path: Path) -> None:
    path = tmp_path / "token"
    path.write_text(f"{TOKEN}\n")
    assert read_token(path) == TOKEN
