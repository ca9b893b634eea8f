"""Bytes as accidents leave them."""

import random


def odd(data: bytes, noise: random.Random, number: int) -> bytes:
    """Data with a few changes; the first ones are the usual accidents."""
    accidents = (b"", b"\n", bytes(64), data[: len(data) // 2], data[:-1], data[1:], noise.randbytes(500), data + data)
    if number < len(accidents):
        return accidents[number]
    changed = bytearray(data)
    for _ in range(noise.randrange(1, 4)):
        at = noise.randrange(len(changed))
        piece = noise.choice((noise.randbytes(1), noise.randbytes(4), b"\xff\xff\xff\xff", bytes(4), b"", b"\n", b","))
        changed[at : at + noise.choice((0, 1, 4))] = piece
    return bytes(changed)
