"""Figures of accuracy on the pages are those that the programs of the studies found."""

import re
import tomllib
from pathlib import Path

import polars as pl
import pytest

HOME = Path(__file__).parents[2]
NUMBER = re.compile(r"\d+(?:\.\d+)?")
CLAIMS = [
    (page, claim)
    for page, claims in tomllib.loads(
        (HOME / "tests/docs/figures.toml").read_text(encoding="utf-8")
    ).items()
    for claim in claims
]


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip())[1:-1]]


def cell_of(page: str, row: str, column: str) -> str:
    """Return the first cell under the head of a column in a row of that name."""
    heads: list[str] = []
    for line, after in zip(page.splitlines(), [*page.splitlines()[1:], ""], strict=True):
        if line.startswith("|") and after.startswith("|--"):
            heads = cells(line)
        elif line.startswith("|") and cells(line)[0] == row and column in heads:
            return cells(line)[heads.index(column)]
    raise AssertionError(f"no cell {column!r} of {row!r}")


def of_corpus(slice_: str) -> float:
    """Return the RMS error of a slice of the corpus [%]."""
    table = pl.read_csv(HOME / "studies/corpus/corpus.csv", infer_schema_length=None)
    error = table.filter(pl.col("slice") == slice_).select(
        100.0 * (pl.col("mass_kg") / pl.col("true_kg") - 1.0)
    )
    return float((error.to_series().drop_nulls() ** 2).mean() ** 0.5)


def measured(source: str) -> float:
    """Return the figure at a place of a study's page."""
    if source.startswith("corpus |"):
        return of_corpus(source.partition("|")[2].strip())
    study, _, pattern = source.partition(" ~ ")
    if pattern:
        page = (HOME / f"studies/{study}.md").read_text(encoding="utf-8")
        found = re.search(pattern, page)
        assert found, source
        return float(found[1])
    study, row, column = (part.strip() for part in source.split(" | "))
    column, _, second = column.partition("[")
    cell = cell_of((HOME / f"studies/{study}.md").read_text(encoding="utf-8"), row, column)
    return float(NUMBER.findall(cell)[1 if second else 0])


@pytest.mark.parametrize(("page", "claim"), CLAIMS, ids=[c["text"][:40] for _, c in CLAIMS])
def test_a_figure_is_that_of_its_study(page, claim):
    assert claim["text"] in (HOME / page).read_text(encoding="utf-8")
    numbers = NUMBER.findall(claim["text"])
    assert len(numbers) == len(claim["of"])
    for number, sources in zip(numbers, claim["of"], strict=True):
        half = 0.5 * 10.0 ** -len(number.partition(".")[2])
        for source in [sources] if isinstance(sources, str) else sources:
            if source:
                found = sum(measured(part) for part in source.split(" + "))
                assert abs(found - float(number)) <= half + 1e-9, (number, source, found)


@pytest.mark.parametrize("page", ["README.md", "docs/accuracy.md"])
def test_no_figure_of_accuracy_is_without_a_study(page):
    text = (HOME / page).read_text(encoding="utf-8")
    for where, claim in CLAIMS:
        if where == page:
            text = text.replace(claim["text"], "|")
    left, counts = [], False
    for line in text.splitlines():
        if line.startswith("|") and not line.startswith("|--"):
            left += re.findall(r"[\d.–]+ %", line) if counts else []
            counts = counts or "error of" in line
        elif not line.startswith("|"):
            counts = False
    assert left == []
