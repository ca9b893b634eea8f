"""Port names have one home: no module compares or fills a port with a literal of its own."""

import re
from pathlib import Path

import asvhil
from asvhil.config import ports

NAMES = "|".join((ports.AUTOPILOT, ports.OPERATOR, ports.ANEMOMETER, ports.GNSS, ports.INS))
LITERAL = re.compile(rf"""\b(?:port|PORT|link)\s*(?:=|==|!=)\s*["'](?:{NAMES})["']""")


def test_no_module_spells_a_port_name_itself() -> None:
    package = Path(asvhil.__file__).parent
    sources = [path for path in package.rglob("*.py") if path != Path(ports.__file__)]
    assert len(sources) > 200
    assert [f"{path}: {found}" for path in sources for found in LITERAL.findall(path.read_text("utf-8"))] == []
