"""Messages for Foxglove, Lichtblick and Rerun: JSON in their schemas, made from Outputs.

The world frame is `map`: east, north, up, with its origin at that of the local NED frame. The body frame is
`base_link`: forward, left, up. Estimates that are invalid or not finite are not drawn, so the JSON never holds NaN.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import msgspec

from asvhil.geo import LocalFrame, body_to_ned
from asvhil.types import Estimate, Outputs, Station

MAP = "map"
BODY = "base_link"

FIX_TOPIC = "/asvhil/fix"
POSE_TOPIC = "/asvhil/pose"
TRANSFORM_TOPIC = "/tf"
PLAN_TOPIC = "/asvhil/plan"
LOG_TOPIC = "/asvhil/log"

_LIFETIME_NS = 1_000_000_000  # viewers remove a plan or station after this time without a new one
_STATION_LENGTH_M = 3.0
_LEVELS = {"debug": 1, "info": 2, "warning": 3, "error": 4, "critical": 5, "fatal": 5}
_SANE = 1e9
_KNOWN_DIAGONAL = 2
_LINE_STRIP = 0


# --- schemas ---------------------------------------------------------------------------------------------
# Only what the viewers' JSON Schema readers accept: nested objects in place, no $ref, no bare oneOf.


def _object(title: str = "", optional: tuple[str, ...] = (), **properties: Any) -> dict[str, Any]:
    schema: dict[str, Any] = {"title": title} if title else {}
    required = [name for name in properties if name not in optional]
    return {**schema, "type": "object", "properties": properties, "required": required}


def _array(items: dict[str, Any], **limits: int) -> dict[str, Any]:
    return {"type": "array", "items": items, **limits}


_NUMBER = {"type": "number"}
_STRING = {"type": "string"}
_NSEC = {"type": "integer", "minimum": 0, "maximum": 999_999_999}
_TIME = _object("time", sec={"type": "integer", "minimum": 0}, nsec=_NSEC)
_DURATION = _object("duration", sec={"type": "integer"}, nsec=_NSEC)
_VECTOR3 = _object("foxglove.Vector3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION = _object("foxglove.Quaternion", x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE = _object("foxglove.Pose", position=_VECTOR3, orientation=_QUATERNION)
_COLOR = _object("foxglove.Color", r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_EMPTY = _array({"type": "object", "properties": {}}, maxItems=0)  # kinds of primitives that are never written

SCHEMAS: dict[str, dict[str, Any]] = {
    "foxglove.LocationFix": _object(
        "foxglove.LocationFix",
        ("heading", "velocity"),
        timestamp=_TIME,
        frame_id=_STRING,
        latitude=_NUMBER,
        longitude=_NUMBER,
        altitude=_NUMBER,
        position_covariance=_array(_NUMBER, minItems=9, maxItems=9),
        position_covariance_type={"type": "integer", "enum": [0, 1, 2, 3]},
        heading=_NUMBER,
        velocity=_VECTOR3,
    ),
    "foxglove.PoseInFrame": _object("foxglove.PoseInFrame", timestamp=_TIME, frame_id=_STRING, pose=_POSE),
    "foxglove.FrameTransform": _object(
        "foxglove.FrameTransform",
        timestamp=_TIME,
        parent_frame_id=_STRING,
        child_frame_id=_STRING,
        translation=_VECTOR3,
        rotation=_QUATERNION,
    ),
    "foxglove.SceneUpdate": _object(
        "foxglove.SceneUpdate",
        deletions=_EMPTY,
        entities=_array(
            _object(
                "foxglove.SceneEntity",
                timestamp=_TIME,
                frame_id=_STRING,
                id=_STRING,
                lifetime=_DURATION,
                frame_locked={"type": "boolean"},
                metadata=_EMPTY,
                arrows=_array(
                    _object(
                        "foxglove.ArrowPrimitive",
                        pose=_POSE,
                        shaft_length=_NUMBER,
                        shaft_diameter=_NUMBER,
                        head_length=_NUMBER,
                        head_diameter=_NUMBER,
                        color=_COLOR,
                    )
                ),
                cubes=_EMPTY,
                spheres=_EMPTY,
                cylinders=_EMPTY,
                lines=_array(
                    _object(
                        "foxglove.LinePrimitive",
                        type={"type": "integer", "enum": [0, 1, 2]},
                        pose=_POSE,
                        thickness=_NUMBER,
                        scale_invariant={"type": "boolean"},
                        points=_array(_VECTOR3),
                        color=_COLOR,
                        colors=_array(_COLOR),
                        indices=_array({"type": "integer"}),
                    )
                ),
                triangles=_EMPTY,
                texts=_EMPTY,
                models=_EMPTY,
            )
        ),
    ),
    "foxglove.Log": _object(
        "foxglove.Log",
        timestamp=_TIME,
        level={"type": "integer", "enum": [0, 1, 2, 3, 4, 5]},
        message=_STRING,
        name=_STRING,
        file=_STRING,
        line={"type": "integer", "minimum": 0},
    ),
}

TOPIC_SCHEMAS: dict[str, str] = {
    FIX_TOPIC: "foxglove.LocationFix",
    POSE_TOPIC: "foxglove.PoseInFrame",
    TRANSFORM_TOPIC: "foxglove.FrameTransform",
    PLAN_TOPIC: "foxglove.SceneUpdate",
    LOG_TOPIC: "foxglove.Log",
}


# --- conversion ------------------------------------------------------------------------------------------


def convert_outputs(outputs: Outputs) -> list[tuple[str, bytes]]:
    """(topic, JSON) of each message of one tick; the fix needs the origin of the local frame."""
    messages: list[tuple[str, bytes]] = []
    estimate = outputs.estimate
    if estimate is not None and _drawable(estimate):
        if outputs.origin_deg is not None:
            lat_deg, lon_deg = outputs.origin_deg
            frame = LocalFrame(lat_deg=lat_deg, lon_deg=lon_deg)
            messages.append((FIX_TOPIC, _json(location_fix(estimate, frame))))
        messages.append((POSE_TOPIC, _json(pose_in_frame(estimate))))
        messages.append((TRANSFORM_TOPIC, _json(frame_transform(estimate))))
    scene = scene_update(outputs)
    if scene["entities"]:
        messages.append((PLAN_TOPIC, _json(scene)))
    return messages


def log_message(t_ns: int, level: str, text: str) -> bytes:
    """A foxglove.Log; levels are named as in `logging`, any other is 0 (unknown)."""
    return _json(
        {
            "timestamp": _time(t_ns),
            "level": _LEVELS.get(level.lower(), 0),
            "message": text,
            "name": "asvhil",
            "file": "",
            "line": 0,
        }
    )


def location_fix(estimate: Estimate, frame: LocalFrame) -> dict[str, Any]:
    """foxglove.LocationFix: position (deg) with its covariance (ENU, m^2), heading, velocity over ground (ENU)."""
    lat_deg, lon_deg = frame.to_geodetic(estimate.n_m, estimate.e_m)
    vn_mps, ve_mps = body_to_ned(estimate.psi_rad, estimate.u_mps, estimate.v_mps)
    n_var_m2, e_var_m2 = (std * std for std in estimate.std[:2])
    return {
        "timestamp": _time(estimate.t_ns),
        "frame_id": BODY,
        "latitude": lat_deg,
        "longitude": lon_deg,
        "altitude": 0.0,
        "position_covariance": [e_var_m2, 0.0, 0.0, 0.0, n_var_m2, 0.0, 0.0, 0.0, 0.0],
        "position_covariance_type": _KNOWN_DIAGONAL,
        "heading": estimate.psi_rad,
        "velocity": _vector(ve_mps, vn_mps),
    }


def pose_in_frame(estimate: Estimate) -> dict[str, Any]:
    """foxglove.PoseInFrame: the body in the map."""
    return {
        "timestamp": _time(estimate.t_ns),
        "frame_id": MAP,
        "pose": _pose(estimate.n_m, estimate.e_m, estimate.psi_rad),
    }


def frame_transform(estimate: Estimate) -> dict[str, Any]:
    """foxglove.FrameTransform: map to body, the same pose as `pose_in_frame`."""
    pose = _pose(estimate.n_m, estimate.e_m, estimate.psi_rad)
    return {
        "timestamp": _time(estimate.t_ns),
        "parent_frame_id": MAP,
        "child_frame_id": BODY,
        "translation": pose["position"],
        "rotation": pose["orientation"],
    }


def scene_update(outputs: Outputs) -> dict[str, Any]:
    """foxglove.SceneUpdate: the predicted path as a line strip, the station as an arrow of its heading."""
    entities = []
    plan = outputs.control.plan if outputs.control is not None else ()
    if plan and all(_all_sane(row) for row in plan):
        line = {
            "type": _LINE_STRIP,
            "pose": _pose(0.0, 0.0, math.pi / 2.0),  # identity: the points are in the map already
            "thickness": 3.0,
            "scale_invariant": True,
            "points": [_vector(e_m, n_m) for _, n_m, e_m, _ in plan],
            "color": _color(0.1, 0.6, 1.0),
            "colors": [],
            "indices": [],
        }
        entities.append(_entity(outputs.t_ns, "plan", lines=[line]))
    station = outputs.station
    if station is not None and _drawable(station):
        arrow = {
            "pose": _pose(station.n_m, station.e_m, station.psi_rad),
            "shaft_length": 0.8 * _STATION_LENGTH_M,
            "shaft_diameter": 0.2,
            "head_length": 0.2 * _STATION_LENGTH_M,
            "head_diameter": 0.6,
            "color": _color(1.0, 0.5, 0.0),
        }
        entities.append(_entity(outputs.t_ns, "station", arrows=[arrow]))
    return {"deletions": [], "entities": entities}


def yaw_enu_rad(psi_rad: float) -> float:
    """Yaw counter-clockwise from east of a heading clockwise from north."""
    return math.pi / 2.0 - psi_rad


def _pose(n_m: float, e_m: float, psi_rad: float) -> dict[str, Any]:
    half_rad = 0.5 * yaw_enu_rad(psi_rad)
    return {
        "position": _vector(e_m, n_m),
        "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(half_rad), "w": math.cos(half_rad)},
    }


def _entity(t_ns: int, name: str, **primitives: list[dict[str, Any]]) -> dict[str, Any]:
    kinds = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
    return {
        "timestamp": _time(t_ns),
        "frame_id": MAP,
        "id": name,
        "lifetime": _time(_LIFETIME_NS),
        "frame_locked": False,
        "metadata": [],
        **{kind: primitives.get(kind, []) for kind in kinds},
    }


def _drawable(pose: Estimate | Station) -> bool:
    values: tuple[float, ...] = (pose.n_m, pose.e_m, pose.psi_rad)
    if isinstance(pose, Estimate):
        if not pose.valid or len(pose.std) < 2:
            return False
        values = (*values, pose.u_mps, pose.v_mps, *pose.std)
    return _all_sane(values)


def _all_sane(values: Iterable[float]) -> bool:
    """No NaN (it fails every comparison), no infinity, nothing whose square or scaled value overflows."""
    return all(-_SANE < value < _SANE for value in values)


def _time(t_ns: int) -> dict[str, int]:
    sec, nsec = divmod(t_ns, 1_000_000_000)
    return {"sec": sec, "nsec": nsec}


def _vector(x: float, y: float) -> dict[str, float]:
    return {"x": x, "y": y, "z": 0.0}


def _color(r: float, g: float, b: float) -> dict[str, float]:
    return {"r": r, "g": g, "b": b, "a": 1.0}


_json = msgspec.json.Encoder(enc_hook=float).encode  # the hook takes NumPy's floats
