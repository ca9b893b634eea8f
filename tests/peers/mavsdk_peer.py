"""MAVSDK (PyPI, with its native library) in a process of its own: a JSON command a line in, a JSON answer a line out.

    python mavsdk_peer.py ground URL        a ground station
    python mavsdk_peer.py autopilot URL     an autopilot with a telemetry server

An answer is {"ok": value}, or {"error": words} where MAVSDK reports one. The end of the input ends the process.
"""

import contextlib
import json
import math
import sys
import time
from collections.abc import Callable
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.mavlink_direct import MavlinkDirect, MavlinkMessage
from mavsdk.plugins.mavlink_direct_server import MavlinkDirectServer
from mavsdk.plugins.mavlink_direct_server import MavlinkMessage as ServerMessage
from mavsdk.plugins.param import Param, ParamError, ProtocolVersion
from mavsdk.plugins.telemetry import Telemetry
from mavsdk.plugins.telemetry_server import (
    AngularVelocityBody,
    EulerAngle,
    Heading,
    Position,
    TelemetryServer,
    VelocityNed,
)

DISCOVERY_S = 30.0


class Ground:
    """A ground station: what it last heard, and what it can be told to do."""

    def __init__(self, sdk: Mavsdk) -> None:
        system = sdk.first_autopilot(DISCOVERY_S)
        if system is None:
            raise RuntimeError(f"no autopilot within {DISCOVERY_S:.0f} s")
        self._system = system
        self._telemetry, self._action = Telemetry(system), Action(system)
        self._direct, self._param = MavlinkDirect(system), Param(system)
        self._heard: dict[str, dict[str, Any]] = {}
        self._values: dict[str, float] = {}
        self._texts: list[tuple[int, str]] = []
        self._direct.subscribe_message("", self._on_message)

    def _on_message(self, message: Any, *_: Any) -> None:
        fields = json.loads(message.fields_json)
        self._heard[f"{message.component_id}/{message.message_name}"] = fields
        if message.component_id == 191 and message.message_name == "NAMED_VALUE_FLOAT":
            self._values[fields["name"]] = fields["value"]
        if message.component_id == 191 and message.message_name == "STATUSTEXT":
            self._texts.append((fields["id"], fields["text"]))

    def state(self) -> dict[str, Any]:
        """What MAVSDK has made of the autopilot's messages."""
        position, heading = self._telemetry.position(), self._telemetry.heading()
        return {
            "lat_deg": position.latitude_deg,
            "lon_deg": position.longitude_deg,
            "heading_deg": heading.heading_deg,
            "armed": bool(self._telemetry.armed()),
            "mode": self._telemetry.flight_mode().name,
            "components": sorted(self._system.component_ids()),
        }

    def arm(self) -> None:
        self._action.arm()

    def disarm(self) -> None:
        self._action.disarm()

    def goto(self, lat_deg: float, lon_deg: float, heading_deg: float) -> None:
        """MAVSDK's own goto, which it sends to the autopilot."""
        self._action.goto_location(lat_deg, lon_deg, 0.0, heading_deg)

    def command_int(self, target: int, command: int, frame: int, params: list[float], x: int, y: int) -> int:
        """Any COMMAND_INT to a component; the MAV_RESULT of its acknowledgement."""
        fields = {f"param{i}": value for i, value in enumerate(params, 1)}
        fields |= {"command": command, "frame": frame, "current": 0, "autocontinue": 0, "x": x, "y": y, "z": 0.0}
        self._heard.pop(f"{target}/COMMAND_ACK", None)
        self._send("COMMAND_INT", target, fields)
        return int(self._await(f"{target}/COMMAND_ACK")["result"])

    def command_long(self, target: int, command: int, params: list[float]) -> int:
        """Any COMMAND_LONG to a component; the MAV_RESULT of its acknowledgement."""
        fields = {f"param{i}": value for i, value in enumerate([*params, *[0.0] * 7][:7], 1)}
        self._heard.pop(f"{target}/COMMAND_ACK", None)
        self._send("COMMAND_LONG", target, fields | {"command": command, "confirmation": 0})
        return int(self._await(f"{target}/COMMAND_ACK")["result"])

    def parameters(self) -> dict[str, float]:
        """All float parameters of the daemon, by MAVSDK's parameter client."""
        self._select()
        return {row.name: row.value for row in self._param.get_all_params().float_params}

    def set_parameter(self, key: str, value: float) -> None:
        self._select()
        self._param.set_param_float(key, value)

    def parameter(self, key: str) -> float:
        self._select()
        return float(self._param.get_param_float(key))

    def _select(self) -> None:
        with contextlib.suppress(ParamError):  # version 4.1.0 selects it, and says "unknown"
            self._param.select_component(191, ProtocolVersion.V1)

    def heard(self) -> dict[str, Any]:
        """The latest message of each kind from each component, named values of the daemon, and its texts."""
        return {"messages": dict(self._heard), "values": dict(self._values), "texts": list(self._texts)}

    def _send(self, name: str, target: int, fields: dict[str, Any]) -> None:
        fields |= {"target_system": 1, "target_component": target}
        text = json.dumps({key: None if isinstance(v, float) and math.isnan(v) else v for key, v in fields.items()})
        self._direct.send_message(
            MavlinkMessage(message_name=name, target_system_id=1, target_component_id=target, fields_json=text)
        )

    def _await(self, key: str) -> dict[str, Any]:
        for _ in range(100):
            if key in self._heard:
                return self._heard[key]
            time.sleep(0.05)
        raise RuntimeError(f"no {key} within 5 s")


class AutopilotSide:
    """An autopilot that says where it is, and hears what is asked of it."""

    def __init__(self, sdk: Mavsdk) -> None:
        component = sdk.server_component_by_type(ComponentType.AUTOPILOT)
        self._telemetry, self._direct = TelemetryServer(component), MavlinkDirectServer(component)

    def publish(self, lat_deg: float, lon_deg: float, heading_deg: float, vn_mps: float, ve_mps: float) -> None:
        """One set of telemetry, and the estimator's word that its position is in use."""
        self._telemetry.publish_position(
            Position(lat_deg, lon_deg, 0.0, 0.0), VelocityNed(vn_mps, ve_mps, 0.0), Heading(heading_deg)
        )
        self._telemetry.publish_attitude(EulerAngle(0.0, 0.0, heading_deg, 0), AngularVelocityBody(0.0, 0.0, 0.0))
        ready = {"time_usec": 0, "flags": 16, **dict.fromkeys(ESTIMATOR_RATIOS, 0.0)}
        self._direct.send_message(ServerMessage(message_name="ESTIMATOR_STATUS", fields_json=json.dumps(ready)))


ESTIMATOR_RATIOS = (
    "vel_ratio", "pos_horiz_ratio", "pos_vert_ratio", "mag_ratio", "hagl_ratio", "tas_ratio",
    "pos_horiz_accuracy", "pos_vert_accuracy",
)  # fmt: skip


def main() -> None:
    role, url = sys.argv[1:]
    kind = ComponentType.GROUND_STATION if role == "ground" else ComponentType.AUTOPILOT
    sdk = Mavsdk(Configuration.create_with_component_type(kind))
    sdk.add_any_connection(url)
    peer: Ground | AutopilotSide = Ground(sdk) if role == "ground" else AutopilotSide(sdk)
    print(json.dumps({"ok": "up"}), flush=True)
    for line in sys.stdin:
        command = json.loads(line)
        do: Callable[..., Any] = getattr(peer, command.pop("do"))
        try:
            answer = {"ok": do(**command)}
        except Exception as error:  # whatever MAVSDK reports is the answer
            answer = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
