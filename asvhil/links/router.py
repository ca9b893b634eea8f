"""The daemon's MAVLink links: checks of senders and signatures, and routing between autopilot and ground stations.

The backseat and the log get only frames that have passed the checks, and frames are signed after they were logged. So
a replay needs neither key nor clock, and no key is ever in a log.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Protocol

from asvhil.autopilot.ground_stations import STICK_MESSAGES
from asvhil.config.links import LinksConfig
from asvhil.config.mavlink import MavlinkLinkConfig, SigningConfig
from asvhil.config.ports import AUTOPILOT, GROUND, OPERATOR
from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import message_id, message_number, source, target
from asvhil.io.mavlink.routing import Hops, LinkRules, RoutingTable
from asvhil.io.mavlink.signature_filter import SignatureFilter
from asvhil.io.mavlink.signing import PER_SECOND, Signer, SigningClock, SigningState, Verdict, Verifier
from asvhil.links.keyfile import read_key, read_state, write_state
from asvhil.operator.goto import is_goto
from asvhil.types import Frame

NEWS_NS = 5_000_000_000
SAVE_NS = 10_000_000_000


class ForwardingLink(Protocol):
    """The part of a link that the router uses."""

    async def forward(self, data: bytes) -> bool:
        """Forward a frame if the link has room: whether it had."""
        ...

    def note_proven(self, peer: str) -> None:
        """A frame of a peer was accepted."""
        ...


class MavlinkRouter:
    """Filters, routes and signs the frames of one daemon's MAVLink links.

    Raises ConfigError where a key, a message name or a file of the config is wrong.

    `unix_ns` is the computer's time of day, for signatures alone; `t_ns` of frames is the daemon's own clock.
    `on_forward` is called with every frame of others that is forwarded to the autopilot.
    """

    def __init__(
        self,
        config: LinksConfig,
        *,
        start_ns: int,
        unix_ns: Callable[[], int],
        on_forward: Callable[[Frame], None] = lambda frame: None,
    ) -> None:
        self._unix_ns = unix_ns
        self._on_forward = on_forward
        self._autopilot_system_id = config.autopilot.autopilot_system_id
        self._claim_goto = config.operator.claim_goto
        self.ground_specs = {f"{GROUND}{name}": link.endpoint for name, link in config.ground_stations.items()}
        links: dict[str, MavlinkLinkConfig] = {AUTOPILOT: config.autopilot, OPERATOR: config.operator}
        links |= {f"{GROUND}{name}": link for name, link in config.ground_stations.items()}
        self.warnings: list[str] = []
        self._clock = SigningClock()
        self._signers: dict[str, Signer] = {}
        self._state_files: dict[str, Path] = {}
        self._filters = {
            port: SignatureFilter(link.senders, self._verifier(port, link, start_ns)) for port, link in links.items()
        }
        self._table = self._make_table(config, links)
        self._links: Mapping[str, ForwardingLink] = {}
        self._unforwarded: Counter[str] = Counter()
        self._told: dict[str, str] = {}
        self._news_ns = start_ns
        self._save_ns = start_ns
        self._saved_last = self._clock.last

    def rejected(self, port: str) -> Counter[str]:
        """Cumulative counts of the rejected frames of a link, by reason."""
        return self._filters[port].rejected

    def attach(self, links: Mapping[str, ForwardingLink]) -> None:
        """The links to forward on, by port."""
        self._links = links

    async def receive(self, frame: Frame) -> list[Frame]:
        """The frames for the backseat out of one received frame; frames for others are forwarded."""
        signature_filter = self._filters.get(frame.port)
        if signature_filter is None:
            return [frame]
        routed = self._table is not None and frame.port != OPERATOR
        accepted = signature_filter.receive(frame, self._unix_ns())
        if frame.peer and self._proves(frame.port, accepted) and frame.port in self._links:
            self._links[frame.port].note_proven(frame.peer)
        if not routed and not signature_filter.guards:
            return [frame]  # what is no MAVLink frame in it the codec counts as garbage
        operators: list[Frame] = []
        if routed:
            for data in accepted:
                operators += await self._route(frame, data)
        if frame.port.startswith(GROUND):
            return operators
        if not signature_filter.guards:
            return [frame, *operators]
        whole = b"".join(accepted)
        return [*([Frame(t_ns=frame.t_ns, port=frame.port, data=whole, peer=frame.peer)] if whole else []), *operators]

    def outgoing(self, frame: Frame) -> list[Frame]:
        """The frames to send, each with its link, for one frame of the backseat; signed where the link is signed."""
        if frame.port == OPERATOR and frame.via:
            return [self._signed(Frame(t_ns=frame.t_ns, port=frame.via, data=frame.data, peer=frame.peer))]
        ports = [frame.port]
        if frame.port == OPERATOR and not frame.peer and self._table is not None:
            ports += self._table.originate(frame.data, besides=(AUTOPILOT,))
        return [self._signed(Frame(t_ns=frame.t_ns, port=name, data=frame.data, peer=frame.peer)) for name in ports]

    def last_words(self, steps: Sequence[Sequence[Frame]]) -> list[list[bytes]]:
        """Frames that another process may send later, in steps: signed, where the link is, ahead of our own.

        What we send until they are made anew, a tick later, must not overtake them; they are a second ahead.
        """
        unix_ns, by = self._unix_ns(), PER_SECOND
        signed: list[list[bytes]] = []
        for frames in steps:
            signed.append([])
            for frame in frames:
                by += 1
                signer = self._signers.get(frame.port)
                signed[-1].append(frame.data if signer is None else signer.sign_ahead(frame.data, unix_ns, by))
        return signed

    def remarks(self, port: str) -> str:
        """How many frames were dropped on a link, and why, as text; empty if none."""
        signature_filter = self._filters.get(port)
        rejected = signature_filter.rejected if signature_filter is not None else Counter[str]()
        parts = [f"{count} {reason}" for reason, count in sorted(rejected.items())]
        text = f"frames dropped: {', '.join(parts)}" if parts else ""
        if rejected[Verdict.FUTURE.value]:
            text += " (is this computer's clock right?)"
        unforwarded = self._unforwarded[port]
        if unforwarded:
            text += f"{'; ' if text else ''}{unforwarded} forwarded frames found no room"
        return text

    def take_news(self, t_ns: int) -> list[str]:
        """Remarks that have changed, on all links; at most every 5 s, so that an attack does not fill the log."""
        if t_ns - self._news_ns < NEWS_NS:
            return []
        self._news_ns = t_ns
        return self.take_all_news()

    def take_all_news(self) -> list[str]:
        """Remarks that were not taken yet."""
        now = {port: text for port in self._filters if (text := self.remarks(port))}
        fresh = [f"link {port}: {text}" for port, text in now.items() if self._told.get(port) != text]
        self._told = now
        return fresh

    def take_save_due(self, t_ns: int) -> bool:
        """Whether to write the timestamps now: at most every 10 s, and only if they have changed."""
        if not self._state_files or t_ns - self._save_ns < SAVE_NS or self._clock.last == self._saved_last:
            return False
        self._save_ns, self._saved_last = t_ns, self._clock.last
        return True

    def states(self) -> dict[Path, SigningState]:
        """A copy of the signing timestamps of every link by file, for a thread to write."""
        found = {}
        for port, path in self._state_files.items():
            verifier = self._filters[port].verifier
            if verifier is not None:
                found[path] = verifier.state()
        return found

    # --- parts ---------------------------------------------------------------------------------------------

    def _proves(self, port: str, accepted: Sequence[bytes]) -> bool:
        """Whether frames show that their peer is one that the link is for: on the autopilot's, of its vehicle."""
        return any(port != AUTOPILOT or source(data)[0] == self._autopilot_system_id for data in accepted)

    async def _route(self, frame: Frame, data: bytes) -> list[Frame]:
        assert self._table is not None
        hops = self._table.route(frame.port, data, frame.t_ns)
        if self._claim_goto and AUTOPILOT in hops.links and is_goto(data):
            hops = Hops(tuple(name for name in hops.links if name != AUTOPILOT), True)
        # Sticks that the autopilot gets may be the pilot's, who comes first.
        local = hops.local or (AUTOPILOT in hops.links and message_id(data) in STICK_MESSAGES)
        for name in hops.links:
            if not await self._links[name].forward(data):
                self._unforwarded[name] += 1
            elif name == AUTOPILOT:
                self._on_forward(Frame(t_ns=frame.t_ns, port=AUTOPILOT, data=data, via=frame.port))
        if not local:
            return []
        if frame.port == AUTOPILOT and (source(data)[0] == self._autopilot_system_id or target(data)[0] == 0):
            return []  # messages of the vehicle, which the codec of that port reads; an operator addresses this daemon
        return [Frame(t_ns=frame.t_ns, port=OPERATOR, data=data, peer=frame.peer, via=frame.port)]

    def _signed(self, frame: Frame) -> Frame:
        signer = self._signers.get(frame.port)
        if signer is None:
            return frame
        data = signer.sign(frame.data, self._unix_ns())
        return Frame(t_ns=frame.t_ns, port=frame.port, data=data, peer=frame.peer)

    def _verifier(self, port: str, link: MavlinkLinkConfig, start_ns: int) -> Verifier | None:
        signing = link.signing
        if signing is None:
            return None
        key, warning = read_key(Path(signing.key_file).expanduser())
        if warning is not None and warning not in self.warnings:
            self.warnings.append(warning)
        path = self._state_files[port] = state_file(signing, port)
        state = read_state(path)
        save_states({path: state})  # fails at start if the file cannot be written
        self._signers[port] = Signer(key, signing.link_id, self._clock)
        return Verifier(
            key,
            self._clock,
            accept_unsigned=_numbers(port, "signing.accept_unsigned", signing.accept_unsigned),
            max_behind_s=signing.max_behind_s,
            max_ahead_s=signing.max_ahead_s,
            state=state,
            start_ns=start_ns,
        )

    @staticmethod
    def _make_table(config: LinksConfig, links: Mapping[str, MavlinkLinkConfig]) -> RoutingTable | None:
        enabled = config.routing.enabled
        if not (bool(config.ground_stations) if enabled is None else enabled):
            return None
        rules = {
            port: LinkRules(
                **{
                    key: _numbers(port, key, getattr(link, key))
                    for key in ("allow_in", "block_in", "allow_out", "block_out")
                }
            )
            for port, link in links.items()
            if port != OPERATOR
        }
        own = config.autopilot
        local = {(own.system_id, own.component_id), (own.override_system_id, own.component_id)}
        return RoutingTable(rules, local, duplicates_ns=round(config.routing.duplicates_s * 1e9))


def save_states(states: Mapping[Path, SigningState]) -> None:
    """Write timestamps to their files. ConfigError names the file that cannot be written."""
    for path, state in states.items():
        try:
            write_state(path, state)
        except OSError as error:
            raise ConfigError(f"{path}: signing timestamps cannot be written ({error.strerror})") from None


def state_file(signing: SigningConfig, port: str) -> Path:
    """Where the timestamps of a signed link are kept."""
    return Path(signing.state_file or f"{signing.key_file}.{port}.timestamps").expanduser()


def _numbers(port: str, key: str, names: tuple[str, ...]) -> frozenset[int]:
    try:
        return frozenset(message_number(name) for name in names)
    except ConfigError as error:
        place = f"ground_stations.{port.removeprefix(GROUND)}" if port.startswith(GROUND) else port
        raise ConfigError(f"key links.{place}.{key}: {error}") from None
