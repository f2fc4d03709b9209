"""Weigh the corpus, compare with the committed table, or rewrite it."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import polars as pl
from accuracy_drives import compile_all
from studies.corpus.pairs import all_pairs, part, unavailable
from studies.corpus.run import run
from studies.corpus.table import compared, read, summary, write

TABLE: Final = Path(__file__).parent / "corpus.csv"


def main(arguments: Sequence[str] | None = None) -> int:
    """Return 0, or 1 where `--check` finds the corpus worse than its table."""
    parser = argparse.ArgumentParser(prog="python -m studies.corpus", description=__doc__)
    parser.add_argument("--slice", choices=("all", "ci", "quick"), default="all", help="how many")
    parser.add_argument("--only", default="", help="pairs whose id or slice holds this text")
    parser.add_argument("--check", action="store_true", help="compare with the committed table")
    parser.add_argument("--accept", action="store_true", help="rewrite the committed table")
    parser.add_argument("--output", type=Path, help="write the table here too")
    given = parser.parse_args(arguments)
    pairs = [p for p in part(given.slice) if given.only in p.id or given.only in p.slice]
    left_out = {why for p in pairs if (why := unavailable(p))}
    pairs = [p for p in pairs if not unavailable(p)]
    for why in sorted(left_out):
        print(f"left out: {why}", file=sys.stderr)
    begun = time.monotonic()
    compile_all()
    table = run(pairs)
    print(f"{table.height} pairs in {time.monotonic() - begun:.0f} s", file=sys.stderr)
    if given.output is not None:
        write(table, given.output)
    before = read(TABLE) if TABLE.exists() else table.clear()
    worse = compared(before, table)
    print(summary(before, table))
    if given.accept:
        kept = before.join(table.select("id"), on="id", how="anti")
        order = {p.id: k for k, p in enumerate(all_pairs())}
        merged = pl.concat([kept.filter(pl.col("id").is_in(list(order))), table])
        write(merged.sort(pl.col("id").replace_strict(order, return_dtype=pl.Int64)), TABLE)
    for sentence in worse:
        print(f"worse: {sentence}")
    return 1 if given.check and worse else 0


if __name__ == "__main__":
    sys.exit(main())
