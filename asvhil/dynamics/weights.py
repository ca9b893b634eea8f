"""Model files: weights, scaling, step and origin of a learned model in an npz archive. Pickles are never loaded."""

from __future__ import annotations

import functools
import io
import json
import lzma
import math
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from asvhil.config import VesselConfig
from asvhil.dynamics.arrays import Array
from asvhil.dynamics.fitted_sd import PARAMETERS, FittedSd
from asvhil.dynamics.hull import differences
from asvhil.dynamics.knode import Knode
from asvhil.dynamics.lagnet import LagNet, ThrustMap
from asvhil.dynamics.nnsem import Nnsem, Scaling, TanhNetwork
from asvhil.dynamics.node import Node
from asvhil.dynamics.ordered import product
from asvhil.dynamics.protocol import Dynamics
from asvhil.errors import ModelError, OtherHullError
from asvhil.files import is_file, is_there, replacement
from asvhil.types import record

FORMAT = 1
MOST_BYTES = 200_000_000  # of all arrays of a file: a checkpoint of many tries has some MB
DT_TOLERANCE_S = 1e-6
REMEMBERED = 8  # models
MOST_REMEMBERED_BYTES = 1_000_000  # of the file of one: of a shipped one some 20 kB

# What zipfile and numpy's parser of headers raise for what is no array, beside ValueError and OSError.
_DAMAGE = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, EOFError, SyntaxError, tokenize.TokenError)

Shape = tuple[int | str, ...]  # a letter is a free length, the same in all shapes of a file

_NETWORK: dict[str, Shape] = {"w1": ("H", 7), "b1": ("H",), "w2": (3, "H"), "b2": (3,)}
_SHAPES: dict[str, dict[str, Shape]] = {
    "sd": {"parameters": (len(PARAMETERS),)},
    "nnsem": _NETWORK,
    "node": _NETWORK,
    "knode": _NETWORK
    | {"prior": (len(PARAMETERS),), "prior_scale": (3,)}
    | {"g_w1": ("G", 6), "g_b1": ("G",), "g_w2": (3, "G"), "g_b2": (3,)},
    "lagnet": _NETWORK
    | {"skip": (3, 16), "map_gain": ("M",), "map_slope": ("M",), "map_centre": ("M",)}
    | {"lag_s": (), "direct": ()},
}
_POSITIVE = {"prior_scale", "map_gain", "map_slope", "lag_s"}
_SCALING: dict[str, Shape] = {"centre": (7,), "half": (7,)}
_ORIGIN = ("vehicle", "data_hash", "config_hash")
KINDS = tuple(_SHAPES)


@record
class TrainedModel:
    """The contents of a model file.

    `data_hash`, `config_hash` and `seed` identify the origin of the model; `figures` are JSON-serialisable figures of
    its training, for display. `hull`: of the boat that it was trained on (`hull.hull_of`), None or empty where that was
    not told.
    """

    kind: str
    vehicle: str
    dt_s: float
    scaling: Scaling
    weights: Mapping[str, Array]
    data_hash: str
    config_hash: str
    seed: int
    figures: Mapping[str, Any]
    hull: Mapping[str, float] | None = None

    def dynamics(self) -> Dynamics:
        """The model as `Dynamics`."""
        return _BUILDERS[self.kind](self)


