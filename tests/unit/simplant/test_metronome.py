"""Due times on the grid of a rate."""

from asvhil.simplant.boat.metronome import Metronome

START_NS = 1_000_000_000


def beats(metronome: Metronome, from_ns: int, to_ns: int, step_ns: int = 1_000_000) -> list[int]:
    return [t_ns for t_ns in range(from_ns, to_ns, step_ns) if metronome.take_due(t_ns)]


def test_due_times_are_on_the_grid_and_never_drift() -> None:
    metronome = Metronome(START_NS, 3.0)
    taken = beats(metronome, START_NS, START_NS + 10_000_000_001)
    assert len(taken) == 30
    assert taken[:3] == [START_NS + 334_000_000, START_NS + 667_000_000, START_NS + 1_000_000_000]
    assert taken[-1] == START_NS + 10_000_000_000


def test_missed_due_times_count_as_one() -> None:
    metronome = Metronome(START_NS, 10.0)
    assert metronome.take_due(START_NS + 950_000_000)
    assert not metronome.take_due(START_NS + 999_999_999)
    assert metronome.take_due(START_NS + 1_000_000_000)


def test_another_rate_has_its_own_grid_since_power_on() -> None:
    metronome = Metronome(START_NS, 10.0)
    beats(metronome, START_NS, START_NS + 130_000_000)
    metronome.set_rate(START_NS + 130_000_000, 4.0)
    assert beats(metronome, START_NS + 130_000_000, START_NS + 600_000_000) == [
        START_NS + 250_000_000,
        START_NS + 500_000_000,
    ]
