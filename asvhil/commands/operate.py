"""`asvhil hold`, `asvhil neutral` and `asvhil release`: an operator's requests to the running daemon."""

from __future__ import annotations

import contextlib
import math
import re
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from asvhil.commands.numbers import lat_lon
from asvhil.commands.options import SetOption
from asvhil.commands.station_course import check_course, once_held, parameters_of_course, set_course
from asvhil.errors import AsvhilError, LinkError, meant

if TYPE_CHECKING:
    from asvhil.config import Config

# The words of Reason.STATION_UNCONFIRMED
FAR = re.compile(r"station is ([0-9]+) m away, at most")
MOVES_M = 20.0  # what a drifting boat may move while somebody reads the question

DaemonOption = Annotated[str, typer.Option("--config", help="The daemon's config: where its operator link is.")]


def hold(
    at: Annotated[
        str | None, typer.Option(metavar="LAT,LON", help="Station in degrees; the present position by default.")
    ] = None,
    heading: Annotated[
        float | None, typer.Option(help="Heading to keep in degrees; the present one by default.")
    ] = None,
    within: Annotated[
        float,
        typer.Option(
            metavar="METRES",
            min=0.0,
            help="A station as far off as this is meant, up to 2000; else supervisor.max_distance_m is the limit.",
        ),
    ] = 0.0,
    policy: Annotated[
        str | None,
        typer.Option(
            help="Heading from now on: fixed, bow or stern to the weather, either, free; as it is by default."
        ),
    ] = None,
    drift: Annotated[
        str | None,
        typer.Option(metavar="SPEED@DEG", help="The station moves over ground, in m/s toward DEG from north."),
    ] = None,
    way: Annotated[
        float, typer.Option(metavar="METRES", min=0.0, help="With --drift: after so far the station stays. 0: no end.")
    ] = 0.0,
    follow: Annotated[
        int | None,
        typer.Option(
            metavar="SYSTEM",
            min=1,
            max=255,
            help="The station goes after the vehicle of that MAVLink system id, by its FOLLOW_TARGET messages.",
        ),
    ] = None,
    config: DaemonOption = "field",
    set_: SetOption = [],  # noqa: B006
) -> None:
    """Ask the running daemon to hold a station; the answer says which, and how far off the boat is."""
    from asvhil.config import load_config
    from asvhil.config.heading import POLICIES
    from asvhil.supervisor.stations import MAX_STATION_DISTANCE_M

    if policy is not None and policy not in POLICIES:
        raise AsvhilError(f"--policy {policy}: unknown{meant(policy, POLICIES)}")
    if drift is not None and follow is not None:
        raise AsvhilError("--drift and --follow: one of them")
    if way and drift is None:
        raise AsvhilError("--way: goes with --drift only")
    if within > MAX_STATION_DISTANCE_M:
        raise AsvhilError(f"--within {within:g}: a station is {MAX_STATION_DISTANCE_M:.0f} m away at most")
    moving = parameters_of_course(drift, way, follow)
    settings = load_config(config, tuple(set_))
    lat_deg, lon_deg = (None, None) if at is None else lat_lon("--at", at)
    psi_rad = None if heading is None else math.radians(heading)
    check_course(settings, moving)
    # A policy of fixed comes first, or that of an earlier hold would turn the heading that is asked for here.
    with _headings_fixed(settings) if policy == "fixed" else contextlib.nullcontext():
        _take_station(settings, lat_deg, lon_deg, psi_rad, within)
    with once_held():
        if policy is not None and policy != "fixed":
            _choose_policy(settings, policy)
        for name, value in moving.items():
            set_course(settings, name, value)
    held, cost = _what_is_held(settings)
    if drift is not None:
        held += f"; moving: {drift}" + (f", {way:g} m" if way else "")
    elif follow is not None:
        held += f"; following system {follow}"
    if policy is None:
        policy = _unfixed(settings)
    typer.echo(held + ("" if policy is None else f"; heading: {policy}"))
    if cost and policy in (None, "fixed"):
        typer.echo(f"its heading: {cost}")


def release(
    config: DaemonOption = "field",
    set_: SetOption = [],  # noqa: B006
) -> None:
    """Ask the running daemon to release the motors."""
    from asvhil.config import load_config
    from asvhil.io.mavlink.frames import dialect
    from asvhil.operator.encoding import encode_release

    settings = load_config(config, tuple(set_))
    data = encode_release(settings.links.autopilot)
    _ask(settings, data, dialect.MAV_CMD_NAV_GUIDED_ENABLE)
    typer.echo("released")


def neutral(
    config: DaemonOption = "field",
    set_: SetOption = [],  # noqa: B006
) -> None:
    """Ask the running daemon for neutral at once; the motors stay its own, at rest, until a hold or a release."""
    from asvhil.config import load_config
    from asvhil.io.mavlink.frames import dialect
    from asvhil.operator.encoding import encode_neutral

    settings = load_config(config, tuple(set_))
    _ask(settings, encode_neutral(settings.links.autopilot), dialect.MAV_CMD_COMPONENT_ARM_DISARM)
    typer.echo("neutral: the boat drifts")


