"""The figures of a log once more, from its messages alone: nothing of the package, plain Python, one sample at a time.

Sensors are read from GPS_RAW_INT and ATTITUDE, and only of logs whose backseat used these.
"""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path
from statistics import fmean, pstdev
from typing import Any

from mcap.reader import make_reader
from pymavlink.dialects.v20 import ardupilotmega

A_M, E2 = 6378137.0, 6.69437999014e-3
Sample = dict[str, Any]


def metres(origin: tuple[float, float], lat_deg: float, lon_deg: float) -> tuple[float, float]:
    """North and east on the plane that touches WGS 84 at the origin."""
    phi = math.radians(origin[0])
    w = math.sqrt(1.0 - E2 * math.sin(phi) ** 2)
    per_deg_n = math.radians(A_M * (1.0 - E2) / w**3)
    per_deg_e = math.radians(A_M / w * math.cos(phi))
    return (lat_deg - origin[0]) * per_deg_n, (lon_deg - origin[1]) * per_deg_e


def figures(path: Path) -> dict[str, Any]:
    """The figures of the whole log, and of each hold."""
    samples: dict[str, list[Sample]] = {"truth": [], "estimated": [], "measured": []}
    commands: list[tuple[float, float, float, int]] = []
    wind: list[tuple[float, float, float, int]] = []
    spans: list[list[Any]] = []  # phase, first and last time, reason
    new: list[tuple[str, float, float, float, float, float, float]] = []
    codec = ardupilotmega.MAVLink(None)
    codec.robust_parsing = True
    start_ns = last_s = 0
    origin, psi, rate, fix = None, None, math.nan, None
    holds, before = 0, ""
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages(log_time_order=False):
            if channel.topic == "/frames/autopilot/in":
                t_ns = message.log_time
                for m in codec.parse_buffer(message.data) or []:
                    kind = m.get_type()
                    if kind == "SIM_STATE":
                        place = m.lat_int * 1e-7, m.lon_int * 1e-7
                        new.append(("truth", t_ns, *place, m.yaw, math.hypot(m.vn, m.ve), m.zgyro))
                    elif kind == "ATTITUDE":
                        psi, rate = m.yaw, m.yawspeed
                    elif kind == "GPS_RAW_INT" and m.fix_type >= 3 and psi is not None:
                        now = m.time_usec, m.lat, m.lon, m.alt, m.vel, m.cog
                        if now != fix:
                            fix = now
                            new.append(("measured", t_ns, m.lat * 1e-7, m.lon * 1e-7, psi, m.vel * 0.01, rate))
            elif channel.topic == "/asvhil/inputs":
                start_ns = start_ns or json.loads(message.data)["t_ns"]
            elif channel.topic == "/asvhil/outputs":
                out = json.loads(message.data)
                t_s = last_s = (out["t_ns"] - start_ns) * 1e-9
                phase, reason = out["phase"], out["health"]["reason"]
                if phase != before:
                    holds += phase == "hold"
                    spans.append([phase, t_s, t_s, reason])
                    before = phase
                spans[-1][2] = t_s
                hold = holds if phase == "hold" else 0
                station = out["station"]
                used = dict(out["health"]["sources"])
                if out["origin_deg"] is not None:
                    origin = out["origin_deg"]
                for way, t_ns, lat, lon, yaw, speed, turn in new:
                    if hold and (way == "truth" or used.get("position") == "autopilot.GPS_RAW_INT"):
                        n, e = metres(origin, lat, lon)
                        at_s = (t_ns - start_ns) * 1e-9
                        samples[way].append(sample(at_s, n, e, yaw, speed, turn, station, hold))
                new.clear()
                estimate = out["estimate"]
                if hold and estimate is not None:
                    speed = math.hypot(estimate["u_mps"], estimate["v_mps"])
                    pose = estimate["n_m"], estimate["e_m"], estimate["psi_rad"]
                    samples["estimated"].append(sample(t_s, *pose, speed, estimate["r_radps"], station, hold))
                if out["wind"] is not None:
                    vn, ve = out["wind"]["vn_mps"], out["wind"]["ve_mps"]
                    wind.append((t_s, math.hypot(vn, ve), math.atan2(ve, vn), hold))
                if hold and out["control"] is not None:
                    commands.append((t_s, *out["control"]["command"], hold))
    from_s = min(60.0, 0.5 * last_s)
    found: dict[str, Any] = {"settled_from_s": from_s, **held(samples, commands, from_s)}
    found["wind"] = {"estimated": weather([row for row in wind if row[0] >= from_s])}
    found["holds"] = []
    for number, (_, first, last, _) in enumerate((span for span in spans if span[0] == "hold"), 1):
        own = {way: [row for row in rows if row["hold"] == number] for way, rows in samples.items()}
        own_from_s = first + min(60.0, 0.5 * (last - first))
        part = held(own, [row for row in commands if row[3] == number], own_from_s)
        part["wind"] = weather([row for row in wind if row[3] == number and row[0] >= own_from_s])
        found["holds"].append({"from_s": first, "to_s": last, "settled_from_s": own_from_s, **part})
    found["failsafes"] = [{"from_s": s[1], "to_s": s[2], "reason": s[3]} for s in spans if s[0] == "failsafe"]
    found["releases"] = [
        {"at_s": s[1], "reason": s[3], "after": spans[i][0]} for i, s in enumerate(spans[1:]) if s[0] == "standby"
    ]
    return found


