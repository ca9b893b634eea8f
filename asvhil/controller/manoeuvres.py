"""Predefined manoeuvres for data collection within a geofence around the station, for the training of vessel models."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from asvhil.config import Config, ManoeuvresConfig
from asvhil.controller.human_operator import HumanOperator
from asvhil.controller.protocol import Controller
from asvhil.controller.station_mpc import build as build_mpc
from asvhil.dynamics.protocol import Dynamics
from asvhil.geo import wrap_rad
from asvhil.types import Control, Estimate, Station, Wind, record

ZIGZAG_RAD = math.radians(20.0)  # the classic 20/20 zigzag: the turn is reversed at this heading off the first one
ZIGZAG_REVERSE_S = 6.0  # or after this time, where the boat does not turn so far
LATE_S = 1.0  # a longer time between two steps is a pause, and the programme waits
OUT_FACTOR = 2.0  # of the geofence's radius: beyond it the programme is given up

MANUAL_S, ZIGZAG_S, STEPS_S, CIRCLE_S, DRIFT_S = 18.0, 14.0, 20.0, 10.0, 30.0
DRIFTS = 3  # a cycle
DRIFT_TURN_S = (0.5, 7.0)  # the turn before a drift, so that the wind comes from another side each time
DRIFT_TURN = 0.4
AHEAD = (0.35, 0.6, 0.9)  # levels of the straight runs; each is drawn 0.1 about its value
ASTERN = (-0.4, -0.7, -0.95)
CIRCLES = ((0.9, 0.3), (0.6, -0.3), (-0.8, -0.2))  # (outer, inner) motor, both ways round
ZIGZAGS = ((0.35, 0.3), (0.7, 0.3), (-0.6, 0.35))  # (surge, turn)
DEAD_BAND_SHARE = 0.25  # of the random steps, for each motor, where thrust curves start late
DEAD_BAND = 0.25
STEP_HOLD_S = (0.4, 4.0)


@record
class Block:
    """One manoeuvre. `pieces` are rows of (duration_s, port, starboard) in turn; blocks without them use feedback."""

    kind: str  # straight, circle, steps, drift, zigzag, manual
    duration_s: float
    pieces: tuple[tuple[float, float, float], ...] = ()
    surge: float = 0.0
    turn: float = 0.0


def programme(duration_s: float, rng: np.random.Generator) -> tuple[Block, ...]:
    """Blocks for at least a duration: cycles of some 420 s, manoeuvres in random order and levels, then drifts.

    The drifts come last so that a short record, as for the calibration of the compass, has all the turns.
    """
    blocks: list[Block] = []
    while math.fsum(block.duration_s for block in blocks) < duration_s:
        cycle = [_straight(rng, ahead, astern) for ahead, astern in zip(AHEAD, ASTERN, strict=True)]
        cycle += [_circle(rng, pair, way) for pair in CIRCLES for way in (1, -1)]
        cycle += [_zigzag(rng, surge, turn) for surge, turn in ZIGZAGS]
        cycle += [_steps(rng) for _ in range(3)]
        cycle = [cycle[i] for i in rng.permutation(len(cycle))]
        cycle += [_drift(rng) for _ in range(DRIFTS)]
        for at in range(len(cycle), 0, -3):  # the human operator keeps the station after every third block
            cycle.insert(at, Block(kind="manual", duration_s=MANUAL_S))
        blocks += cycle
    return tuple(blocks)


class Manoeuvres:
    """Drives a programme for a time, as a pure function of the estimates that it is given; then keeps the station.

    Beyond the geofence the programme is paused while `home` brings the boat back; the total time runs on. If the boat
    does not come back (twice the radius, or too long), `Control.ok` is False from then on, and the supervisor releases
    the motors.
    """

    def __init__(self, config: ManoeuvresConfig, home: Controller) -> None:
        self._config = config
        self._home = home
        self._drive: dict[str, Callable[[Block, float, Estimate, Station], tuple[float, float]]] = {
            "zigzag": self._zigzag,
            "manual": self._manual,
        }
        self.reset()

    def reset(self) -> None:
        """Restart the programme, as after a time without control."""
        rng = np.random.default_rng(self._config.seed)
        self.blocks = programme(self._config.duration_s, rng)
        self._operator = HumanOperator(rng, self._config.reaction_s)
        self._index = 0
        self._in_block_s = 0.0
        self._begin_ns: int | None = None
        self._last_ns = 0
        self._return_since_ns: int | None = None
        self._reference_rad: float | None = None
        self._side, self._side_since_s = 1, 0.0
        self.stage = "start"  # what is being done: the block's kind, or return, done, out
        self._home.reset()

    def new_station(self) -> None:
        """Continue the programme about another station."""
        self._home.new_station()

    @property
    def done(self) -> bool:
        """Whether the programme's time is over and the station is kept instead."""
        return self.stage == "done"

    def step(self, estimate: Estimate, wind: Wind | None, station: Station) -> Control:
        """One control tick. Neutral and not ok, until reset, once the boat is lost to the geofence."""
        t_ns = estimate.t_ns
        if self._begin_ns is None:
            self._begin_ns = self._last_ns = t_ns
        elapsed_s = (t_ns - self._last_ns) * 1e-9
        self._last_ns = t_ns
        distance_m = math.hypot(estimate.n_m - station.n_m, estimate.e_m - station.e_m)
        if not math.isfinite(distance_m):
            return Control(command=(0.0, 0.0), ok=False, iterations=0, cost=0.0)
        self._fence(t_ns, distance_m)
        if self.stage == "out":
            return Control(command=(0.0, 0.0), ok=False, iterations=0, cost=0.0)
        over = (t_ns - self._begin_ns) * 1e-9 >= self._config.duration_s
        if self._return_since_ns is not None or over:
            self._home_stage("return" if self._return_since_ns is not None else "done")
            return self._home.step(estimate, wind, station)
        block = self._advance(elapsed_s)
        self.stage = block.kind
        drive = self._drive.get(block.kind, _pieces)
        port, starboard = drive(block, self._in_block_s, estimate, station)
        limit = self._config.max_command
        command = (min(max(port, -limit), limit), min(max(starboard, -limit), limit))
        return Control(command=command, ok=True, iterations=0, cost=0.0)

    # --- fence and programme -------------------------------------------------------------------------------

    def _fence(self, t_ns: int, distance_m: float) -> None:
        """Begin or end the return; give up if the boat is too far off or the return takes too long."""
        radius_m = self._config.geofence_radius_m
        since_ns = self._return_since_ns
        if since_ns is None and distance_m > radius_m:
            self._return_since_ns = t_ns
        elif since_ns is not None and distance_m < self._config.return_fraction * radius_m:
            self._return_since_ns = None
            self._reference_rad = None  # the zigzag goes on about the heading that the boat has now
        elif since_ns is not None and (t_ns - since_ns) * 1e-9 > self._config.return_timeout_s:
            self.stage = "out"
        if distance_m > OUT_FACTOR * radius_m:
            self.stage = "out"

    def _home_stage(self, stage: str) -> None:
        if self.stage not in ("return", "done"):
            self._home.reset()  # it did not have the motors until now
        self.stage = stage

    def _advance(self, elapsed_s: float) -> Block:
        """The block at this time of the programme."""
        self._in_block_s += elapsed_s if 0.0 <= elapsed_s <= LATE_S else 0.0
        block = self.blocks[self._index]
        while self._in_block_s >= block.duration_s - 1e-6:
            self._in_block_s -= block.duration_s
            self._index = (self._index + 1) % len(self.blocks)
            self._reference_rad = None
            block = self.blocks[self._index]
        return block

    # --- manoeuvres with feedback ------------------------------------------------------------------

    def _zigzag(self, block: Block, at_s: float, estimate: Estimate, station: Station) -> tuple[float, float]:
        if self._reference_rad is None:
            self._reference_rad, self._side_since_s = estimate.psi_rad, at_s
        off_rad = wrap_rad(estimate.psi_rad - self._reference_rad)
        if self._side * off_rad > ZIGZAG_RAD or at_s - self._side_since_s > ZIGZAG_REVERSE_S:
            self._side, self._side_since_s = -self._side, at_s
        return block.surge + self._side * block.turn, block.surge - self._side * block.turn

    def _manual(self, block: Block, at_s: float, estimate: Estimate, station: Station) -> tuple[float, float]:
        surge, turn = self._operator.step(estimate, station)
        return surge + turn, surge - turn


