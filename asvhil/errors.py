"""The errors that asvhil raises on purpose: one class for each kind of cause, all of them below `AsvhilError`.

    Exception
    +-- AsvhilError
        +-- ConfigError   a config, a key or an option is wrong
        +-- LinkError     a port cannot be opened, or its peer is gone
        +-- LogError      a log or a data file cannot be read or written
        +-- ModelError    a model cannot be loaded, does not fit, or cannot be trained

A message is one line that names the file, key or byte and, where it can, what would be right. The command line prints
it as `asvhil: MESSAGE` and exits with status 2. Bad bytes on a link raise nothing: codecs drop and count them.
"""

import difflib
from collections.abc import Iterable


def meant(name: str, known: Iterable[str], between: str = ", ") -> str:
    """What to tell behind a name that there is not, such as ", did you mean loiter? (known: loiter, ...)"."""
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1)
    return f"{f', did you mean {near[0]}?' if near else ''} (known: {between.join(names)})"


class AsvhilError(Exception):
    """Root of the tree, and raised itself for what fits no class below.

    Example situations:
      - the backseat failed in `asvhil run`; the motors were released
      - `asvhil check --fix` on an armed vehicle
      - the log of `asvhil calibrate` has too few circles
    """

    def __init__(self, message: str = "") -> None:
        """The message; what would break its line, or move a terminal's cursor, is shown escaped.

        Names and values that it quotes come from files and command lines, and may hold anything.
        """
        super().__init__("".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in message))


class ConfigError(AsvhilError):
    """A config file, a key in it, or an option of a command is wrong. Raised at start-up, before anything moves.

    Example situations:
      - an unknown key, or a value out of its range
      - a source that no configured link can give
      - a link spec with an unknown kind or without a port
      - `controller.solver: torch-lqr` without torch installed
    """


class LinkError(AsvhilError):
    """A port cannot be opened, or its peer is gone. An endpoint that raised it stays closed; the daemon opens another.

    Example situations:
      - the serial device does not exist, or was unplugged
      - another program listens on the UDP or TCP port
      - the peer of a TCP link closed the connection
      - `asvhil check` got no heartbeat
      - the autopilot refuses to write a file, or does not answer MAVFTP
    """


class LogError(AsvhilError):
    """A log or a data file cannot be read or written, or does not hold what the command needs.

    Example situations:
      - the file is no log of asvhil, of another layout, or damaged (the message names the byte)
      - replay of a log without a config record
      - training from a log with less than 30 s of usable data
      - a CSV file without a column that the column map names
    """


class ModelError(AsvhilError):
    """A vessel model cannot be loaded, does not belong to this vehicle, step or controller, or cannot be trained.

    Example situations:
      - the model file is damaged, or holds a pickled object
      - the model was trained for another vehicle, or with another step than `controller.mpc.first_step_s`
      - the training data hold no motion, or training diverges
    """


class OtherHullError(ModelError):
    """A model was trained on another boat, by its hull and motors, than `vehicle.vessel` describes."""


class OtherTrainingError(ModelError):
    """The state of an interrupted training is of other data, options or seeds than are asked for."""


def is_interrupt(error: BaseException | None) -> bool:
    """Whether it is Ctrl-C, or came of one.

    Libraries hand on what is raised within them as errors of their own (pydantic in its words alone), and what has
    lost its other end to the same Ctrl-C fails while it is cleared away.
    """
    while error is not None:
        if isinstance(error, KeyboardInterrupt) or "KeyboardInterrupt" in str(error):
            return True
        error = error.__cause__ or error.__context__
    return False
