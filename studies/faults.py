"""Is any mass silently wrong? Some 800 faults in simulated drives of known mass, by every method.

Run from the checkout: ``python studies/faults.py``, which writes ``faults.md``; ``--quick`` does
one severity and vehicle of each fault, ``--group NAME`` and ``--case NAME`` those alone, ``--list``
names them, ``--seed 8200`` takes other vehicles and drives. Only the whole run with the seed of
the study writes the page; the others print.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from accuracy_drives import compile_all
from fault_cases import Case, Outcome, all_cases, pairs, run_case, subset
from fault_subjects import METHODS, Subject, build_all
from fault_tables import DEFAULT, line, tables
from fault_workers import Done, done_apart

HERE = Path(__file__).parent
SEED = 9470
PAIRS = 60
QUICK_PAIRS = 8


def chosen(given: argparse.Namespace) -> list[Case]:
    """Return the cases asked for."""
    cases = all_cases()
    drawn = pairs(QUICK_PAIRS if given.quick else PAIRS, given.seed)
    if given.quick:
        cases = subset(cases, given.seed)
    cases += drawn
    if given.group:
        cases = [c for c in cases if given.group.lower() in c.group.lower()]
    if given.case:
        cases = [c for c in cases if c.name.startswith(given.case)]
    return cases


def outcomes_of(case: Case, done: Done) -> list[Outcome]:
    """Return what came of a case, stopped ones included."""
    if not done.stopped:
        return list(done.result)
    kind = "traceback" if done.stopped == "died" else done.stopped
    text = done.failure or f"stopped after {done.seconds:.0f} s at {done.peak / 1e9:.1f} GB"
    return [Outcome(case, m, kind, text=text) for m in METHODS]


def run_all(
    cases: Sequence[Case], subjects: dict[str, Subject], seed: int
) -> tuple[list[Outcome], float, bool]:
    """Do all cases, in an order drawn by the seed; an interrupt ends it with what there is.

    Returns
    -------
    outcomes : in the order of the cases
    peak : highest memory of a process [B]
    whole : all cases were done
    """
    found: dict[str, list[Outcome]] = {}
    peak, begun = 0.0, time.monotonic()
    order = np.random.default_rng([seed, 4]).permutation(len(cases))
    work = [(cases[k], subjects[cases[k].vehicle]) for k in order]
    try:
        for (case, _), done in done_apart(lambda job: run_case(*job), work):
            if done.failure and not done.stopped:
                print(f"{case.name} cannot be put in: {done.failure}", file=sys.stderr)
                continue
            found[case.name] = outcomes_of(case, done)
            peak = max(peak, done.peak)
            for o in found[case.name]:
                if o.method == DEFAULT and o.kind not in ("right", "refused"):
                    print(line(o), file=sys.stderr)
            if len(found) % 50 == 0:
                spent = time.monotonic() - begun
                print(f"{len(found)} of {len(cases)} cases, {spent:.0f} s", file=sys.stderr)
    except KeyboardInterrupt:
        print(f"interrupted after {len(found)} of {len(cases)} cases", file=sys.stderr)
    whole = all(case.name in found for case in cases)
    return [o for case in cases for o in found.get(case.name, [])], peak, whole


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one case of each fault")
    parser.add_argument("--group", help="faults of groups whose name holds this")
    parser.add_argument("--case", help="cases whose name begins so")
    parser.add_argument("--list", action="store_true", help="name the cases and end")
    parser.add_argument("--seed", type=int, default=SEED, help="of vehicles, drives and pairs")
    given = parser.parse_args()
    cases = chosen(given)
    if given.list:
        print("\n".join(f"{c.group}: {c.name}" for c in cases))
        return
    if not cases:
        parser.error("no case is of that name; --list names them")
    compile_all()
    subjects = build_all(sorted({c.vehicle for c in cases}), given.seed)
    outcomes, peak, whole = run_all(cases, subjects, given.seed)
    texts = tables(outcomes, subjects, peak=peak, seed=given.seed)
    if given.case or given.group:
        texts = {"cases": texts.pop("cases"), **texts}
    else:
        texts.pop("cases")
    for name, text in texts.items():
        print(f"{name}\n\n{text}\n", flush=True)
    if not whole:
        sys.exit("not all faults were put in; no page is written")
    if given.seed == SEED and not (given.quick or given.group or given.case):
        page = (HERE / "faults.template.md").read_text(encoding="utf-8")
        for name, text in texts.items():
            page = page.replace(f"<!-- {name} -->", text)
        (HERE / "faults.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
