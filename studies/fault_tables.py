"""Tables of the study of faults."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from statistics import median

from fault_cases import KINDS, Outcome
from fault_subjects import METHODS, Subject, without_numbers

DEFAULT = "joint"
LONGEST_TEXT = 160


def tables(
    outcomes: Sequence[Outcome], subjects: dict[str, Subject], *, peak: float, seed: int
) -> dict[str, str]:
    """Return every table by its place in the template."""
    return {
        "setting": setting(outcomes, subjects, peak, seed),
        "undamaged": undamaged(subjects),
        "groups": groups([o for o in outcomes if o.method == DEFAULT]),
        "groups, all methods": groups(outcomes),
        "methods": methods(outcomes),
        "silently wrong": wrong(outcomes, "silent"),
        "reported and wrong": wrong(outcomes, "reported"),
        "broken": broken(outcomes),
        "refusals": refusals(outcomes),
        "harmless": harmless(outcomes),
        "harmless and refused": harmless_refused(outcomes),
        "cases": each(outcomes),
    }


def setting(
    outcomes: Sequence[Outcome], subjects: dict[str, Subject], peak: float, seed: int
) -> str:
    cases = {o.case.name for o in outcomes}
    kinds = {f.name for o in outcomes for f, _ in o.case.faults}
    meek = {o.case.name for o in outcomes if o.case.harmless}
    return (
        f"Seed {seed}: {len(cases)} cases of {len(kinds)} kinds of fault, {len(meek)} of the cases "
        f"harmless, in drives of {len(subjects)} subjects, each by {len(METHODS)} methods: "
        f"{len(outcomes)} outcomes. Highest memory of a process {peak / 1e9:.1f} GB."
    )


def undamaged(subjects: dict[str, Subject]) -> str:
    lines = [
        "| subject | true mass kg | drive s | " + " | ".join(f"{m} %" for m in METHODS) + " |",
        "|---" * (len(METHODS) + 3) + "|",
    ]
    for s in subjects.values():
        errors = (
            f"{100.0 * s.error(m):+.1f}" if math.isfinite(s.undamaged[m]) else "none"
            for m in METHODS
        )
        lines.append(
            f"| {s.name} | {s.mean:.0f} | {s.drive.duration:.0f} | " + " | ".join(errors) + " |"
        )
    return "\n".join(lines)


def _counted(rows: dict[str, list[Outcome]], first: str) -> str:
    lines = [f"| {first} | outcomes | " + " | ".join(KINDS) + " |", "|---" * (len(KINDS) + 2) + "|"]
    rows = {**rows, "**all**": [o for part in rows.values() for o in part]}
    for name, part in rows.items():
        count = Counter(o.kind for o in part)
        cells = " | ".join(str(count[kind]) for kind in KINDS)
        lines.append(f"| {name} | {len(part)} | {cells} |")
    return "\n".join(lines)


def _by(outcomes: Iterable[Outcome], key: Callable[[Outcome], str]) -> dict[str, list[Outcome]]:
    found: dict[str, list[Outcome]] = {}
    for o in outcomes:
        found.setdefault(key(o), []).append(o)
    return found


def groups(outcomes: Sequence[Outcome]) -> str:
    return _counted(_by(outcomes, lambda o: o.case.group), "group")


def methods(outcomes: Sequence[Outcome]) -> str:
    return _counted(_by(outcomes, lambda o: o.method), "method")


def _short(text: str) -> str:
    clean = " ".join(text.split()).replace("|", "/")
    return clean if len(clean) <= LONGEST_TEXT else clean[: LONGEST_TEXT - 1] + "…"


def _figures(o: Outcome) -> str:
    return f"{o.method} {100.0 * o.error:+.1f} % ({o.error / o.std:+.1f} std)"


def wrong(outcomes: Sequence[Outcome], kind: str) -> str:
    """List the cases of a kind, the worst first, with all methods in one row."""
    found = _by((o for o in outcomes if o.kind == kind), lambda o: o.case.name)
    if not found:
        return "None."
    lines = ["| fault, severity | vehicle | masses | warning |", "|---|---|---|---|"]
    for part in sorted(found.values(), key=lambda p: -max(abs(o.error) for o in p)):
        case = part[0].case
        warning = next((o.text for o in part if o.text), "")
        figures = ", ".join(_figures(o) for o in part)
        lines.append(f"| {case.damage} | {case.vehicle} | {figures} | {_short(warning)} |")
    return "\n".join(lines)


def broken(outcomes: Sequence[Outcome]) -> str:
    kinds = ("traceback", "hang", "memory")
    found = _by((o for o in outcomes if o.kind in kinds), lambda o: o.case.name)
    if not found:
        return "None."
    lines = ["| fault, severity | vehicle | what | methods | where |", "|---|---|---|---|---|"]
    for part in found.values():
        o = part[0]
        names = "all" if len(part) == len(METHODS) else ", ".join(x.method for x in part)
        lines.append(
            f"| {o.case.damage} | {o.case.vehicle} | {o.kind} | {names} | {_short(o.text)} |"
        )
    return "\n".join(lines)


def refusals(outcomes: Sequence[Outcome]) -> str:
    """Count refusals of the default method by their sentence, numbers left out."""
    refused = [o for o in outcomes if o.kind == "refused" and o.method == DEFAULT]
    if not refused:
        return "None."
    names = {o.case.name: o for o in refused}

    def sentence(o: Outcome) -> str:
        text = o.text.split(": ", 1)[-1] if o.where in ("checks", "reading") else o.text
        return f"{o.where} | {_short(without_numbers(text))}"

    found = _by(names.values(), sentence)
    lines = ["| by | reason | cases | among them |", "|---|---|---|---|"]
    for reason, part in sorted(found.items(), key=lambda item: -len(item[1])):
        some = ", ".join(dict.fromkeys(f.name for o in part for f, _ in o.case.faults))
        lines.append(f"| {reason} | {len(part)} | {_short(some)} |")
    return "\n".join(lines)


def harmless(outcomes: Sequence[Outcome]) -> str:
    """Count for each harmless fault how many were weighed, by the default and by all methods."""
    meek = [o for o in outcomes if o.case.harmless]
    if not meek:
        return "None were run."
    rows = _by(meek, lambda o: o.case.faults[0][0].name)
    rows["**all**"] = meek
    lines = [
        f"| fault | {DEFAULT}: cases | weighed | right | std / undamaged, median "
        "| all methods: outcomes | weighed | right | std / undamaged, median |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, part in rows.items():
        mine = [o for o in part if o.method == DEFAULT]
        cells: list[int | str] = []
        for those in (mine, part):
            weighed = sum(math.isfinite(o.error) for o in those)
            wider = [o.wider for o in those if math.isfinite(o.wider)]
            cells += [len(those), weighed, sum(o.kind == "right" for o in those)]
            cells.append(f"{median(wider):.2f}" if wider else "")
        lines.append(f"| {name} | " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def harmless_refused(outcomes: Sequence[Outcome]) -> str:
    lost = [o for o in outcomes if o.case.harmless and o.kind == "refused"]
    if not lost:
        return "None."
    lines = ["| fault, severity | vehicle | methods | reason |", "|---|---|---|---|"]
    for part in _by(lost, lambda o: o.case.name).values():
        o = part[0]
        names = "all" if len(part) == len(METHODS) else ", ".join(x.method for x in part)
        lines.append(f"| {o.case.damage} | {o.case.vehicle} | {names} | {_short(o.text)} |")
    return "\n".join(lines)


def line(o: Outcome) -> str:
    """Tell of one outcome in a line."""
    figures = _figures(o) if math.isfinite(o.error) else o.method
    text = f": {o.text}" if o.text else ""
    return f"{o.case.name}: {o.kind}, {figures}{text}"


def each(outcomes: Sequence[Outcome]) -> str:
    """Tell of every outcome in a line, for work on a few."""
    return "\n".join(map(line, outcomes))