def save_model(path: Path, model: TrainedModel) -> None:
    """Write a model file atomically. Raises ModelError where it cannot be written or read back."""
    arrays: dict[str, Any] = {
        "format": FORMAT,
        "kind": model.kind,
        "vehicle": model.vehicle,
        "dt_s": model.dt_s,
        "data_hash": model.data_hash,
        "config_hash": model.config_hash,
        "seed": model.seed,
        "figures": json.dumps(model.figures, sort_keys=True),
        "hull": json.dumps(dict(model.hull or {}), sort_keys=True),
        "centre": model.scaling.centre,
        "half": model.scaling.half,
        **{f"weights.{name}": value for name, value in model.weights.items()},
    }
    _checked({name: np.asarray(value) for name, value in arrays.items()}, path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacement(path) as part, part.open("wb") as file:
            np.savez(file, **arrays)
    except OSError as error:
        raise ModelError(f"{path}: cannot be written ({error.strerror})") from None


def read_model(path: str | Path) -> TrainedModel:
    """The contents of a model file. Raises ModelError where it is missing, damaged or of an unknown kind."""
    return _checked(read_arrays(Path(path)), Path(path))


def load_model(
    path: str | Path, *, vehicle: str | None = None, vessel: VesselConfig | None = None, dt_s: float | None = None
) -> Dynamics:
    """The `Dynamics` of a file, checked against a vehicle's name, a hull and a step (s) where these are given.

    Raises ModelError as `read_model` does, and where the model belongs to another vehicle or step; OtherHullError
    where it was trained on a boat of the same name that is another one by its hull or motors.
    """
    model, dynamics = _read(Path(path))
    if vehicle is not None and model.vehicle != vehicle:
        raise ModelError(f"{path}: this model was trained for vehicle {model.vehicle!r}, not for {vehicle!r}")
    apart = "" if vessel is None else differences(model.hull or {}, vessel)
    if apart:
        raise OtherHullError(
            f"{path}: this model was trained on another boat than vehicle.vessel describes ({apart}): train one on "
            "this boat (docs/models.md), or let controller.on_other_hull say what to do"
        )
    if dt_s is not None and abs(model.dt_s - dt_s) > DT_TOLERANCE_S:
        raise ModelError(f"{path}: this model has steps of {model.dt_s:g} s, but {dt_s:g} s are asked for")
    return dynamics


def _read(path: Path) -> tuple[TrainedModel, Dynamics]:
    """The contents of a model file, and its model. Raises ModelError as `read_model` does.

    Equal bytes give the same object, since what is made of a model is remembered by it: a study reads it in each run.
    """
    try:
        data = path.read_bytes() if is_file(path) and path.stat().st_size <= MOST_REMEMBERED_BYTES else None
    except OSError:
        data = None  # `read_model` tells why
    if data is not None:
        return _remembered(path, data)
    model = read_model(path)
    return model, model.dynamics()


@functools.lru_cache(maxsize=REMEMBERED)
def _remembered(path: Path, data: bytes) -> tuple[TrainedModel, Dynamics]:
    model = _checked(_arrays_of(path, lambda: io.BytesIO(data)), path)
    return model, model.dynamics()


def read_arrays(path: Path) -> dict[str, Array]:
    """All arrays of an npz file. Raises ModelError where it is missing, damaged, or holds pickled objects."""
    return _arrays_of(path, lambda: path.open("rb"))


def _arrays_of(path: Path, opened: Callable[[], BinaryIO]) -> dict[str, Array]:
    """All arrays of an npz file that is read from what `opened` gives."""
    try:
        if is_there(path) and not is_file(path):
            raise ModelError(f"{path}: is no regular file, and so no model file (npz)")
        with opened() as file:
            if file.read(4) != b"PK\x03\x04":
                raise ModelError(f"{path}: not a model file (npz), or damaged from its first byte on")
            file.seek(0)
            with zipfile.ZipFile(file) as packed:
                if sum(entry.file_size for entry in packed.infolist()) > MOST_BYTES:
                    raise ModelError(f"{path}: holds more than {MOST_BYTES // 1_000_000} MB: no model of asvhil")
                damaged = packed.testzip()  # before numpy parses a header, which a flipped bit makes into any text
                if damaged is not None:
                    raise ModelError(f"{path}: damaged: the checksum of {damaged} is wrong")
            file.seek(0)
            with np.load(file, allow_pickle=False) as archive:
                arrays = {name: archive[name] for name in archive.files}
                for name, array in arrays.items():
                    if not isinstance(array, np.ndarray):  # bytes, of a member that is none
                        raise ModelError(f"{path}: damaged: {name} is no array")
                return arrays
    except OSError as error:
        raise ModelError(f"{path}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:
        if "allow_pickle" in str(error):
            raise ModelError(f"{path}: holds a pickled object, which is never loaded") from None
        raise ModelError(f"{path}: damaged ({_first_line(error)})") from None
    except MemoryError:
        raise ModelError(f"{path}: damaged: an array claims to be larger than the memory") from None
    except (*_DAMAGE, KeyError, NotImplementedError, RuntimeError) as error:
        raise ModelError(f"{path}: damaged ({_first_line(error)})") from None


def _checked(arrays: Mapping[str, Array], path: Path) -> TrainedModel:
    """The arrays as a model. Raises ModelError where a name, type, shape or value is wrong."""

    def text(name: str) -> str:
        value = _find(arrays, name, path)
        if value.dtype.kind != "U" or value.shape != ():
            raise ModelError(f"{path}: {name} is not a text")
        return str(value)

    def number(name: str) -> float:
        return float(_numbers(arrays, name, (), {}, path))

    version = number("format")
    if version != FORMAT:
        raise ModelError(f"{path}: model format {version:g}, this program reads format {FORMAT}")
    kind = text("kind")
    if kind not in _SHAPES:
        raise ModelError(f"{path}: unknown model kind {kind!r} (known: {', '.join(KINDS)})")
    dt_s, seed = number("dt_s"), number("seed")
    if not 0.0 < dt_s <= 2.0:
        raise ModelError(f"{path}: dt_s is {dt_s:g}, a step within 0 to 2 s is needed")
    lengths: dict[str, int] = {}
    weights = {name: _numbers(arrays, f"weights.{name}", shape, lengths, path) for name, shape in _SHAPES[kind].items()}
    centre, half = (_numbers(arrays, name, shape, lengths, path) for name, shape in _SCALING.items())
    for name, value in (("half", half), *((n, weights[n]) for n in weights if n in _POSITIVE)):
        if not (value > 0.0).all():
            raise ModelError(f"{path}: {name} must be positive throughout")
    if kind == "lagnet" and not (0.0 <= weights["direct"] <= 1.0 and weights["lag_s"] >= 0.5 * dt_s):
        raise ModelError(f"{path}: direct must lie in 0..1 and lag_s be at least half of dt_s")
    try:
        figures = json.loads(text("figures"))
    except (ValueError, RecursionError):
        raise ModelError(f"{path}: figures is not JSON") from None
    if not isinstance(figures, dict):
        raise ModelError(f"{path}: figures is not a JSON object")
    vehicle, data_hash, config_hash = (text(name) for name in _ORIGIN)
    hull = _hull(text("hull"), path) if "hull" in arrays else {}
    return TrainedModel(
        kind=kind,
        vehicle=vehicle,
        dt_s=dt_s,
        scaling=Scaling(centre=centre, half=half),
        weights=weights,
        data_hash=data_hash,
        config_hash=config_hash,
        seed=int(seed),
        figures=figures,
        hull=hull,
    )


def _hull(text: str, path: Path) -> dict[str, float]:
    """The figures of the hull; ModelError where they are not positive numbers by name."""
    try:
        figures = {str(name): float(value) for name, value in json.loads(text).items()}
    except (ValueError, TypeError, AttributeError, RecursionError):
        figures = {"": math.nan}
    if not all(0.0 < value < math.inf for value in figures.values()):
        raise ModelError(f"{path}: hull is not a JSON object of positive numbers")
    return figures


def _find(arrays: Mapping[str, Array], name: str, path: Path) -> Array:
    try:
        return arrays[name]
    except KeyError:
        raise ModelError(f"{path}: the array {name} is missing") from None


def _numbers(arrays: Mapping[str, Array], name: str, shape: Shape, lengths: dict[str, int], path: Path) -> Array:
    """A finite float64 array of a shape; `lengths` has the length of each letter, set at its first use."""
    value = _find(arrays, name, path)
    if value.dtype.kind not in "fiu":
        raise ModelError(f"{path}: {name} does not hold numbers")
    if len(value.shape) == len(shape) and 0 not in value.shape:
        for letter, length in zip(shape, value.shape, strict=True):
            if isinstance(letter, str):
                lengths.setdefault(letter, length)
    wanted = tuple(lengths.get(part, -1) if isinstance(part, str) else part for part in shape)
    if value.shape != wanted:
        shown = ", ".join(str(part) if isinstance(part, int) else f"{part}" for part in shape)
        raise ModelError(f"{path}: {name} has the shape {value.shape}, ({shown}) is needed")
    bad = int(np.count_nonzero(~np.isfinite(value)))
    if bad:
        raise ModelError(f"{path}: {name} holds {bad} values that are not finite")
    return np.asarray(value, dtype=np.float64)


def _first_line(error: Exception) -> str:
    return (str(error) or type(error).__name__).splitlines()[0]


def _network(model: TrainedModel) -> TanhNetwork:
    w = model.weights
    return TanhNetwork.in_units(w["w1"], w["b1"], w["w2"], w["b2"], model.scaling)


def _build_sd(model: TrainedModel) -> Dynamics:
    return FittedSd(model.weights["parameters"].tolist(), model.dt_s)


def _build_nnsem(model: TrainedModel) -> Dynamics:
    return Nnsem(_network(model), model.dt_s)


def _build_node(model: TrainedModel) -> Dynamics:
    return Node(_network(model), model.dt_s)


def _build_knode(model: TrainedModel) -> Dynamics:
    w, half = model.weights, model.scaling.half
    w1 = w["w1"] / half
    inner = TanhNetwork(w1, w["b1"] - product(w1, model.scaling.centre), w["w2"], w["b2"])
    g_w1 = w["g_w1"].copy()
    g_w1[:, :3] /= w["prior_scale"]
    outer = TanhNetwork(g_w1, w["g_b1"], half[:3, None] * w["g_w2"], half[:3] * w["g_b2"])
    return Knode(FittedSd(w["prior"].tolist(), model.dt_s), inner, outer, model.dt_s)


def _build_lagnet(model: TrainedModel) -> Dynamics:
    w, half = model.weights, model.scaling.half
    return LagNet(
        ThrustMap(w["map_gain"], w["map_slope"], w["map_centre"]),
        float(w["lag_s"]),
        float(w["direct"]),
        _network(model),
        half[:3, None] * w["skip"],
        half,
        model.dt_s,
    )


_BUILDERS: dict[str, Callable[[TrainedModel], Dynamics]] = {
    "sd": _build_sd,
    "nnsem": _build_nnsem,
    "node": _build_node,
    "knode": _build_knode,
    "lagnet": _build_lagnet,
}
