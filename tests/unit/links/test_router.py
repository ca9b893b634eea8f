"""The return address of an operator behind another link: there and back by a field of the frame."""

from asvhil.config import load_config
from asvhil.io.mavlink.frames import dialect
from asvhil.links.router import MavlinkRouter
from asvhil.operator.session import encode_hold
from asvhil.types import Address, Frame

QGC = "ground.qgc"
GCS = dialect.MAVLink(None, srcSystem=255, srcComponent=190)


class Carrier:
    """A link that keeps what is forwarded on it."""

    def __init__(self) -> None:
        self.forwarded: list[bytes] = []

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
