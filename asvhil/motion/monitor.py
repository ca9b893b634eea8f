"""The monitor of the motion while a station is held: does the boat answer as it is told to, by the bank's evidence."""

from __future__ import annotations

import math

import numpy as np

from asvhil.config import EkfConfig, MotionConfig, VesselConfig
from asvhil.geo import wrap_rad
from asvhil.motion.bank import Bank
from asvhil.motion.evidence import Evidence
from asvhil.motion.filter import BankNoise
from asvhil.motion.fit import Fit
from asvhil.motion.hypotheses import FAULTY, SOUND
from asvhil.supervisor.reasons import Explanation
from asvhil.types import GroundVelocity, Heading, Measurement, YawRate

STEP_S = 0.2
OLD_NS = 1_000_000_000  # a heading this old is none
JUMP_RAD = math.radians(25.0)  # a heading this far off the turn that the gyro tells has jumped
JUMP_TIME_S = 10.0  # time constant at which that is forgotten
GAP_S = 1.0  # a step this long begins anew
LEAST_ROUGH = 1.1  # from this roughness on little evidence is none: no hypothesis predicts well
KEPT = 0.75  # of the evidence for a suspicion: with less it ends
# Times what is asked for, in a fault's sum and in that of its name, at which it is not waited for: a boat that answers
# so wrong gathers way.
SOON, BY_FAR = 0.5, 8.0
LATER = 1.5  # times the evidence, once a hold goes on for long, and in waves
UNLED = 2.0  # times as long a suspicion lasts before it needs no lead
# Beside a sensor's own noise: waves, and a velocity that is some tenths of a second old.
VELOCITY_NOISE, YAW_NOISE = 1.3, 2.0


class FaultVerdict:
    """The fault with the most evidence, once it is enough and leads the others, or has been enough for long."""

    def __init__(self, config: MotionConfig) -> None:
        self._config = config
        self._since_ns: int | None = None

    def reset(self) -> None:
        """Nothing is known."""
        self._since_ns = None

    def step(
        self, t_ns: int, evidence: Evidence, leader: tuple[int, float], *, late: bool = False
    ) -> Explanation | None:
        """Judge what has been found until now, and the `leader` of it; `late`: when chance has had time."""
        asked, names = (LATER if late else 1.0) * self._config.evidence, evidence.names
        by_far = float(names.max()) >= BY_FAR * asked and float(evidence.sums[names.argmax()]) >= SOON * asked
        if float(evidence.sums.max()) < asked and not by_far:
            self.reset()
            return None
        best, lead = leader
        if self._since_ns is None:
            self._since_ns = t_ns
        waited_s = (t_ns - self._since_ns) * 1e-9
        return FAULTY[best].fault if lead >= self._config.lead or waited_s >= self._config.lead_s else None


class Suspicion:
    """The same fault with some evidence and before the others for seconds: what comes by chance comes and goes.

    Seconds in which nothing was learned, since a sensor ails, or in which the fault does not explain what is seen, do
    not count.

    Evidence that sinks a little below what is asked goes on with it, and what has been first for twice the time needs
    no lead: a dead motor is told from two dead ones by what the other one does, and that may be little.
    """

    def __init__(self, config: MotionConfig) -> None:
        self._config = config
        self._best: int | None = None
        self._lasted_s = 0.0
        self.fault: Explanation | None = None

    def reset(self) -> None:
        """Nothing is known."""
        self._best = self.fault = None

    def step(self, dt_s: float, evidence: Evidence, leader: tuple[int, float]) -> None:
        """Judge what has been found until now, and the `leader` of it, for so long: `fault`, None while not enough."""
        best, lead = leader
        found, most = evidence.names[best], self._config.early_evidence
        if best != self._best or found < KEPT * most:
            self.reset()
            if found < most:
                return
            self._best, self._lasted_s = best, 0.0
        else:
            self._lasted_s += dt_s
        lasted_s, asked_s = self._lasted_s + 1e-6, self._config.early_lasts_s  # a sum of steps may lack a last bit
        if (lasted_s >= asked_s and lead >= self._config.lead) or lasted_s >= UNLED * asked_s:
            self.fault = FAULTY[best].fault


def leader_of(evidence: Evidence) -> tuple[int, float]:
    """The fault that explains most, and by how much it leads the next one."""
    names = evidence.names
    second, first = names.argsort()[-2:].tolist()
    return first, float(names[first]) - float(names[second])


