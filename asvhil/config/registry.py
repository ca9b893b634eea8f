"""Registries of what a config chooses by name: controllers, estimators, sensors, autopilots, motor outputs, links.

A row is a record (`ControllerKind`, ...) that describes what the name stands for. asvhil's own rows are in the modules
of this package; plug-in files and other installed packages add theirs (docs/extending.md). An own row names its factory
as text, `module:attribute`, which is imported when it is first used: so `config/` imports nothing above it, and a
daemon never loads a solver that it does not use.

Names are looked up while a config is read and while a backseat is built, never in a tick.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from types import NoneType
from typing import Any, Generic, TypeVar, get_args

from pydantic import BaseModel

from asvhil.config.single import clipped, within
from asvhil.errors import ConfigError, meant
from asvhil.types import record

PARAMETER_NAME_MAX = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """What a name in the config stands for.

    `build` is the factory; each kind says what it is called with. `section` is the model of the kind's own settings,
    and `key` their key in the config; empty: the name with `_` for `-`.
    """

    name: str
    build: Callable[..., Any] | str
    section: type[BaseModel] | None = None
    key: str = ""

    @property
    def settings_key(self) -> str:
        """The key of its settings."""
        return self.key or self.name.replace("-", "_")

    def builder(self) -> Callable[..., Any]:
        """The factory, imported first where `build` is text."""
        if callable(self.build):
            return self.build
        module, _, attribute = self.build.partition(":")
        found: Callable[..., Any] = getattr(importlib.import_module(module), attribute)
        return found

    def make(self, *arguments: Any) -> Any:
        """Call the factory."""
        return self.builder()(*arguments)


@record
class OperatorParameter:
    """A setting that operators may change while the controller runs: a MAVLink parameter of the daemon.

    `path` is its place in the controller's own section. The unit on the link is `scale` units of the config; a setting
    of named `choices` is their number on the link, from 0 on. ValueError where the name has more than the 16 characters
    of a MAVLink parameter.
    """

    name: str
    path: tuple[str, ...]
    least: float
    most: float
    scale: float = 1.0
    choices: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not 0 < len(self.name) <= PARAMETER_NAME_MAX:
            raise ValueError(f"parameter {self.name}: a name has 1 to {PARAMETER_NAME_MAX} characters")

    def on_link(self, value: Any) -> float:
        """A value of the config as the link has it."""
        return float(self.choices.index(value)) if self.choices else float(value) / self.scale

    def allows(self, value: float) -> bool:
        """Whether a value of the link is one that may be set; a NaN is not."""
        return within(value, self.least, self.most) and (not self.choices or value == int(value))

    def from_link(self, value: float) -> float | str:
        """An allowed value of the link as the config has it."""
        return self.choices[int(value)] if self.choices else clipped(value, self.least, self.most) * self.scale

    @property
    def range(self) -> str:
        """What may be set, in words."""
        if self.choices:
            return ", ".join(f"{number} ({name})" for number, name in enumerate(self.choices))
        return f"{self.least:g} to {self.most:g}"


@record
class SearchRange:
    """A setting that `asvhil tune` searches, from start / factor to start * factor on a logarithmic scale.

    `key` is its place in the controller's own section, with `[i]` or `[i,j]` for parts of a tuple.
    """

    key: str
    start: float
    factor: float = 4.0


def _without_none(annotation: Any) -> Any:
    """The model of a section that may be null."""
    models = [model for model in get_args(annotation) if model is not NoneType]
    return models[0] if len(models) == 1 else annotation


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerKind(Kind):
    """A controller (`controller.name`): `build(settings, config, model)` returns a `Controller`.

    `settings` is `controller.KEY`, the kind's own section, or None where it has none; `config` the whole config, and
    `model` the vessel model that the estimator uses too. ValueError where a parameter is no setting of the section.
    """

    label: str = ""  # its name in the tables of studies; empty: the name
    model: str = ""  # kind of the model file that it predicts with; empty: none, it gets the physics model
    solves: bool = False  # an MPC: solves the problem of `controller.mpc` by `controller.solver`
    keeps_station: bool = True  # False: without the procedure around it, and not in the studies
    parameters: tuple[OperatorParameter, ...] = ()  # the controller then has a method `retune(ControllerConfig)`
    search: tuple[SearchRange, ...] = ()

    def __post_init__(self) -> None:
        for parameter in self.parameters:
            model: Any = self.section
            for key in parameter.path:
                field_info = getattr(model, "model_fields", {}).get(key)
                if field_info is None:
                    path = ".".join(parameter.path)
                    raise ValueError(f"parameter {parameter.name}: the settings of {self.name} have no {path}")
                model = _without_none(field_info.annotation)


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatorKind(Kind):
    """A state estimator (`estimator.kind`): `build(settings, config, model)` makes a `StateEstimator`."""

    filters_wind: bool = True  # the wind is low-passed (`estimator.wind`); False: the last sample is used
    disturbance: bool = True  # it estimates one; without a wind sensor the wind is derived from it


@dataclass(frozen=True, slots=True, kw_only=True)
class SolverKind(Kind):
    """A solver of the MPC (`controller.solver`): `build(problem, caps)` makes a `Solver`.

    `caps` are the iterations that it is asked for, from its section, a `SolverCaps`; None: those of the MPC.
    """

    missing: str = ""  # the error where its module cannot be imported


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorKind(Kind):
    """A sensor (`links.sensors.NAME.kind`): `build(settings, port, messages)` makes a `SensorCodec`.

    `settings` is the link's section, of the model `section` (a `SensorLinkConfig`, which it is where None); `port` the
    link's name, and `messages` those that the config's sources name, of the kind's own.

    The simulated boat has the sensor too if there is `simulate(settings, t_ns, reading)`, which returns the bytes that
    it sends at `rate_hz`; `reading` is a `SensorReading` of simplant/boat/sensors.py.
    """

    messages: Mapping[str, tuple[str, ...]]  # by name, the quantities that each can give
    encoding: str = "octets"  # of its frames, as the log tells it to viewers
    simulate: Callable[[Any, int, Any], bytes] | None = None
    rate_hz: float = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class AutopilotKind(Kind):
    """An autopilot (`links.autopilot.profile`): `build(config)` makes a `MavlinkAutopilot` of the whole config."""

    modes: Mapping[str, int]  # by name: HEARTBEAT.custom_mode
    control_mode: str  # in which it obeys motor commands
    outputs: tuple[str, ...]  # ways to its motors, the default first
    streams_hz: Mapping[str, float]  # messages to ask for where the config names none
    imu_message: str
    mav_autopilot: int  # MAV_AUTOPILOT in its heartbeat
    firmware: str  # its name, for people
    least_version: tuple[int, int]
    unsuited: Mapping[str, str] = field(default_factory=dict)  # outputs that it does not have, and why


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputKind(Kind):
    """A way to the motors (`links.autopilot.output`): `build(link, pwm, wiring)` makes an `Output`.

    Motors obey one that overrides sticks in the profile's control mode alone, and any other in every mode, unless
    `control_mode` names one.
    """

    overrides_sticks: bool = False  # takes the place of the pilot's sticks, and shows as such in RC_CHANNELS
    control_mode: str = ""  # in which alone the motors obey it, where that is not the profile's
    profiles: tuple[str, ...] = ()  # autopilots that have it, beside those that name it themselves


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkKind(Kind):
    """A kind of endpoint, the word before the first colon of a link's spec: `build(spec, port, now_ns)` is awaited.

    It gives an `Endpoint`. `form` shows people what a spec looks like. `parse(spec)` gives the `LinkSpec` with what the
    kind reads out of its `rest`, and raises ValueError where that is wrong; without it the rest is taken as it is.
    """

    form: str
    parse: Callable[[Any], Any] | None = None


@record
class Origin:
    """Where a row comes from: a plug-in file, an installed package, or this package (all empty)."""

    file: str = ""
    sha256: str = ""
    package: str = ""
    version: str = ""

    def __str__(self) -> str:
        if self.file:
            return f"the plug-in {self.file} (SHA-256 {self.sha256[:12]})"
        return f"the package {self.package} {self.version}" if self.package else "asvhil"


K = TypeVar("K", bound=Kind)


class Registry(Generic[K]):
    """The rows of one kind by name.

    A name that is no row is looked for among the entry points of installed packages, by the group `asvhil.<group>`.
    """

    def __init__(self, kind: type[K], group: str, what: str) -> None:
        self.kind = kind
        self.group = f"asvhil.{group}"
        self.what = what
        self._rows: dict[str, K] = {}
        self._origins: dict[str, Origin] = {}

    def __iter__(self) -> Iterator[K]:
        """The rows that are known so far, in the order of the tables."""
        return iter(tuple(self._rows.values()))

    def fill(self, rows: Iterable[K]) -> None:
        """Rows of this package."""
        for row in rows:
            self._rows[row.name] = row
            self._origins[row.name] = Origin()

    def add(self, row: K, origin: Origin) -> None:
        """A row of a plug-in file or of another package. ConfigError where the name is one of asvhil's own."""
        if self._origins.get(row.name) == Origin():
            raise ConfigError(f"{origin}: asvhil has a {self.what} {row.name} of its own; give yours another name")
        self._rows[row.name] = row
        self._origins[row.name] = origin

    def forget_added(self) -> None:
        """Take out all rows but those of this package."""
        for name in [name for name, origin in self._origins.items() if origin != Origin()]:
            del self._rows[name], self._origins[name]

    def get(self, name: str) -> K | None:
        """The row of a name; None where neither a table nor an installed package has it."""
        if name not in self._rows:
            self._load_installed(name)
        return self._rows.get(name)

    def find(self, name: str) -> K:
        """The row of a name. ConfigError, one line that tells the names there are, where there is none."""
        row = self.get(name)
        if row is None:
            raise ConfigError(self.unknown(name))
        return row

    def at_key(self, key: str) -> K | None:
        """The row whose own settings stand under a key; None where there is none."""
        for row in self._rows.values():
            if row.section is not None and row.settings_key == key:
                return row
        found = self.get(key) or self.get(key.replace("_", "-"))
        return found if found is not None and found.section is not None and found.settings_key == key else None

    def names(self) -> list[str]:
        """All names, those of installed packages included."""
        installed = importlib.metadata.entry_points(group=self.group).names
        return [*self._rows, *sorted(set(installed) - set(self._rows))]

    def own_names(self) -> list[str]:
        """The names in the tables of this package."""
        return [name for name, origin in self._origins.items() if origin == Origin()]

    def origin(self, name: str) -> Origin:
        """Where a row comes from."""
        return self._origins[name]

    def unknown(self, name: str) -> str:
        """What to tell of a name that there is not."""
        return f"unknown {self.what}{meant(name, self.names())}"

    def checked(self, name: str) -> str:
        """A name, for validators: ValueError where there is no such row."""
        if self.get(name) is None:
            raise ValueError(self.unknown(name))
        return name

    def _load_installed(self, name: str) -> None:
        """Add the row that an installed package has under a name. ConfigError where it cannot be had."""
        for entry in importlib.metadata.entry_points(group=self.group, name=name):
            package = entry.dist.name if entry.dist is not None else entry.module
            version = entry.dist.version if entry.dist is not None else "without version"
            origin = Origin(package=package, version=version)
            where = f"{origin}, entry point {name} = {entry.value} of {self.group}"
            try:
                row = entry.load()
            except Exception as error:
                raise ConfigError(f"{where}: {type(error).__name__}: {' '.join(str(error).split())}") from None
            if not isinstance(row, self.kind) or row.name != name:
                raise ConfigError(f"{where}: a {self.kind.__name__} of the name {name} is expected there")
            self.add(row, origin)


CONTROLLERS = Registry(ControllerKind, "controllers", "controller")
ESTIMATORS = Registry(EstimatorKind, "estimators", "estimator")
SOLVERS = Registry(SolverKind, "solvers", "solver")
SENSORS = Registry(SensorKind, "sensors", "sensor")
AUTOPILOTS = Registry(AutopilotKind, "autopilots", "autopilot")
OUTPUTS = Registry(OutputKind, "outputs", "motor output")
LINKS = Registry(LinkKind, "links", "kind of link")
REGISTRIES: tuple[Registry[Any], ...] = (CONTROLLERS, ESTIMATORS, SOLVERS, SENSORS, AUTOPILOTS, OUTPUTS, LINKS)
