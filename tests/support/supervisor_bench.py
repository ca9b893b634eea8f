"""A supervisor on a clock of its own, in which everything is in order until a test changes one thing."""

from dataclasses import replace

from asvhil.config import SupervisorConfig
from asvhil.geo import LocalFrame
from asvhil.supervisor.decision import Decision, Request
from asvhil.supervisor.reasons import Explanation
from asvhil.supervisor.situation import MotorPulses, Situation, StationSticks
from asvhil.supervisor.supervisor import Supervisor
from asvhil.types import Estimate, FrontseatStatus, HoldCommand, MoveCommand, ReleaseCommand

MS = 1_000_000
FRAME = LocalFrame(lat_deg=40.0, lon_deg=-86.0)
STICKS = (1500, 1500, 1500, 1500, 1800, 0, 0, 0)


def status(**changes: object) -> FrontseatStatus:
    """An armed boat in MANUAL with its sticks at rest, or with changes; channels 1 and 3 move its motors."""
    base = FrontseatStatus(t_ns=0, armed=True, mode="MANUAL", ready=True, rc_us=STICKS, outputs_us=(1500, 0, 1500))
    told = replace(base, **changes)  # type: ignore[arg-type]
    return replace(told, sticks_us=(told.rc_us[0], told.rc_us[2]) if len(told.rc_us) > 2 else None)


ESTIMATE = Estimate(
    t_ns=0, n_m=1.0, e_m=2.0, psi_rad=0.5, u_mps=0.0, v_mps=0.0, r_radps=0.0,
    motor=(0.0, 0.0), std=(0.1,) * 6, disturbance=(0.0, 0.0, 0.0), valid=True,
)  # fmt: skip


class SupervisorBench:
    """A supervisor, and the facts of its next tick as attributes that a test can change."""

    def __init__(self, config: SupervisorConfig | None = None) -> None:
        self.supervisor = Supervisor(config or SupervisorConfig())
        self.t_ns = 0
        self.status: FrontseatStatus | None = status()
        self.passed: tuple[FrontseatStatus, ...] = ()  # those that came before it in the next tick
        self.age_s: float | None = 0.1
        self.heard_age_s: float | None = None
        self.stranger: Explanation | None = None
        self.estimate: Estimate | None = ESTIMATE
        self.frame: LocalFrame | None = FRAME
        self.sent: MotorPulses | None = None  # in the last tick
        self.control_ok: bool | None = None
        self.slow: Explanation | None = None
        self.station_age_s: float | None = None
        self.motion: Explanation | None = None
        self.lacks = ""
        self.fault: Explanation | None = None
        self.unverified: Explanation | None = None
        self.station_sticks: tuple[StationSticks, ...] = ()  # since the last tick
        self.bow_rad: float | None = None

    def hold(self, **fields: float) -> Explanation | None:
        """Ask to hold; the answer."""
        return self.step(0, HoldCommand(t_ns=self.t_ns, **fields)).answers[0]

    def move(self, **fields: float) -> Explanation | None:
        """Ask to move the station; the answer."""
        return self.step(0, MoveCommand(t_ns=self.t_ns, **fields)).answers[0]

    def release(self) -> Decision:
        return self.step(0, ReleaseCommand(t_ns=self.t_ns))

    def step(self, ms: int = 50, *requests: Request) -> Decision:
        self.t_ns += ms * MS
        situation = Situation(
            t_ns=self.t_ns,
            status=self.status,
            statuses=() if self.status is None else (*self.passed, self.status),
            heartbeat_age_s=self.age_s,
            estimate=self.estimate,
            heard_age_s=self.heard_age_s,
            stranger=self.stranger,
            frame=self.frame,
            slow=self.slow,
            fault=self.fault,
            unverified=self.unverified,
            station_sticks=self.station_sticks,
            station_age_s=self.station_age_s,
            motion=self.motion,
            lacks=self.lacks,
            control_ok=self.control_ok,
            sent=self.sent,
            bow_rad=self.bow_rad,
        )
        self.control_ok, self.sent, self.station_sticks, self.passed = None, None, (), ()
        return self.supervisor.step(situation, requests)

    def drive(self, seconds: float = 2.0, pulses: tuple[int, int] = (1600, 1400)) -> Decision:
        """Hold with the echo of the override on the motor channels, as an autopilot shows it."""
        for _ in range(round(seconds * 20)):
            decision = self.step()
            self.sent = MotorPulses(t_ns=self.t_ns, us=pulses)
            self.status = status(rc_us=(pulses[0], 1500, pulses[1], *STICKS[3:]))
        return decision
