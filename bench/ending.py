"""How a benchmark ends that cannot go on, or is told to stop: a line and a status, never a traceback."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

from asvhil.errors import AsvhilError, is_interrupt

INTERRUPTED = 130


def end_in_words(main: Callable[[], int | None]) -> NoReturn:
    """Call `main` and end the process: with its status, 2 where something is wrong, 130 after Ctrl-C.

    A file that is not there, a port that is taken and the like are `OSError`; the package refuses by its own errors.
    """
    try:
        sys.exit(main())
    except (Exception, KeyboardInterrupt) as error:
        if is_interrupt(error):
            print("interrupted", file=sys.stderr)
            sys.exit(INTERRUPTED)
        if not isinstance(error, AsvhilError | OSError):
            raise
        print(f"{Path(sys.argv[0]).stem}: {error}", file=sys.stderr)
        sys.exit(2)
