"""Tables of studies/recorded.md: recorded drives weighed with data-sheet vehicles.

Run from the checkout: ``python studies/recorded.py``. The recordings lie in
``../shared/data`` and are not part of the project.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import weighbridge as wb

HERE = Path(__file__).parent
DATA = HERE.parents[1] / "shared" / "data"
EXAMPLE = HERE.parent / "examples" / "bmw-i3"


def bmw_i3() -> str:
    car = wb.Vehicle.load(EXAMPLE / "vehicle.toml")
    lines = [
        "| trip | min | used min | mass kg | sd within the trip kg | offset m/s² | delay s |",
        "|---|---|---|---|---|---|---|",
    ]
    masses, spreads = [], []
    scale = car.provenance.mass_scale_std or 0.0
    for path in sorted((DATA / "bmw-i3").glob("Trip*.csv")):
        w = wb.weigh(wb.read_drive(path, EXAMPLE / "mapping.toml"), car)
        if w.status != "converged":
            lines.append(f"| {path.stem} | {w.drive.duration / 60:.1f} | | {w.reason} | | | |")
            continue
        own = float(np.sqrt(max(w.std**2 - (scale * w.mass) ** 2, 0.0)))
        masses.append(w.mass)
        spreads.append(own)
        offset = next(n.split()[2] for n in w.warnings if n.startswith("accelerometer offset"))
        lines.append(
            f"| {path.stem} | {w.drive.duration / 60:.1f} | {w.used_time / 60:.1f} | {w.mass:.0f} "
            f"| {own:.0f} | {offset} | {w.result.balance.force.delay:+.2f} |"
        )
    mass = np.sort(masses)
    third = int(np.ceil(mass.size / 3))
    widths = mass[third - 1 :] - mass[: mass.size - third + 1]
    best = int(np.argmin(widths))
    middle = float(np.median(mass[best : best + third]))
    lines += [
        "",
        f"{mass.size} of 24 trips weighed. Median {np.median(mass):.0f} kg; the shortest interval "
        f"that holds a third of the trips runs from {mass[best]:.0f} to "
        f"{mass[best + third - 1]:.0f} kg, {100 * widths[best] / middle:.1f} % of its median. "
        f"Median standard deviation within a trip {np.median(spreads):.0f} kg.",
    ]
    return "\n".join(lines)


def main() -> None:
    page = (HERE / "recorded.template.md").read_text(encoding="utf-8")
    page = page.replace("<!-- bmw-i3 -->", bmw_i3())
    (HERE / "recorded.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
