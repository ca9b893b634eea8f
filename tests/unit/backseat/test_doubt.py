"""Why learning on station is frozen: each reason, in the order of what is asked first."""

import pytest

from asvhil.backseat import doubt as reasons
from asvhil.backseat.doubt import doubt
from asvhil.backseat.perception import Perceived
from asvhil.types import Estimate, Phase, Station, WaveMotion, changed

HERE = Station(n_m=0.0, e_m=0.0, psi_rad=0.0)
AT_REST = Estimate(
    t_ns=0, n_m=0.0, e_m=0.0, psi_rad=0.0, u_mps=0.0, v_mps=0.0, r_radps=0.0,
    motor=(), std=(), disturbance=(0.0, 0.0, 0.0), valid=True,
)  # fmt: skip
SEEN = Perceived(t_ns=0, statuses=(), status=None, estimate=AT_REST, wind=None, usable_wind=None, frame=None)


def why(
    estimate: Estimate | None = AT_REST,
    *,
    phase: Phase = Phase.HOLD,
    share: float | None = None,
    sensors_ok: bool = True,
    motors_ok: bool = True,
) -> str:
    waves = None if share is None else WaveMotion(peak_hz=0.3, velocity_std_mps=0.1, yaw_std_radps=0.0, share=share)
    seen = changed(SEEN, estimate=estimate, waves=waves)
    return doubt(seen, phase, HERE, near_m=10.0, sensors_ok=sensors_ok, motors_ok=motors_ok)


def test_a_sound_boat_on_its_station_is_no_doubt() -> None:
    assert why() == why(share=0.4) == why(changed(AT_REST, n_m=9.0, u_mps=1.0)) == ""


@pytest.mark.parametrize("phase", [Phase.STANDBY, Phase.PREPARE, Phase.FAILSAFE])
def test_nothing_is_learned_without_the_motors(phase: Phase) -> None:
    assert why(phase=phase) == why(None) == reasons.NO_HOLD
    assert doubt(SEEN, Phase.HOLD, None, near_m=10.0, sensors_ok=True, motors_ok=True) == reasons.NO_HOLD


def test_sensors_motors_and_motion_in_doubt() -> None:
    assert why(sensors_ok=False) == why(changed(AT_REST, valid=False)) == reasons.SENSOR
    assert why(motors_ok=False) == reasons.MOTORS
    assert why(changed(AT_REST, n_m=8.0, e_m=-8.0)) == reasons.WAY_IN
    assert why(changed(AT_REST, u_mps=-1.6)) == why(changed(AT_REST, r_radps=0.7)) == reasons.FAST
    assert why(share=0.5) == reasons.ROUGH
