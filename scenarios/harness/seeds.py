"""Lists of seeds from the command line."""

import re

LARGEST_SEED = 2**32 - 1
MOST_SEEDS = 10_000  # of one command


def parse_seeds(text: str) -> list[int]:
    """The seeds in a list such as ``0-9``, ``3`` or ``0,2,5-7``; each once, in that order.

    Raises
    ------
    ValueError      one line with an example of what would be right
    """
    right = "write numbers and ranges, for instance 0-9 or 0,2,5-7"
    seeds: dict[int, None] = {}
    for part in text.split(","):
        found = re.fullmatch(r" *([0-9]{1,20})(?:-([0-9]{1,20}))? *", part)
        if not found:
            raise ValueError(f"seeds = {text!r}: {right}")
        first, last = int(found[1]), int(found[2] or found[1])
        if not first <= last <= LARGEST_SEED:
            raise ValueError(
                f"seeds = {text!r}: {part.strip()} is not a range of seeds from 0 to {LARGEST_SEED}; {right}"
            )
        if last - first + len(seeds) >= MOST_SEEDS:
            raise ValueError(f"seeds = {text!r}: more than {MOST_SEEDS} at once are too many; split them")
        seeds |= dict.fromkeys(range(first, last + 1))
    return list(seeds)