def _take_station(
    config: Config, lat_deg: float | None, lon_deg: float | None, psi_rad: float | None, within_m: float
) -> None:
    """Hold a station, one that is far off once a person has said that it is meant. Raises AsvhilError if refused."""
    from asvhil.io.mavlink.frames import dialect
    from asvhil.operator.encoding import encode_hold

    def hold_within(far_m: float) -> None:
        data = encode_hold(config.links.autopilot, lat_deg, lon_deg, psi_rad, far_m)
        _ask(config, data, dialect.MAV_CMD_DO_REPOSITION)

    try:
        hold_within(within_m)
    except LinkError:
        raise
    except AsvhilError as error:
        hold_within(_meant_all_the_same(error))


def _meant_all_the_same(refused: AsvhilError) -> float:
    """How far off (m) a station may be that was refused as too far, if a person at the terminal means it.

    Raises the refusal for anything else, and where nobody is there, or means it.
    """
    far = FAR.search(str(refused))
    if far is None or not sys.stdin.isatty():
        raise refused
    if not typer.confirm(f"The station is {far[1]} m from the boat. Is that meant?"):
        raise refused
    return float(far[1]) + MOVES_M


def _what_is_held(config: Config) -> tuple[str, str]:
    """Place and heading of the station that was granted, and the way there; so a digit that is wrong is seen.

    And what that heading costs in the weather, "" where there is nothing to tell.
    """
    from asvhil.links.operator_listener import OperatorListener
    from asvhil.supervisor.heading_cost import SUBJECT

    link = config.links.operator
    try:
        look = OperatorListener(config.links.autopilot, link.endpoint, link.signing).look()
    except LinkError:  # it was granted all the same
        return "holding", ""
    station, distance_m = look["station"], look.get("distance_m")
    if look["phase"] not in ("hold", "failsafe") or station is None:
        return f"granted; {look['phase']}: {look['reason']}", ""
    place = f"{station['lat_deg']:.7f}, {station['lon_deg']:.7f}, heading {station['heading_deg']:.1f} deg"
    away = "" if distance_m is None else f"; {distance_m:.1f} m away"
    return f"holding {place}{away}", look["notes"].get(SUBJECT, "")


@contextlib.contextmanager
def _headings_fixed(config: Config) -> Iterator[None]:
    """Choose the policy fixed, for a hold that is asked for meanwhile; where it is not granted, that of before again.

    So it is too where a person interrupts, at the question or while the answer is waited for. A hold that is granted
    all the same then goes on with the policy of before.
    """
    before = _unfixed(config)
    try:
        _choose_policy(config, "fixed")
        yield
    except LinkError:  # nobody knows whether it was done, and nobody is there to put anything back
        raise
    except (AsvhilError, typer.Abort, KeyboardInterrupt) as refused:
        if before is not None:
            _put_back(config, before, refused)
        raise


def _put_back(config: Config, policy: str, refused: BaseException) -> None:
    """Choose the policy of before a hold that was not granted. AsvhilError with its refusal where that fails."""
    try:
        _choose_policy(config, policy)
    except AsvhilError as error:
        first = str(refused) if isinstance(refused, AsvhilError) else "interrupted"
        kept = f"the heading policy is fixed now, and not {policy} as before ({error})"
        raise AsvhilError(f"{first}; {kept}") from None


def _choose_policy(config: Config, policy: str) -> None:
    """Set the policy of headings from now on. Raises AsvhilError where it is not taken."""
    from asvhil.config.heading import POLICIES
    from asvhil.links.operator_client import set_parameter
    from asvhil.operator.encoding import encode_parameter
    from asvhil.operator.station_parameters import POLICY_PARAMETER

    link, number = config.links.operator, float(POLICIES.index(policy))
    data = encode_parameter(config.links.autopilot, POLICY_PARAMETER, number)
    value, text = set_parameter(data, link.endpoint, POLICY_PARAMETER, number, signing=link.signing)
    if value != number:
        raise AsvhilError(f"the daemon refused the heading policy; a hold goes on with that of before: {text}")


def _unfixed(config: Config) -> str | None:
    """The policy by which stations follow the weather, chosen with an earlier hold; None: they do not, or no answer."""
    from asvhil.config.heading import POLICIES
    from asvhil.links.operator_client import read_parameter
    from asvhil.operator.encoding import encode_parameter_question
    from asvhil.operator.station_parameters import POLICY_PARAMETER

    link, question = config.links.operator, encode_parameter_question(config.links.autopilot, POLICY_PARAMETER)
    try:
        number = read_parameter(question, link.endpoint, POLICY_PARAMETER, signing=link.signing)
    except LinkError:  # it was granted all the same
        return None
    return POLICIES[int(number)] if 0 < number < len(POLICIES) else None


def _ask(config: Config, data: bytes, mav_cmd: int) -> None:
    """Send a request until it is answered. Raises AsvhilError with the daemon's words where it is refused."""
    from asvhil.links.operator_client import send_and_wait

    link = config.links.operator
    result, text = send_and_wait(data, link.endpoint, mav_cmd, signing=link.signing)
    if result != 0:
        raise AsvhilError(f"the daemon refused: {text or f'MAV_RESULT {result}'}")
