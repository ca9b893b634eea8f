"""Files of signing keys and timestamps. Timestamps are also written while running; a key is never printed."""

from __future__ import annotations

import json
import os
import stat
from pathlib import Path

from asvhil.errors import ConfigError
from asvhil.io.mavlink.signing import FIRST_START, SigningState, Stream, derive_key

MAX_KEY_FILE_BYTES = 4096
OWNER_ONLY = 0o600


def read_key(path: Path) -> tuple[bytes, str | None]:
    """The key in a file, and a warning if other users may read it. ConfigError names the file, never its content."""
    try:
        with path.open("rb") as file:
            mode = os.fstat(file.fileno()).st_mode
            data = file.read(MAX_KEY_FILE_BYTES + 1)
    except OSError as error:
        raise ConfigError(f"{path}: the signing key cannot be read ({error.strerror})") from None
    if len(data) > MAX_KEY_FILE_BYTES:
        raise ConfigError(f"{path}: too long for a signing key; 64 hexadecimal digits or a passphrase is expected")
    try:
        key = derive_key(data.decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not text; 64 hexadecimal digits or a passphrase is expected") from None
    except ConfigError as error:
        raise ConfigError(f"{path}: the signing key {error}") from None
    others = stat.S_IMODE(mode) & 0o077
    return key, f"{path}: others may read the signing key; chmod 600 it" if others else None


def read_state(path: Path) -> SigningState:
    """The timestamps of the last run; none where there was no last run. ConfigError on a damaged file."""
    try:
        text = path.read_text(encoding="ascii")
    except FileNotFoundError:
        return FIRST_START
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not ASCII"
        raise ConfigError(f"{path}: signing timestamps cannot be read ({reason})") from None
    try:
        tree = json.loads(text)
        streams = {_stream(name): _timestamp(value) for name, value in tree["streams"].items()}
        return SigningState(last=_timestamp(tree["last"]), streams=streams)
    except (ValueError, KeyError, TypeError, AttributeError):
        # Not read as empty: then recorded frames would be accepted again.
        raise ConfigError(f"{path}: signing timestamps are damaged; delete the file to start without them") from None


def write_state(path: Path, state: SigningState) -> None:
    """Replace the file atomically and sync it. OSError."""
    streams = {"/".join(map(str, stream)): timestamp for stream, timestamp in sorted(state.streams.items())}
    data = json.dumps({"last": state.last, "streams": streams}).encode()
    fresh = path.with_name(f"{path.name}.{os.getpid()}")
    fd = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, OWNER_ONLY)
    try:
        os.write(fd, data)
        os.fsync(fd)
    finally:
        os.close(fd)
    os.replace(fresh, path)


def _stream(name: str) -> Stream:
    system_id, component_id, link_id = (int(part) for part in name.split("/"))
    return system_id, component_id, link_id


def _timestamp(value: object) -> int:
    if not isinstance(value, int) or not 0 <= value < 1 << 48:
        raise ValueError
    return value
