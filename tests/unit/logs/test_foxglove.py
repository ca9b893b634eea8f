"""Messages for viewers: their schemas, frames and values, and nothing from invalid estimates."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import pytest

from asvhil.logs.foxglove import (
    SCHEMAS,
    TOPIC_SCHEMAS,
    convert_outputs,
    frame_transform,
    location_fix,
    log_message,
    pose_in_frame,
    scene_update,
    yaw_enu_rad,
)
from asvhil.logs.recorder import INPUTS_TOPIC, OUTPUTS_TOPIC, TIMING_TOPIC
from asvhil.types import Estimate, Outputs
from tests.support.log_samples import ORIGIN, START_NS, assert_fits, sample_outputs
from tests.support.paths import ROOT

HALF = math.sqrt(0.5)


def estimate_at(n_m: float, e_m: float, psi_rad: float, u_mps: float = 0.0, v_mps: float = 0.0) -> Estimate:
    return Estimate(
        t_ns=START_NS,
        n_m=n_m,
        e_m=e_m,
        psi_rad=psi_rad,
        u_mps=u_mps,
        v_mps=v_mps,
        r_radps=0.0,
        motor=(0.0, 0.0),
        std=(0.5, 2.0, 0.1, 0.1, 0.1, 0.1),
        disturbance=(0.0, 0.0, 0.0),
        valid=True,
    )


def with_estimate(outputs: Outputs, **changes: Any) -> Outputs:
    return dataclasses.replace(outputs, estimate=dataclasses.replace(outputs.estimate, **changes))


@pytest.mark.parametrize(
    ("heading_deg", "yaw_deg", "z", "w"),
    [
        (90.0, 0.0, 0.0, 1.0),  # east: the body's forward is the map's x
        (0.0, 90.0, HALF, HALF),  # north: forward is y
        (180.0, -90.0, -HALF, HALF),  # south
        (45.0, 45.0, math.sin(math.pi / 8), math.cos(math.pi / 8)),  # north-east is the same both ways round
    ],
)
def test_heading_to_yaw(heading_deg: float, yaw_deg: float, z: float, w: float) -> None:
    psi_rad = math.radians(heading_deg)
    assert yaw_enu_rad(psi_rad) == pytest.approx(math.radians(yaw_deg))
    pose = pose_in_frame(estimate_at(3.0, 5.0, psi_rad))
    assert pose["frame_id"] == "map"
    assert pose["pose"]["position"] == {"x": 5.0, "y": 3.0, "z": 0.0}
    assert pose["pose"]["orientation"] == pytest.approx({"x": 0.0, "y": 0.0, "z": z, "w": w})
    transform = frame_transform(estimate_at(3.0, 5.0, psi_rad))
    assert (transform["parent_frame_id"], transform["child_frame_id"]) == ("map", "base_link")
    assert transform["translation"] == pose["pose"]["position"]
    assert transform["rotation"] == pose["pose"]["orientation"]


def test_location_fix_by_hand() -> None:
    # Heading east at 2 m/s with 1 m/s to starboard (south); one degree of latitude is 111 km.
    fix = location_fix(estimate_at(111.0, 0.0, math.pi / 2, u_mps=2.0, v_mps=1.0), ORIGIN)
    assert fix["latitude"] == pytest.approx(40.001, abs=2e-6)
    assert fix["longitude"] == -86.0
    assert fix["velocity"] == pytest.approx({"x": 2.0, "y": -1.0, "z": 0.0})
    assert fix["heading"] == math.pi / 2
    # std is (north 0.5, east 2.0): variances in the order east, north.
    assert fix["position_covariance"] == [4.0, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 0.0]
    assert fix["timestamp"] == {"sec": 1_790_000_000, "nsec": 123_456_789}


def test_plan_is_a_line_strip_and_station_an_arrow() -> None:
    scene = scene_update(sample_outputs(0))
    plan, station = scene["entities"]
    line = plan["lines"][0]
    assert line["type"] == 0
    assert len(line["points"]) == 21
    assert line["points"][3] == {"x": -0.1, "y": pytest.approx(0.1), "z": 0.0}  # row (t, n, e, psi)
    assert line["pose"]["orientation"] == {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    assert station["arrows"][0]["pose"]["orientation"]["w"] == pytest.approx(math.cos((math.pi / 2 - 0.5) / 2))
    assert plan["lifetime"] == {"sec": 1, "nsec": 0}


def test_messages_fit_their_schemas() -> None:
    messages = convert_outputs(sample_outputs(0))
    messages.append(("/asvhil/log", log_message(START_NS, "warning", "wind is stale")))
    assert [topic for topic, _ in messages] == list(TOPIC_SCHEMAS)
    for topic, data in messages:
        assert_fits(json.loads(data), SCHEMAS[TOPIC_SCHEMAS[topic]], topic)


def test_no_fix_without_an_origin() -> None:
    outputs = dataclasses.replace(sample_outputs(0), origin_deg=None)
    assert [topic for topic, _ in convert_outputs(outputs)] == ["/asvhil/pose", "/tf", "/asvhil/plan"]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e300])
def test_no_json_without_finite_numbers(value: float) -> None:
    for changes in ({"n_m": value}, {"psi_rad": value}, {"std": (0.1, value)}, {"v_mps": value}):
        outputs = with_estimate(sample_outputs(0), **changes)
        assert [topic for topic, _ in convert_outputs(outputs)] == ["/asvhil/plan"]
    outputs = sample_outputs(0)
    plan = ((0.0, value, 0.0, 0.0),)
    broken = dataclasses.replace(outputs, control=dataclasses.replace(outputs.control, plan=plan))
    assert [entity["id"] for entity in scene_update(broken)["entities"]] == ["station"]


def test_invalid_or_absent_estimates_are_not_drawn() -> None:
    bare = sample_outputs(0, control=False)
    assert convert_outputs(with_estimate(bare, valid=False)) == []
    assert convert_outputs(dataclasses.replace(bare, estimate=None)) == []


@pytest.mark.parametrize(("name", "level"), [("debug", 1), ("INFO", 2), ("warning", 3), ("error", 4), ("other", 0)])
def test_log_levels(name: str, level: int) -> None:
    message = json.loads(log_message(START_NS, name, 'a "quoted" line'))
    assert message["level"] == level
    assert message["message"] == 'a "quoted" line'


def test_layout_is_json_and_asks_only_for_topics_that_are_written() -> None:
    path = ROOT / "config" / "foxglove-layout.json"
    layout = json.loads(path.read_text(encoding="utf-8"))
    panels = layout["configById"]
    asked = {
        panels["map!track"]["followTopic"],
        *panels["map!track"]["topicColors"],
        *panels["3D!scene"]["topics"],
        panels["RosOut!log"]["topicToRender"],
    }
    values = [line["value"] for name in panels if name.startswith("Plot!") for line in panels[name]["paths"]]
    asked |= {value.partition(".")[0] for value in values}
    assert asked <= {*TOPIC_SCHEMAS, INPUTS_TOPIC, OUTPUTS_TOPIC, TIMING_TOPIC}
    outputs = sample_outputs(0)
    for value in values:
        topic, _, field = value.partition(".")
        if topic == OUTPUTS_TOPIC:
            part: Any = outputs
            for name in field.partition("[")[0].split("."):
                part = getattr(part, name)
    placed: set[str] = set()

    def walk(node: Any) -> None:
        if isinstance(node, str):
            placed.add(node)
        else:
            walk(node["first"])
            walk(node["second"])

    walk(layout["layout"])
    assert placed == set(panels)
