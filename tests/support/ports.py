"""Ports for tests on loopback."""

import itertools
import os
import socket

# Below those that the kernel gives to whoever asks for any; a part for each process of the test run, since a port is
# free again until the program under test has opened it.
FIRST, EACH = 20_000, 3_000
WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % 4
_order = itertools.count(os.getpid() * 37)


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    """A port of 127.0.0.1 that nothing uses: of UDP, or of TCP with SOCK_STREAM. Each call gives another one."""
    while True:
        port = FIRST + EACH * WORKER + next(_order) % EACH
        with socket.socket(socket.AF_INET, kind) as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
        return port