def sample(
    t_s: float, n: float, e: float, psi: float, speed: float, rate: float, station: dict[str, float], hold: int
) -> Sample:
    turned = math.degrees(math.remainder(psi - station["psi_rad"], math.tau))
    return {
        "t_s": t_s,
        "d": math.hypot(n - station["n_m"], e - station["e_m"]),
        "h": turned,
        "speed": speed,
        "rate": rate,
        "station": (station["n_m"], station["e_m"], station["psi_rad"]),
        "hold": hold,
    }


def held(samples: dict[str, list[Sample]], commands: list[Any], from_s: float) -> dict[str, Any]:
    """Scores, docking windows and the work of the motors."""
    found: dict[str, Any] = {way: scores(rows, from_s) if rows else None for way, rows in samples.items()}
    found["docking"] = {way: docking(rows) if rows else None for way, rows in samples.items()}
    turns, moved, elapsed = 0, 0.0, 0.0
    sides = [[0, 0], [0, 0]]  # of each motor: the last way it turned, in which hold
    for before, after in pairwise(commands):
        if before[3] == after[3]:
            elapsed += after[0] - before[0]
            moved += abs(after[1] - before[1]) + abs(after[2] - before[2])
    for row in commands:
        for motor in (0, 1):
            value = row[1 + motor]
            if abs(value) > 0.05:
                side = 1 if value > 0.0 else -1
                turns += sides[motor] == [-side, row[3]]
                sides[motor] = [side, row[3]]
    found["energy"] = fmean((row[1] ** 2 + row[2] ** 2) / 2.0 for row in commands)
    found["reversals_per_min"] = 30.0 * turns / elapsed
    found["change_per_s"] = moved / elapsed / 2.0
    return found


def scores(rows: list[Sample], from_s: float) -> dict[str, Any]:
    d = [row["d"] for row in rows if row["t_s"] >= from_s]
    h = [row["h"] for row in rows if row["t_s"] >= from_s]
    if not d:
        return {"distance_m": {"max": max(row["d"] for row in rows)}, "penalty_score": None}
    c, s = (fmean(f(math.radians(angle)) for angle in h) for f in (math.cos, math.sin))
    return {
        "distance_m": {"mean": fmean(d), "std": pstdev(d), "max": max(row["d"] for row in rows), "max_settled": max(d)},
        "heading_deg": {
            "mean": fmean(h),
            "std": pstdev(h),
            "abs_mean": fmean(map(abs, h)),
            "circular_mean": math.degrees(math.atan2(s, c)),
            "circular_std": math.degrees(math.sqrt(-2.0 * math.log(math.hypot(c, s)))),
        },
        "penalty_score": fmean(d) + pstdev(d) + abs(fmean(h)) + pstdev(h),
        "vrx_score": fmean(x + 0.75**x * math.radians(abs(y)) for x, y in zip(d, h, strict=True)),
    }


def docking(rows: list[Sample]) -> dict[str, Any]:
    """Windows of 0.5 m/s, 5 deg/s, 15 m and 20 degrees to either side, of 10 s and more."""
    windows: list[list[Sample]] = [[]]
    for row in rows:
        last = windows[-1][-1] if windows[-1] else row
        same = row["hold"] == last["hold"] and row["station"] == last["station"] and row["t_s"] - last["t_s"] <= 1.0
        if not same:
            windows.append([])
        slow = row["speed"] < 0.5 and abs(math.degrees(row["rate"])) < 5.0
        if slow and row["d"] < 15.0 and abs(row["h"]) < 20.0:
            windows[-1].append(row)
        elif windows[-1]:
            windows.append([])
    kept = [part for part in windows if part and part[-1]["t_s"] - part[0]["t_s"] >= 10.0]
    held_s = 0.0
    for number in {row["hold"] for row in rows}:
        times = [row["t_s"] for row in rows if row["hold"] == number]
        held_s += times[-1] - times[0]
    lengths = [part[-1]["t_s"] - part[0]["t_s"] for part in kept]
    return {
        "windows": [
            {
                "from_s": part[0]["t_s"],
                "to_s": part[-1]["t_s"],
                "length_s": part[-1]["t_s"] - part[0]["t_s"],
                "distance_m": {"mean": fmean(row["d"] for row in part), "max": max(row["d"] for row in part)},
                "heading_deg": {
                    "mean": fmean(row["h"] for row in part),
                    "abs_mean": fmean(abs(row["h"]) for row in part),
                },
            }
            for part in kept
        ],
        "longest_s": max(lengths, default=0.0),
        "share": sum(lengths) / held_s,
    }


def weather(rows: list[Any]) -> dict[str, Any] | None:
    if not rows:
        return None
    c, s = fmean(math.cos(row[2]) for row in rows), fmean(math.sin(row[2]) for row in rows)
    return {
        "speed_mps": {"mean": fmean(row[1] for row in rows), "std": pstdev([row[1] for row in rows])},
        "toward_deg": {
            "mean": math.degrees(math.atan2(s, c)),
            "std": math.degrees(math.sqrt(-2.0 * math.log(math.hypot(c, s)))),
        },
    }
