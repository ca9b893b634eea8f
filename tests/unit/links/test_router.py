"""The return address of an operator behind another link: there and back by a field of the frame."""

from itertools import zip_longest
from pathlib import Path

import pytest

from asvhil.config import load_config
from asvhil.io.mavlink.frames import dialect
from asvhil.io.mavlink.signing import Signer, SigningClock, Verdict, Verifier, derive_key
from asvhil.links.router import MavlinkRouter
from asvhil.operator.encoding import encode_hold
from asvhil.types import Address, Frame

QGC = "ground.qgc"
GCS = dialect.MAVLink(None, srcSystem=255, srcComponent=190)


class Carrier:
    """A link that keeps what is forwarded on it."""

    def __init__(self) -> None:
        self.forwarded: list[bytes] = []
        self.proven: list[str] = []

    def note_proven(self, peer: str) -> None:
        self.proven.append(peer)

    async def forward(self, data: bytes) -> bool:
        self.forwarded.append(data)
        return True


def router() -> tuple[MavlinkRouter, list[Frame], Carrier]:
    """A router with one ground station, the frames that it passed on to the autopilot, and the autopilot's link."""
    config = load_config("sitl", ("links.ground_stations.qgc.endpoint=udpin:127.0.0.1:14551",))
    noted: list[Frame] = []
    made = MavlinkRouter(config.links, start_ns=0, unix_ns=lambda: 0, on_forward=noted.append)
    autopilot = Carrier()
    made.attach({"autopilot": autopilot, QGC: Carrier()})
    return made, noted, autopilot


async def test_frames_of_the_vehicle_prove_their_peer_on_its_link_and_nothing_else_does() -> None:
    made, _, autopilot = router()
    beat = dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_SURFACE_BOAT, 3, 81, 0, 4, 3)
    ours, others = (bytes(beat.pack(dialect.MAVLink(None, srcSystem=system, srcComponent=1))) for system in (1, 7))
    for peer, data in (("a:1", b"\0"), ("b:2", others), ("c:3", ours), ("d:4", ours[:-1] + b"\0")):
        await made.receive(Frame(t_ns=7, port="autopilot", data=data, peer=peer))
    assert autopilot.proven == ["c:3"]


async def test_without_routes_or_rules_a_peer_is_proven_too() -> None:
    made, link = MavlinkRouter(load_config("sitl").links, start_ns=0, unix_ns=lambda: 0), Carrier()
    made.attach({"autopilot": link})
    beat = dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_SURFACE_BOAT, 3, 81, 0, 4, 3)
    frame = Frame(t_ns=7, port="autopilot", peer="a:1", data=beat.pack(dialect.MAVLink(None, 1, 1)))
    assert await made.receive(frame) == [frame] and link.proven == ["a:1"]


async def test_what_is_for_us_comes_by_the_operators_port_with_its_way_back() -> None:
    made, _, autopilot = router()
    data = encode_hold(load_config("sitl").links.autopilot, None, None, None)
    (frame,) = await made.receive(Frame(t_ns=7, port=QGC, data=data, peer="10.0.0.1:5"))
    assert frame == Frame(t_ns=7, port="operator", data=data, peer="10.0.0.1:5", via=QGC)
    assert frame.address == Address(QGC, "10.0.0.1:5") and autopilot.forwarded == []


def test_an_answer_leaves_by_the_link_that_it_came_by() -> None:
    made, _, _ = router()
    answer = Frame(t_ns=8, port="operator", data=b"ack", peer="10.0.0.1:5", via=QGC)
    assert made.outgoing(answer) == [Frame(t_ns=8, port=QGC, data=b"ack", peer="10.0.0.1:5")]
    behind_a_stream = Frame(t_ns=8, port="operator", data=b"ack", via=QGC)  # a link without peers
    assert made.outgoing(behind_a_stream) == [Frame(t_ns=8, port=QGC, data=b"ack")]
    own = Frame(t_ns=8, port="operator", data=b"ack", peer="10.0.0.1:5")
    assert made.outgoing(own) == [own]


async def test_what_is_passed_on_to_the_autopilot_names_the_link_that_it_came_by() -> None:
    made, noted, autopilot = router()
    await made.receive(Frame(t_ns=1, port="autopilot", data=bytes(heartbeat(1, 1)), peer="10.0.0.2:1"))
    data = bytes(dialect.MAVLink_param_request_list_message(1, 1).pack(GCS))
    assert await made.receive(Frame(t_ns=2, port=QGC, data=data, peer="10.0.0.1:5")) == []
    assert autopilot.forwarded == [data]
    assert noted == [Frame(t_ns=2, port="autopilot", data=data, via=QGC)]


def heartbeat(system_id: int, component_id: int) -> bytes:
    sender = dialect.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
    return bytes(dialect.MAVLink_heartbeat_message(11, 3, 81, 0, 4, 3).pack(sender))