def _pieces(block: Block, at_s: float, estimate: Estimate, station: Station) -> tuple[float, float]:
    """The piece at a time of its block."""
    for duration_s, port, starboard in block.pieces:
        if at_s < duration_s - 1e-6:
            return port, starboard
        at_s -= duration_s
    return block.pieces[-1][1:]


def _near(rng: np.random.Generator, level: float) -> float:
    return min(max(level + float(rng.uniform(-0.1, 0.1)), -1.0), 1.0)


def _block(kind: str, pieces: list[tuple[float, float, float]]) -> Block:
    return Block(kind=kind, duration_s=math.fsum(piece[0] for piece in pieces), pieces=tuple(pieces))


def _straight(rng: np.random.Generator, ahead: float, astern: float) -> Block:
    """Ahead, coasting, and astern for about the same distance."""
    ahead, astern = _near(rng, ahead), _near(rng, astern)
    return _block("straight", [(6.0, ahead, ahead), (2.0, 0.0, 0.0), (9.0, astern, astern)])


def _circle(rng: np.random.Generator, pair: tuple[float, float], way: int) -> Block:
    outer, inner = (_near(rng, level) for level in pair)
    port, starboard = (outer, inner) if way > 0 else (inner, outer)
    return _block("circle", [(CIRCLE_S, port, starboard)])


def _drift(rng: np.random.Generator) -> Block:
    """A turn on the spot either way, then the motors off: the boat comes to rest, and lies in the wind."""
    turn_s, side = float(rng.uniform(*DRIFT_TURN_S)), float(rng.choice((-1.0, 1.0)))
    level = side * DRIFT_TURN
    return _block("drift", [(turn_s, level, -level), (DRIFT_S - turn_s, 0.0, 0.0)])


def _zigzag(rng: np.random.Generator, surge: float, turn: float) -> Block:
    return Block(kind="zigzag", duration_s=ZIGZAG_S, surge=_near(rng, surge), turn=turn)


def _steps(rng: np.random.Generator) -> Block:
    """Random levels of both motors, each held for a random time; whole control periods are not needed."""
    pieces: list[tuple[float, float, float]] = []
    left_s = STEPS_S
    while left_s > 0.0:
        hold_s = min(float(rng.uniform(*STEP_HOLD_S)), left_s)
        reach = np.where(rng.random(2) < DEAD_BAND_SHARE, DEAD_BAND, 1.0)
        port, starboard = (float(level) for level in reach * rng.uniform(-1.0, 1.0, 2))
        pieces.append((hold_s, port, starboard))
        left_s -= hold_s
    return _block("steps", pieces)


def build(settings: ManoeuvresConfig, config: Config, model: Dynamics) -> Manoeuvres:
    """The programme of a config, around the MPC that keeps the station after it."""
    return Manoeuvres(settings, build_mpc(config.controller.mpc, config, model))
