"""Are the tests tested?  Flips a sign or a comparison of the product, and sees whether a test fails: `make mutants`.

    python tests/mutants --number 200 --seed 1 --jobs 2

Every flip is made in a copy of the tree that belongs to its job, the tests nearest to it are run until the first
failure, and the copy is put right again.  A test counts only if it passes in the copy without a flip.  One line is
written for every finished flip, so that a run that was interrupted goes on where it was; a flip that survived is tried
again with ``--again``.  Equivalent flips, which change nothing that anybody could see, are listed with their reason in
``equivalent.toml``, and counted apart.
"""

import argparse
import json
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from threading import Event

from flips import ROOT, Flip, every_flip, sample
from nearness import Nearness
from tree import Tree
from trial import CAUGHT, EQUIVALENT, OUTCOMES, Trial, equivalents

WANTED = 0.95  # share of the flips, less the equivalent ones, that are to be caught


def arguments() -> argparse.Namespace:
    """What the command line says."""
    parser = argparse.ArgumentParser(prog="tests/mutants", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--number", type=int, default=200, help="flips to try (200)")
    parser.add_argument("--seed", type=int, default=1, help="which are drawn (1)")
    parser.add_argument("--jobs", type=int, default=1, help="copies of the tree to work in at the same time (1)")
    parser.add_argument("--cap", type=float, default=150.0, help="seconds of tests for one flip (150)")
    parser.add_argument("--only", default="", help="flips of files whose path begins so, or one as path:line")
    parser.add_argument("--again", action="store_true", help="try those once more that were not caught")
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "mutants", help="copies and results")
    return parser.parse_args()


def results_so_far(file: Path, again: bool) -> dict[str, dict[str, object]]:
    """What was found for each flip, by its key; the last line counts.  With `again` only what was caught is left."""
    found: dict[str, dict[str, object]] = {}
    if file.exists():
        for line in file.read_text(encoding="utf-8").splitlines():
            row = json.loads(line)
            found[str(row["key"])] = row
    return {key: row for key, row in found.items() if not again or row["outcome"] == CAUGHT}


def drawn(options: argparse.Namespace) -> list[Flip]:
    """The flips that are to be tried."""
    flips = every_flip()
    if options.only:
        path, _, line = options.only.partition(":")
        flips = [f for f in flips if f.path.startswith(path) and (not line or f.line == int(line))]
    return sample(flips, options.number, options.seed)


def table(rows: list[dict[str, object]]) -> str:
    """How many of which outcome, then every flip that was not caught."""
    counts = {outcome: sum(row["outcome"] == outcome for row in rows) for outcome in OUTCOMES}
    judged = len(rows) - counts[EQUIVALENT]
    lines = [f"{outcome:12} {n:4}" for outcome, n in counts.items()]
    lines.append(f"{'share caught':12} {100.0 * counts[CAUGHT] / judged if judged else 0.0:6.1f} % of {judged}")
    for row in rows:
        if row["outcome"] not in (CAUGHT, EQUIVALENT):
            lines.append(f"{row['outcome']}: {row['path']}:{row['line']}: {row['change']}: {row['text']}")
    return "\n".join(lines) + "\n"


def main() -> int:
    """Try the flips; 0 where enough were caught, 1 where not, 130 where it was interrupted."""
    options = arguments()
    flips, same = drawn(options), equivalents()
    options.folder.mkdir(parents=True, exist_ok=True)
    kept = options.folder / "results.jsonl"
    done = results_so_far(kept, options.again)
    near, waiting, stopped = Nearness(ROOT), Queue[Tree](), Event()
    trees = [Tree(ROOT, options.folder / f"job-{job}") for job in range(options.jobs)]
    for tree in trees:
        waiting.put(tree)

    def attempt(flip: Flip) -> None:
        listed = (flip.path, flip.text, flip.change) in same
        if flip.key in done and (done[flip.key]["outcome"] == CAUGHT or not listed):
            return  # one that was caught is not equivalent, whatever the list says
        tree = waiting.get()
        try:
            row = {"key": flip.key, **Trial(tree, near, options.cap, same).of(flip)}
        finally:
            waiting.put(tree)
        if stopped.is_set():  # its tests were ended, which says nothing of the flip
            return
        done[flip.key] = row
        with kept.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        sys.stdout.write(f"{len(done):4} {row['outcome']:10} {row['seconds']:6.1f} s  {flip.path}:{flip.line}: ")
        sys.stdout.write(f"{flip.change}: {flip.text}\n")
        sys.stdout.flush()

    pool = ThreadPoolExecutor(options.jobs)
    try:
        list(pool.map(attempt, flips))
    except KeyboardInterrupt:
        stopped.set()
        pool.shutdown(wait=False, cancel_futures=True)
        for tree in trees:
            tree.stop()
        pool.shutdown()
        return 130
    rows = [done[flip.key] for flip in flips]
    (options.folder / "report.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    sys.stdout.write(table(rows))
    judged = [row for row in rows if row["outcome"] != EQUIVALENT]
    return 0 if sum(row["outcome"] == CAUGHT for row in judged) >= WANTED * len(judged) else 1


if __name__ == "__main__":
    sys.exit(main())
