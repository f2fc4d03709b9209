"""A part of the corpus: masses, intervals and refusals are those of its table, slice by slice."""

import sys
from pathlib import Path

import polars as pl
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from studies.corpus.pairs import all_pairs, part  # noqa: E402
from studies.corpus.run import SCHEMA, run  # noqa: E402
from studies.corpus.table import compared, judged, read  # noqa: E402

TABLE = ROOT / "studies" / "corpus" / "corpus.csv"


@pytest.mark.timeout(900)
def test_a_part_of_the_corpus_is_weighed_as_before():
    pairs = part("ci")
    assert len(pairs) >= 150
    table = run(pairs, workers=1)
    assert compared(read(TABLE), table) == []
    right = judged(table).filter(pl.col("verdict") == "right")
    assert right.height > 100


def test_the_table_has_every_pair_once():
    table = read(TABLE)
    ids = [p.id for p in all_pairs()]
    assert len(set(ids)) == len(ids)
    assert table.filter(pl.col("id").is_in(ids))["id"].to_list() == ids


def row(id, mass, std=20.0, true=1000.0, ids="", **more):
    given = {
        "id": id, "slice": "s", "sound": True, "reference": "", "true_kg": true, "mass_kg": mass,
        "std_kg": std, "status": "converged" if mass else "inconsistent", "problem_ids": ids,
    }  # fmt: skip
    return {**given, **more}


def table(*rows):
    return pl.DataFrame(rows, schema=SCHEMA)


BEFORE = table(*(row(f"{k}", 1000.0 + 10.0 * (-1) ** k) for k in range(10)))


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        (row("3", 1200.0), "silently wrong"),
        (row("3", None, None), "wrongly refused"),
        (row("3", 1045.0), "RMS"),
        (row("3", 990.0, std=4.0), "hold"),
        (row("3", None, None, status="traceback"), "tracebacks"),
    ],
)
def test_what_became_worse_is_named(changed, why):
    after = pl.concat([BEFORE.filter(pl.col("id") != "3"), table(changed)])
    assert any(why in sentence for sentence in compared(BEFORE, after))
    assert compared(BEFORE, BEFORE) == []


def test_a_wrong_mass_is_silent_unless_something_new_is_reported():
    fault = {"sound": False, "reference": "plain"}
    found = judged(
        table(
            row("plain", 1000.0, ids="motion.level"),
            row("a", 1200.0, ids="motion.level", **fault),
            row("b", 1200.0, ids="gear.scale motion.level", **fault),
            row("c", 1200.0, std=90.0, **fault),
            row("d", None, None, **fault),
        )
    )
    assert found["verdict"].to_list() == [
        "right", "silently wrong", "wrong, reported", "right", "refused",
    ]  # fmt: skip
