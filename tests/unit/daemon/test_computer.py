"""The state of the computer, as ONBOARD_COMPUTER_STATUS."""

from pathlib import Path

from asvhil.config import load_config
from asvhil.daemon.computer import ComputerStatus
from asvhil.io.mavlink.frames import FrameSplitter, decode
from asvhil.operator.encoding import encode_presence
from asvhil.operator.reports import OperatorReport
from asvhil.operator.session import OperatorSession
from asvhil.types import Frame
from tests.support.messages import messages

CONFIG = load_config("sitl").links.autopilot


def status(computer: ComputerStatus) -> object:
    (data,) = FrameSplitter().receive(computer.encode())
    return decode(data)


def proc(folder: Path, busy: int, idle: int) -> Path:
    (folder / "stat").write_text(
        f"cpu  9 9 9 9 9\ncpu0 {busy} 0 0 {idle} 0 0 0 0\ncpu1 0 0 {busy} {2 * idle} 0 0 0 0\nintr 1\n"
    )
    (folder / "meminfo").write_text("MemTotal:  4096000 kB\nMemFree: 10 kB\nMemAvailable: 1024000 kB\n")
    return folder


def test_loads_are_those_since_the_last_call(tmp_path: Path) -> None:
    computer = ComputerStatus(CONFIG, tmp_path, proc(tmp_path, 100, 100))
    first = status(computer)
    assert first.cpu_cores == [0, 0] + [255] * 6  # type: ignore[attr-defined]
    proc(tmp_path, 130, 110)
    second = status(computer)
    assert second.cpu_cores == [75, 60] + [255] * 6  # type: ignore[attr-defined]
    assert (second.ram_total, second.ram_usage) == (4000, 3000)  # type: ignore[attr-defined]
    assert 0 < second.storage_usage[0] <= second.storage_total[0]  # type: ignore[attr-defined]


def test_what_a_system_does_not_tell_is_left_out(tmp_path: Path) -> None:
    told = status(ComputerStatus(CONFIG, tmp_path / "gone", tmp_path / "none"))
    assert told.cpu_cores == [255] * 8 and told.ram_total == 2**32 - 1  # type: ignore[attr-defined]
    assert told.storage_total[0] == 2**32 - 1  # type: ignore[attr-defined]


def test_operators_get_it_once_a_second(tmp_path: Path) -> None:
    session = OperatorSession(CONFIG)
    told = ComputerStatus(CONFIG, tmp_path).encode()
    session.receive(Frame(t_ns=0, port="operator", data=encode_presence(), peer="10.0.0.9:14550"))
    session.receive(Frame(t_ns=0, port="operator", data=told, peer="10.0.0.9:14550"))  # not ours: it has a peer
    assert session.computer is None
    session.receive(Frame(t_ns=0, port="operator", data=told))
    found = []
    for tick in range(60):
        report = OperatorReport(computer=session.computer)
        found += messages(session.data_to_send(tick * 50_000_000, report), "operator")
    sent = [m for m in found if m.get_type() == "ONBOARD_COMPUTER_STATUS"]
    assert len(sent) == 3 and {m.ram_total for m in sent} == {session.computer.ram_total}
