"""Model files: what is written comes back, and whatever is wrong with a file is one clear line."""

import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from asvhil.dynamics.weights import load_model, read_model, save_model
from asvhil.errors import ModelError
from tests.support.model_samples import KINDS, points, sample


def written(path: Path, kind: str = "nnsem", changes: Mapping[str, Any] = MappingProxyType({})) -> Path:
    """A model file with some arrays replaced, or left out where the change is None."""
    file = path / f"{kind}.npz"
    save_model(file, sample(kind))
    with np.load(file) as archive:
        arrays = {name: archive[name] for name in archive.files} | dict(changes)
    np.savez(file, **{name: value for name, value in arrays.items() if value is not None})
    return file


def complaint(file: Path, **asked: Any) -> str:
    """The message of the ModelError that loading a file raises: one line that begins with the file's name."""
    with pytest.raises(ModelError) as caught:
        load_model(file, **asked)
    message = str(caught.value)
    assert message.startswith(str(file)) and "\n" not in message
    return message


@pytest.mark.parametrize("kind", KINDS)
def test_a_saved_model_comes_back(kind: str, tmp_path: Path) -> None:
    file = tmp_path / "models" / "boat.npz"
    before = sample(kind)
    save_model(file, before)
    after = read_model(file)
    assert (after.kind, after.vehicle, after.dt_s, after.seed) == (kind, "wamv16", 0.2, 1)
    assert (after.data_hash, after.config_hash) == ("d" * 64, "c" * 16)
    assert after.figures == {"best_validation": 0.04, "curve": [[500.0, 0.02, 0.05]]}
    assert {name: value.tolist() for name, value in after.weights.items()} == {
        name: value.tolist() for name, value in before.weights.items()
    }
    model = load_model(file, vehicle="wamv16", dt_s=0.2)
    x, a, wind = points(kind, 5)
    assert (model.derivative(x, a, wind) == before.dynamics().derivative(x, a, wind)).all()
    assert model.name == kind


def test_equal_models_make_equal_files(tmp_path: Path) -> None:
    for name in ("a.npz", "b.npz"):
        save_model(tmp_path / name, sample("lagnet"))
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.npz", "b.npz"]  # nothing is left beside them


def test_a_missing_file(tmp_path: Path) -> None:
    assert complaint(tmp_path / "none.npz").endswith("cannot be read (No such file or directory)")


def test_not_a_model_file(tmp_path: Path) -> None:
    file = tmp_path / "text.npz"
    file.write_text("not a model")
    assert "not a model file" in complaint(file)


@pytest.mark.parametrize("cut", [5, 200, 1000, -100, -1])
def test_a_truncated_file(tmp_path: Path, cut: int) -> None:
    file = written(tmp_path)
    file.write_bytes(file.read_bytes()[:cut])
    assert "damaged" in complaint(file)


def test_every_flipped_byte_is_seen_or_harmless(tmp_path: Path) -> None:
    # The archive has a checksum over each array; a flip elsewhere may go unseen, but never changes the weights.
    file = written(tmp_path)
    whole = file.read_bytes()
    before = read_model(file)
    seen = 0
    for at in range(0, len(whole), 37):
        file.write_bytes(whole[:at] + bytes([whole[at] ^ 0x10]) + whole[at + 1 :])
        try:
            after = read_model(file)
        except ModelError:
            seen += 1
        else:
            assert all((after.weights[name] == value).all() for name, value in before.weights.items())
    assert seen > 20


def test_every_flipped_bit_of_an_arrays_header_is_damage(tmp_path: Path) -> None:
    # numpy parses the header as Python text, and a flipped bit makes that any text.
    file = written(tmp_path)
    whole = file.read_bytes()
    start = whole.index(b"{'descr'")
    for at in range(start, whole.index(b"\n", start)):
        for bit in range(8):
            file.write_bytes(whole[:at] + bytes([whole[at] ^ (1 << bit)]) + whole[at + 1 :])
            assert "damaged: the checksum of " in complaint(file)


@pytest.mark.parametrize("header", [b"{'descr': '<f8', 'fortran_order': False, 'shape': (3,", b"{'descr' '<f8'}", b")"])
def test_a_header_that_is_no_python_under_a_right_checksum(header: bytes, tmp_path: Path) -> None:
    file = written(tmp_path)
    with zipfile.ZipFile(file, "a") as archive:
        text = header.ljust(117) + b"\n"
        archive.writestr("more.npy", b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text)
    assert "damaged (" in complaint(file)


def test_a_pickled_object_is_refused(tmp_path: Path) -> None:
    pickled = np.array([{"a": 1}], dtype=object)
    assert "pickled object" in complaint(written(tmp_path, "nnsem", {"weights.w1": pickled}))


def test_a_member_that_is_no_array(tmp_path: Path) -> None:
    file = written(tmp_path)
    with zipfile.ZipFile(file, "a") as archive:
        archive.writestr("more.npy", b"\0" * 1000)
    assert complaint(file).endswith("damaged: more is no array")


