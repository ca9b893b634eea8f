"""Who may see the page, and who may use its controls: hosts, origins and the token. Pure functions but for a file."""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
from pathlib import Path
from urllib.parse import urlsplit

from asvhil.errors import ConfigError

LEAST_CHARACTERS = 16


class PageAccess:
    """The rules. `token` None: nobody may use the controls.

    A page of another site that a browser has open must get nothing: neither by a name that it lets point at us (DNS
    rebinding; hence the check of Host), nor by a request across origins (hence that of Origin, which a browser always
    sends with a WebSocket).
    """

    def __init__(
        self,
        token: str | None,
        hosts: tuple[str, ...] = (),
        origins: tuple[str, ...] = (),
        *,
        token_in_file: bool = False,
    ) -> None:
        """`hosts`: further names by which the page is called; `origins`: pages of others that may embed it.

        `token_in_file`: whether the token is a file's, and so on no terminal.
        """
        self._token = token
        self.token_in_file = token_in_file
        name = socket.gethostname().lower()
        self._hosts = {"localhost", name, f"{name}.local", *(host.lower() for host in hosts)}
        self._origins = {origin.lower().rstrip("/") for origin in origins}

    @property
    def controllable(self) -> bool:
        """Whether there is a token at all."""
        return self._token is not None

    def refusal(self, host: str | None, origin: str | None) -> str:
        """Why a request is refused whatever it asks for; empty where it is not."""
        name = _name_of(host)
        if name is None or not (name in self._hosts or _is_address(name)):
            return f"this page is not called {name or 'nothing'}: `asvhil dashboard --allow-host NAME` lets it be"
        if origin is None or origin.lower() in self._origins:
            return ""
        try:
            parts = urlsplit(origin.lower())
        except ValueError:  # such as a bracket that is not closed
            return "its Origin is none"
        if parts.scheme in ("http", "https") and parts.netloc and parts.netloc == (host or "").lower():
            return ""
        return f"a page of {origin} may not ask for this"

    def may_control(self, authorization: str | None) -> bool:
        """Whether an Authorization header has the token (Bearer); compared in a time that tells nothing of it."""
        kind, _, given = (authorization or "").partition(" ")
        if self._token is None or kind.lower() != "bearer":
            return False
        return hmac.compare_digest(given.strip().encode(errors="replace"), self._token.encode())


def new_token() -> str:
    """A token that nobody guesses."""
    return secrets.token_urlsafe(16)


def read_token(path: Path) -> str:
    """The token of a file. Raises ConfigError where there is none that would do."""
    try:
        token = path.expanduser().read_text().strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: no token can be read ({getattr(error, 'strerror', None) or 'no text'})") from None
    if len(token) < LEAST_CHARACTERS or not (token.isascii() and token.isprintable()) or " " in token:
        raise ConfigError(f"{path}: a token is one word of {LEAST_CHARACTERS} printable ASCII characters or more")
    return token


def _name_of(host: str | None) -> str | None:
    """The name in a Host header, without its port; None where there is none."""
    try:
        return urlsplit(f"//{host}").hostname if host else None
    except ValueError:
        return None


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
