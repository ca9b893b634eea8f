"""The example of docs/development.md: a fault is put into a recorded log, and a backseat steps through it."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.support.paths import ROOT


def test_the_example_of_the_page_for_developers(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "development.md").read_text()
    (source,) = [block for block in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "def test_" in block]
    namespace: dict[str, Any] = {}
    exec(compile(source, "docs/development.md", "exec"), namespace)
    tests: list[Callable[[Path], None]] = [value for name, value in namespace.items() if name.startswith("test_")]
    assert len(tests) == 1
    tests[0](tmp_path)