def cut(data: bytes, size: int) -> list[bytes]:
    return [data[at : at + size] for at in range(0, len(data), size)]


@pytest.mark.parametrize("size", [1, 9, 64, 256, 300])
async def test_frames_cut_anywhere_are_routed_whole_each_to_its_peers_way(size: int) -> None:
    made, noted, autopilot = router()
    await made.receive(Frame(t_ns=0, port="autopilot", data=heartbeat(1, 1), peer="boat:1"))
    list_all = bytes(dialect.MAVLink_param_request_list_message(1, 1).pack(GCS))
    ours = encode_hold(load_config("sitl").links.autopilot, None, None, None)
    sent = {"10.0.0.1:5": list_all * 20, "10.0.0.2:5": ours * 20}
    taken: list[Frame] = []
    pieces = zip_longest(*(cut(data, size) for data in sent.values()), fillvalue=b"")
    for t_ns, chunks in enumerate(pieces):
        for peer, chunk in zip(sent, chunks, strict=True):
            taken += await made.receive(Frame(t_ns=t_ns, port=QGC, data=chunk, peer=peer))
    assert autopilot.forwarded == [list_all] * 20 and [frame.data for frame in noted] == [list_all] * 20
    assert [frame.data for frame in taken] == [ours] * 20 and {frame.peer for frame in taken} == {"10.0.0.2:5"}


@pytest.mark.parametrize("size", [1, 9, 64, 256, 300])
async def test_signatures_of_frames_cut_anywhere_are_checked(size: int, tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_text("open sesame")
    key.chmod(0o600)
    signing = f"links.autopilot.signing={{key_file: {key}}}"
    config = load_config("sitl", (signing, "links.autopilot.senders=['1/1']"))
    made = MavlinkRouter(config.links, start_ns=0, unix_ns=lambda: 1_800_000_000_000_000_000)
    clock = SigningClock()
    signer = Signer(derive_key("open sesame"), 0, clock)
    good = [signer.sign(heartbeat(1, 1), 1_800_000_000_000_000_000 + n) for n in range(30)]
    forged = [
        *good[10:11],
        Signer(derive_key("other"), 0, SigningClock()).sign(heartbeat(1, 1), 10**18),
        heartbeat(1, 1),
    ]
    data = b"".join((*good[:20], *forged, *good[20:]))
    taken: list[bytes] = []
    for t_ns, chunk in enumerate(cut(data, size)):
        taken += [f.data for f in await made.receive(Frame(t_ns=t_ns, port="autopilot", data=chunk, peer="boat:1"))]
    assert b"".join(taken) == b"".join(good)
    assert made.remarks("autopilot") == "frames dropped: 1 replayed, 1 unsigned, 1 wrongly signed"


@pytest.mark.parametrize("component", [0, 1])
async def test_sticks_that_are_passed_on_to_the_autopilot_are_shown_to_us_too(component: int) -> None:
    made, _, autopilot = router()
    await made.receive(Frame(t_ns=0, port="autopilot", data=heartbeat(1, 1), peer="boat:1"))
    sticks = (
        dialect.MAVLink_rc_channels_override_message(1, component, 1600, *[65535] * 7),
        dialect.MAVLink_manual_control_message(1, 0, 300, 0, 0, 0),
    )
    for number, message in enumerate(sticks, start=1):
        data = bytes(message.pack(GCS))
        shown = await made.receive(Frame(t_ns=number, port=QGC, data=data, peer="10.0.0.1:5"))
        assert shown == [Frame(t_ns=number, port="operator", data=data, peer="10.0.0.1:5", via=QGC)]
        assert autopilot.forwarded[-1] == data


def test_last_words_are_accepted_after_all_that_left_meanwhile_and_before_what_leaves_a_second_later(
    tmp_path: Path,
) -> None:
    key = tmp_path / "key"
    key.write_text("open sesame")
    key.chmod(0o600)
    config = load_config("sitl", (f"links.autopilot.signing={{key_file: {key}, link_id: 3}}",))
    now_ns = 1_800_000_000_000_000_000
    made = MavlinkRouter(config.links, start_ns=0, unix_ns=lambda: now_ns)
    frame = Frame(t_ns=0, port="autopilot", data=heartbeat(1, 191))
    autopilot = Verifier(derive_key("open sesame"), SigningClock(), max_ahead_s=None)

    def accepts(data: bytes) -> bool:
        return autopilot.check(data, 0, now_ns) is Verdict.ACCEPTED

    steps = made.last_words([[frame, frame], [frame]])
    for _ in range(100):  # in the same tick, while time stands still: each one more than the last
        assert accepts(made.outgoing(frame)[0].data)
    said = [data for words in steps for data in words]
    assert len(said) == 3 and all(accepts(data) for data in said)
    assert not accepts(made.outgoing(frame)[0].data)
    now_ns += 1_100_000_000  # a daemon that is started again needs longer
    assert accepts(made.outgoing(frame)[0].data)