class MotionMonitor:
    """Evidence on motors and compass from velocity, yaw rate and heading under the commands that were sent.

    `on_measurement` for all that comes; `step` in each tick; `begin` when a hold begins. Sensors that their own
    health calls silent or frozen prove nothing, so the evidence waits for them.
    """

    def __init__(self, config: MotionConfig, ekf: EkfConfig, vessel: VesselConfig) -> None:
        noise = BankNoise(
            velocity_std_mps=VELOCITY_NOISE * ekf.velocity_std_mps,
            yaw_rate_std_radps=YAW_NOISE * ekf.yaw_rate_std_radps,
        )
        self._bank = Bank(SOUND + FAULTY, vessel, noise)
        self._evidence = Evidence(len(SOUND), [fault.log_prior for fault in FAULTY])
        self._velocity: GroundVelocity | None = None
        self._heading: Heading | None = None
        self._yaw_rate: YawRate | None = None
        self._fresh: set[type] = set()
        self._t_ns: int | None = None  # of the last step; None before the first
        self._lagged_ns = 0
        self._verdict, self._suspicion = FaultVerdict(config), Suspicion(config)
        self._fit = Fit(len(SOUND) + len(FAULTY))
        self._last_rad = self._turned_rad = self._jump_rad = 0.0  # heading of the last step, the turn since, a jump

    def on_measurement(self, measurement: Measurement) -> None:
        """Keep the latest of each kind that counts here."""
        match measurement:
            case GroundVelocity():
                self._velocity = measurement
            case Heading():
                self._heading = measurement
            case YawRate():
                self._yaw_rate = measurement
            case _:
                return
        self._fresh.add(type(measurement))

    def begin(self) -> None:
        """A hold begins: forget all evidence. What is known of motion and current stays."""
        self._evidence.reset()
        self._verdict.reset()
        self._suspicion.reset()
        self._fit.begin()
        self._bank.restart(np.ones(len(SOUND) + len(FAULTY), dtype=bool), 0)

    @property
    def likely(self) -> Explanation | None:
        """What may be wrong, by less evidence than `step` asks for: to be told, and not to end a hold by."""
        return self._suspicion.fault

    @property
    def doubtful(self) -> bool:
        """Whether what is found may be the water's, since no hypothesis predicts well."""
        return self._fit.poor

    @property
    def current_ned(self) -> tuple[float, float]:
        """The current (m/s) that carries the boat, as far as it has shown."""
        return self._bank.current_ned if self._t_ns is not None else (0.0, 0.0)

    @property
    def current_std_mps(self) -> float:
        """How well it is known; infinite while it is not followed."""
        return self._bank.current_std_mps if self._t_ns is not None else math.inf

    def step(
        self,
        t_ns: int,
        command: tuple[float, float],
        wind_ned: tuple[float, float] | None,
        ailing: frozenset[type] = frozenset(),
        *,
        holding: bool = True,
        late: bool = False,
    ) -> Explanation | None:
        """What is wrong, once there is enough evidence; `command` is what the motors got since the last tick.

        `ailing`: the kinds of measurement whose sensor is silent or frozen. While nothing is held there is no evidence,
        and motion and current are followed. `late`: more evidence is asked for, since the hold has gone on for long, or
        in waves.
        """
        velocity, heading = self._velocity, self._heading
        if velocity is None or heading is None or t_ns - heading.t_ns > OLD_NS:
            self._suspicion.reset()
            return None
        # Times go back in logs that were edited; a step backwards has no motion.
        if self._t_ns is None or not 0.0 <= (t_ns - self._t_ns) * 1e-9 <= GAP_S:
            rate = 0.0 if self._yaw_rate is None else self._yaw_rate.r_radps
            self._bank.reset((velocity.vn_mps, velocity.ve_mps), rate)
            self._t_ns = self._lagged_ns = t_ns
            self._fresh.clear()
            self._last_rad, self._turned_rad, self._jump_rad = heading.psi_rad, 0.0, 0.0
            return None
        tick_s = (t_ns - self._lagged_ns) * 1e-9
        self._bank.lag(command, tick_s)
        self._turned_rad += 0.0 if self._yaw_rate is None else tick_s * self._yaw_rate.r_radps
        self._lagged_ns = t_ns
        dt_s = (t_ns - self._t_ns) * 1e-9
        if dt_s < STEP_S - 1e-3:
            return None
        self._t_ns = t_ns
        self._follow(heading.psi_rad, dt_s)
        self._bank.predict(dt_s, heading.psi_rad, wind_ned)
        counted = self._weigh(dt_s, ailing, holding)
        leader = leader_of(self._evidence)
        if self._fit.roughness >= LEAST_ROUGH:
            self._suspicion.reset()
        elif counted and self._fit.explains(len(SOUND) + leader[0]):
            self._suspicion.step(dt_s, self._evidence, leader)
        return self._verdict.step(t_ns, self._evidence, leader, late=late)

    def _follow(self, heading_rad: float, dt_s: float) -> None:
        """How far the compass has jumped: its turns less those of the gyro, which drift and are forgotten."""
        if self._yaw_rate is not None:
            apart_rad = wrap_rad(heading_rad - self._last_rad - self._turned_rad)
            self._jump_rad = math.exp(-dt_s / JUMP_TIME_S) * (self._jump_rad + apart_rad)
        self._last_rad, self._turned_rad = heading_rad, 0.0

    def _weigh(self, dt_s: float, ailing: frozenset[type], holding: bool) -> bool:
        """Correct the bank, and add to the evidence: whether that counted."""
        velocity, rate = self._velocity, self._yaw_rate
        assert velocity is not None
        moved = GroundVelocity in self._fresh - ailing
        turned = rate is not None and YawRate in self._fresh - ailing
        log, squares = self._bank.correct(
            (velocity.vn_mps, velocity.ve_mps) if moved else None,
            rate.r_radps if rate is not None and turned else None,
        )
        self._fresh.clear()
        self._fit.add(squares, 2 * moved + turned, dt_s)
        if ailing or not holding or abs(self._jump_rad) > JUMP_RAD:
            return False
        self._evidence.add(log, self._fit.weight)
        none = self._evidence.sums <= 0.0
        if none.any():
            which = np.concatenate([np.zeros(len(SOUND), dtype=bool), none])
            self._bank.restart(which, self._evidence.best_sound)
        return True
