"""How long the motors go on when the daemon dies in a hold: `python -m bench.guardian [-o docs/results]`.

The simulated boat in real time, on each kind of link; daemons die in five ways at random moments of a hold, while the
motors turn. It takes some 4 s for each death.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from statistics import median

from bench.ending import end_in_words
from tests.support.deaths import DEATHS, LINKS, Death, as_json, deaths_of

MARKER = "<!-- below: written by python -m bench.guardian -->"
WITHIN_S = 0.2


def row(link: str, how: str, deaths: list[Death]) -> str:
    """A line of the table."""
    ended = sorted(death.neutral_s for death in deaths if death.neutral_s is not None)
    late = len(deaths) - sum(neutral_s <= WITHIN_S for neutral_s in ended)
    figures = f"{median(ended):.3f} | {ended[-1]:.3f}" if ended else "- | -"
    return f"| {link} | {how} | {len(deaths)} | {figures} | {late} |"


def page_of(found: dict[str, list[Death]]) -> str:
    """The table of all links."""
    columns = ("link", "death", "times", "neutral after (s), median", "longest", "later than 0.2 s")
    lines = [f"| {' | '.join(columns)} |", f"|{' --- |' * len(columns)}"]
    for link, deaths in found.items():
        lines += [row(link, how, of) for how in DEATHS if (of := [d for d in deaths if d.how == how])]
        lines.append(row(link, "all", deaths))
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--link", choices=LINKS, action="append", help="one kind of link; repeatable")
    parser.add_argument("--deaths", type=int, default=100, help="for each link")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--raw", action="store_true", help="a line of JSON for each death, and no page")
    parser.add_argument("--results", type=Path, help="lines of --raw of before, one file for each link: only the page")
    parser.add_argument("-o", "--output", type=Path, help="folder of the page and its figures")
    options = parser.parse_args()
    found: dict[str, list[Death]] = {}
    for link in options.link or LINKS:
        found[link] = []
        if options.results is not None:
            lines = (options.results / f"{link}.jsonl").read_text().splitlines()
            found[link] = [Death(**json.loads(line)) for line in lines]
            continue

        def tell(death: Death, deaths: list[Death] = found[link]) -> None:
            deaths.append(death)
            if options.raw:
                print(as_json(death), flush=True)

        with tempfile.TemporaryDirectory() as folder:
            hows = [DEATHS[i % len(DEATHS)] for i in range(options.deaths)]
            deaths_of(link, Path(folder), hows, options.seed, tell)
    if options.raw:
        return
    page = page_of(found)
    print(page)
    if options.output is not None:
        file = options.output / "guardian.md"
        head = file.read_text().partition(MARKER)[0] if file.exists() else "# The guardian\n\n"
        file.write_text(f"{head}{MARKER}\n\n{page}\n")
        parts = (f'"{link}": [\n' + ",\n".join(map(as_json, deaths)) + "\n]" for link, deaths in found.items())
        file.with_suffix(".json").write_text("{\n" + ",\n".join(parts) + "\n}\n")


if __name__ == "__main__":
    end_in_words(main)