def test_figures_that_are_nested_without_end(tmp_path: Path) -> None:
    assert complaint(written(tmp_path, "nnsem", {"figures": np.array("[" * 100_000)})).endswith("figures is not JSON")


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.npz")
    assert complaint(tmp_path / "pipe.npz").endswith("is no regular file, and so no model file (npz)")


def test_a_missing_array(tmp_path: Path) -> None:
    assert complaint(written(tmp_path, "nnsem", {"weights.b1": None})).endswith("the array weights.b1 is missing")
    assert complaint(written(tmp_path, "nnsem", {"half": None})).endswith("the array half is missing")
    assert complaint(written(tmp_path, "lagnet", {"weights.lag_s": None})).endswith("weights.lag_s is missing")


def test_wrong_shapes(tmp_path: Path) -> None:
    assert "weights.w1 has the shape (12, 6), (H, 7) is needed" in complaint(
        written(tmp_path, "nnsem", {"weights.w1": np.ones((12, 6))})
    )
    assert "weights.b1 has the shape (11,)" in complaint(written(tmp_path, "nnsem", {"weights.b1": np.ones(11)}))
    assert "half has the shape ()" in complaint(written(tmp_path, "nnsem", {"half": np.array(1.0)}))
    assert "weights.w1 has the shape (0, 7)" in complaint(written(tmp_path, "nnsem", {"weights.w1": np.ones((0, 7))}))


def test_values_that_are_none(tmp_path: Path) -> None:
    bad = np.ones(12)
    bad[3] = np.nan
    message = complaint(written(tmp_path, "nnsem", {"weights.b1": bad}))
    assert message.endswith("weights.b1 holds 1 values that are not finite")
    assert "half must be positive" in complaint(written(tmp_path, "nnsem", {"half": np.zeros(7)}))
    assert "centre does not hold numbers" in complaint(written(tmp_path, "nnsem", {"centre": np.array(["a"] * 7)}))
    assert "at least half of dt_s" in complaint(written(tmp_path, "lagnet", {"weights.lag_s": np.array(0.01)}))
    assert "map_slope must be positive" in complaint(
        written(tmp_path, "lagnet", {"weights.map_slope": np.full(8, -1.0)})
    )


def test_another_vehicle_or_step(tmp_path: Path) -> None:
    file = written(tmp_path)
    assert complaint(file, vehicle="bream").endswith("was trained for vehicle 'wamv16', not for 'bream'")
    assert complaint(file, dt_s=0.1).endswith("has steps of 0.2 s, but 0.1 s are asked for")


def test_unknown_kind_and_newer_format(tmp_path: Path) -> None:
    assert "unknown model kind 'oracle'" in complaint(written(tmp_path, "nnsem", {"kind": np.array("oracle")}))
    newer = written(tmp_path, "nnsem", {"format": np.array(2)})
    assert complaint(newer).endswith("model format 2, this program reads format 1")


def test_figures_and_dt_are_checked(tmp_path: Path) -> None:
    assert "figures is not JSON" in complaint(written(tmp_path, "nnsem", {"figures": np.array("no")}))
    assert "figures is not a JSON object" in complaint(written(tmp_path, "nnsem", {"figures": np.array("[1]")}))
    assert "a step within 0 to 2 s is needed" in complaint(written(tmp_path, "nnsem", {"dt_s": np.array(-0.2)}))


@pytest.mark.parametrize("text", ["no", "[1]", '{"mass": "heavy"}', '{"mass": 0}', '{"mass": NaN}', '{"mass": null}'])
def test_a_hull_is_positive_numbers_by_name(text: str, tmp_path: Path) -> None:
    assert "hull is not a JSON object of positive numbers" in complaint(
        written(tmp_path, "nnsem", {"hull": np.array(text)})
    )


def test_a_file_from_before_hulls_were_kept_is_read(tmp_path: Path) -> None:
    assert not read_model(written(tmp_path, "nnsem", {"hull": None})).hull


def test_a_model_that_could_not_be_read_back_is_not_written(tmp_path: Path) -> None:
    model = sample("nnsem")
    model.weights["b1"][0] = np.inf
    with pytest.raises(ModelError, match="not finite"):
        save_model(tmp_path / "bad.npz", model)
    assert not list(tmp_path.iterdir())


def test_equal_bytes_give_the_same_model_and_others_another(tmp_path: Path) -> None:
    file = tmp_path / "boat.npz"
    save_model(file, sample("lagnet"))
    first = load_model(file)
    save_model(file, sample("lagnet"))
    assert load_model(file, vehicle="wamv16") is first
    save_model(file, sample("nnsem"))
    assert load_model(file).name == "nnsem"
    file.write_bytes(file.read_bytes()[:-40])
    complaint(file)
    file.unlink()
    complaint(file)
