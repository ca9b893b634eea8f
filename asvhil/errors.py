"""The errors that asvhil raises on purpose; each becomes one line and a non-zero exit at the command line."""


class AsvhilError(Exception):
    """Root of the tree. The message is one line that names the file, key or offset, and what would be right."""


class ConfigError(AsvhilError):
    """A config file, a key in it, or a command-line override is wrong. Raised at start-up only."""


class LinkError(AsvhilError):
    """An endpoint cannot be opened, or its peer is gone. Endpoints are one-shot: the daemon opens a new one."""


class LogError(AsvhilError):
    """A log cannot be read or written, or does not hold what the command needs."""


class ModelError(AsvhilError):
    """A vessel model cannot be loaded, or does not belong to this vehicle."""
