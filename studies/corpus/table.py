"""The table of the corpus, and what a change did to it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import polars as pl
from studies.corpus.run import SCHEMA

FAR: Final = 0.03
FAR_STD: Final = 3.0
"""A mass is wrong beyond both, in parts of it and in standard deviations."""

RMS_GROWTH: Final = 1.02
COVERAGE_LOSS: Final = 0.01
"""What a change may cost a slice."""


def read(path: Path) -> pl.DataFrame:
    """Read a table."""
    return pl.read_csv(path, schema={**SCHEMA, "verdict": pl.String}).drop("verdict")


def write(table: pl.DataFrame, path: Path) -> None:
    """Write a table with its verdicts; what is silently wrong or wrongly refused is marked so."""
    judged(table).select(*SCHEMA, "verdict").write_csv(path)


def judged(table: pl.DataFrame) -> pl.DataFrame:
    """Add errors, whether the interval of 95 % holds, and a verdict."""
    ids = dict(table.select("id", "problem_ids").iter_rows())
    fresh = [
        bool(set((own or "").split()) - set((ids.get(reference) or "").split()))
        for own, reference in table.select("problem_ids", "reference").iter_rows()
    ]
    error = pl.col("mass_kg") / pl.col("true_kg") - 1.0
    std = pl.col("std_kg") / pl.col("true_kg")
    table = table.with_columns(
        error=error, scaled=error / std, reported=pl.Series(fresh, dtype=pl.Boolean)
    )
    wrong = (pl.col("error").abs() > FAR) & (pl.col("scaled").abs() > FAR_STD)
    silent = wrong & (~pl.col("reported") | pl.col("sound"))
    return table.with_columns(
        holds=pl.col("scaled").abs() < 1.96,
        verdict=pl.when(pl.col("status") == "traceback").then(pl.lit("broken"))
        .when(silent.fill_null(value=False)).then(pl.lit("silently wrong"))
        .when(wrong.fill_null(value=False)).then(pl.lit("wrong, reported"))
        .when(pl.col("mass_kg").is_null() & pl.col("sound")).then(pl.lit("wrongly refused"))
        .when(pl.col("mass_kg").is_null()).then(pl.lit("refused"))
        .otherwise(pl.lit("right")),
    )  # fmt: skip


def _slices(table: pl.DataFrame, both: pl.DataFrame) -> pl.DataFrame:
    """Return one row a slice: RMS and coverage over masses that both tables have, and counts."""
    rows = judged(table)
    of_both = pl.col("id").is_in(both["id"].to_list())
    return rows.group_by("slice", maintain_order=True).agg(
        pairs=pl.len(),
        weighed=pl.col("mass_kg").is_not_null().sum(),
        rms=100.0 * pl.col("error").filter(of_both).pow(2).mean().sqrt(),
        coverage=pl.col("holds").filter(of_both).mean(),
        scaled=pl.col("scaled").filter(of_both).pow(2).mean(),
        silent=(pl.col("verdict") == "silently wrong").sum(),
        refused=(pl.col("verdict") == "wrongly refused").sum(),
        broken=(pl.col("verdict") == "broken").sum(),
    )


def _beside(before: pl.DataFrame, after: pl.DataFrame) -> pl.DataFrame:
    """Return slices of pairs that are in both tables, before and after; the latter alone if new."""
    known = before.join(after.select("id"), on="id", how="semi")
    held = known.join(
        after.filter(pl.col("mass_kg").is_not_null()).select("id"), on="id", how="semi"
    ).filter(pl.col("mass_kg").is_not_null())
    was, now = _slices(known, held), _slices(after, held if held.height else after)
    return now.join(was, on="slice", how="left", suffix="_before", maintain_order="left")


def compared(before: pl.DataFrame, after: pl.DataFrame) -> list[str]:
    """Say what became worse, a sentence each; nothing where the change is accepted."""
    found = []
    for s in _beside(before, after).iter_rows(named=True):
        if s["pairs_before"] is None:
            continue
        name = s["slice"]
        if s["rms"] is not None and s["rms"] > RMS_GROWTH * s["rms_before"] + 5e-3:
            found.append(f"{name}: RMS {s['rms_before']:.2f} to {s['rms']:.2f} %")
        if s["coverage"] is not None and s["coverage"] < s["coverage_before"] - COVERAGE_LOSS:
            found.append(
                f"{name}: intervals hold {s['coverage_before']:.1%} to {s['coverage']:.1%}"
            )
        for count, word in (
            ("silent", "silently wrong"), ("refused", "wrongly refused"), ("broken", "tracebacks"),
        ):  # fmt: skip
            if s[count] > s[f"{count}_before"]:
                found.append(f"{name}: {word} {s[f'{count}_before']} to {s[count]}")
    verdicts = (
        judged(before)
        .select("id", "verdict")
        .join(judged(after).select("id", "verdict"), on="id", suffix="_after")
    )
    bad = ["silently wrong", "wrongly refused", "broken"]
    new = verdicts.filter(
        pl.col("verdict_after").is_in(bad) & (pl.col("verdict") != pl.col("verdict_after"))
    )
    if found:
        found += [f"{a} is now {c}, was {b}" for a, b, c in new.iter_rows()]
    return found


def summary(before: pl.DataFrame, after: pl.DataFrame) -> str:
    """Return a table of the slices, before and after."""

    def both(s: dict[str, object], name: str, form: str) -> str:
        values = [s[f"{name}_before"], s[name]]
        shown = ["–" if v is None or v != v else format(v, form) for v in values]
        return shown[1] if shown[0] == shown[1] else " → ".join(shown)

    lines = [
        "| slice | pairs | weighed | RMS % | hold | (error/std)² | silent | wrongly refused |",
        "|---|---|---|---|---|---|---|---|",
    ]
    beside = _beside(before, after)
    for s in beside.iter_rows(named=True):
        lines.append(
            f"| {s['slice']} | {s['pairs']} | {both(s, 'weighed', 'd')} | {both(s, 'rms', '.2f')} "
            f"| {both(s, 'coverage', '.0%')} | {both(s, 'scaled', '.2f')} "
            f"| {both(s, 'silent', 'd')} | {both(s, 'refused', 'd')} |"
        )
    total = {name: beside[name].sum() for name in ("pairs", "weighed", "silent", "refused")}
    lines.append(
        f"| all | {total['pairs']} | {total['weighed']} | | | | {total['silent']} "
        f"| {total['refused']} |"
    )
    assert all(math.isfinite(v) for v in total.values())
    return "\n".join(lines)
