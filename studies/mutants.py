"""Plant one fault of one line in each of some rooms, and see whether the tests notice.

``python -m studies.mutants`` works in a copy of the checkout and writes `studies/mutants.md`.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
REPORT = ROOT / "studies" / "mutants.md"
PARTS = ("src", "tests", "docs", "examples", "studies", "website", "pyproject.toml", "README.md")
HEAD = """# Planted faults

Each row is a fault of one line, planted in a copy of the code. The test on its right failed.
`python -m studies.mutants` plants them again and writes this page.

| room | fault | kind | caught by |
|---|---|---|---|
"""


class Mutant(NamedTuple):
    """A line of a module, what it becomes, and the tests that should notice."""

    path: str
    line: str
    planted: str
    kind: str
    tests: tuple[str, ...]


MUTANTS = (
    Mutant(
        "signals/units.py",
        '"mph": Unit("m/s", 0.44704)',
        '"mph": Unit("m/s", 1.0 / 3.6)',
        "a unit",
        ("tests/unit/test_io.py", "tests/unit/test_vbo.py", "tests/unit/test_mapping.py"),
    ),
    Mutant(
        "io/vbo.py",
        "_MINUTES: Final = (1.0 / 60.0, -1.0 / 60.0)",
        "_MINUTES: Final = (1.0 / 60.0, 1.0 / 60.0)",
        "a sign",
        ("tests/unit/test_vbo.py", "tests/golden/test_position_logs.py"),
    ),
    Mutant(
        "vehicle/fuel.py",
        "span * np.maximum(0.5 * (flow[1:] + flow[:-1]), 0.0)",
        "span * np.maximum(0.5 * (flow[1:] - flow[:-1]), 0.0)",
        "a sign",
        ("tests/unit/test_fuel.py",),
    ),
    Mutant(
        "navigation/layout.py",
        "force = bridged(time, accel + GRAVITY * np.sin(grade))",
        "force = bridged(time, accel - GRAVITY * np.sin(grade))",
        "a sign",
        ("tests/unit/test_navigation.py",),
    ),
    Mutant(
        "balance/law.py",
        "table.specific_force + GRAVITY * rolling * np.cos(table.grade)",
        "table.specific_force - GRAVITY * rolling * np.cos(table.grade)",
        "a sign",
        ("tests/truth/test_law.py",),
    ),
    Mutant(
        "inertia/filter.py",
        "reach = float(ndtri(0.5 + 0.5 * level)) * alpha_std",
        "reach = 0.5 * float(ndtri(0.5 + 0.5 * level)) * alpha_std",
        "an interval halved",
        ("tests/unit/test_inertia.py", "tests/consistency/test_inertia_consistency.py"),
    ),
    Mutant(
        "calibration/known_mass.py",
        "left = np.array(masses) - np.array(",
        "left = np.array(masses) + np.array(",
        "a sign",
        ("tests/unit/test_doubted_masses.py",),
    ),
    Mutant(
        "simulation/sensing.py",
        "accel_n[2] -= GRAVITY",
        "accel_n[2] += GRAVITY",
        "a sign",
        ("tests/truth/test_simulation_truth.py",),
    ),
    Mutant(
        "checks/steps.py",
        "return resolution(values) if values.size >= FEWEST else 0.0",
        "return 2.0 * resolution(values) if values.size >= FEWEST else 0.0",
        "a factor",
        ("tests/unit/test_steps.py",),
    ),
    Mutant(
        "results/weighing.py",
        "return self.mass - self.vehicle.tare if self.vehicle.tare is not None else math.nan",
        "return self.mass if self.vehicle.tare is not None else math.nan",
        "a term left out",
        ("tests/unit/test_weighing.py",),
    ),
    Mutant(
        "live/weighing.py",
        "half = float(ndtri(0.5 * (1.0 + level))) * self.std",
        "half = 0.5 * float(ndtri(0.5 * (1.0 + level))) * self.std",
        "an interval halved",
        ("tests/live/test_alerts.py",),
    ),
    Mutant(
        "fleet/facts.py",
        "return np.asarray(found[found[:, 1] - found[:, 0] >= SHORTEST])",
        "return np.asarray(found[found[:, 1] - found[:, 0] >= SHORTEST][1:])",
        "a row dropped",
        ("tests/fleet/test_travel.py",),
    ),
    Mutant(
        "kernels/rts.py",
        "mean[i, a] -= covs[i, a, b] * adjoint[b]",
        "mean[i, a] += covs[i, a, b] * adjoint[b]",
        "a sign",
        ("tests/truth/test_rts.py",),
    ),
    Mutant(
        "report/calibration_panels.py",
        'minutes = from_si(calibration.rows.time, "min")',
        'minutes = from_si(calibration.rows.time, "s")',
        "a unit",
        ("tests/unit/test_report_figures.py",),
    ),
    Mutant(
        "report/thinning.py",
        "breaks = np.flatnonzero(np.diff(missing[index])) + 1",
        "breaks = np.flatnonzero(np.diff(missing[index])) - 1",
        "a gap in the wrong place",
        ("tests/unit/test_report_figures.py",),
    ),
    Mutant(
        "report/residual_section.py",
        "SMALLEST * x.size)",
        "SMALLEST / x.size)",
        "a limit",
        ("tests/unit/test_report_sections.py",),
    ),
    Mutant(
        "report/maps.py",
        "south = float(np.min(track.north)) - 0.12",
        "south = float(np.min(track.north)) + 0.12",
        "a sign",
        ("tests/unit/test_report_figures.py",),
    ),
    Mutant(
        "report/information_section.py",
        "np.log10(0.8 * low)",
        "np.log10(1.8 * low)",
        "a factor",
        ("tests/unit/test_report_sections.py",),
    ),
    Mutant(
        "balance/floor.py",
        "return replace(self, level=self.level + least) if least > DRIFT * self.span else self",
        "return self",
        "a step left out",
        ("tests/unit/test_foot.py",),
    ),
    Mutant(
        "balance/speed_balance.py",
        "count = int((motion.time[-1] - motion.time[0] + 1.0 / motion.rate) / length + 1e-9)",
        "count = int((motion.time[-1] - motion.time[0] - 1.0 / motion.rate) / length + 1e-9)",
        "a row dropped",
        ("tests/unit/test_speed_ekf.py",),
    ),
    Mutant(
        "estimators/speed_ekf.py",
        "spread = np.array([np.std(part) for part in parts])",
        "spread = np.array([np.ptp(part) for part in parts])",
        "another spread",
        ("tests/unit/test_speed_ekf.py",),
    ),
    Mutant(
        "estimators/speed_ekf.py",
        "return (ends[1] - ends[0]) / (starts[1] - starts[0])",
        "return (ends[1] - ends[0]) * (starts[1] - starts[0])",
        "a unit",
        ("tests/unit/test_speed_ekf.py",),
    ),
)


def caught_by(copy: Path, mutant: Mutant) -> str:
    """Plant a fault, run its tests and take it out; return the first test that failed."""
    path = copy / "src" / "weighbridge" / mutant.path
    whole = path.read_text(encoding="utf-8")
    if whole.count(mutant.line) != 1:
        raise SystemExit(f"{mutant.path}: {mutant.line!r} is not there once; correct the list")
    path.write_text(whole.replace(mutant.line, mutant.planted), encoding="utf-8")
    words = (sys.executable, "-m", "pytest", "-n", "0", "-x", "-rfE", *mutant.tests)
    ran = subprocess.run(
        words,
        cwd=copy,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(copy / "src")},
    )
    path.write_text(whole, encoding="utf-8")
    found = re.search(r"^(?:FAILED|ERROR) (\S+)", ran.stdout, re.MULTILINE)
    return found[1].removeprefix("tests/") if found and ran.returncode == 1 else ""


def main() -> None:
    """Write the page; exit with 1 where a fault was not caught."""
    rows, missed = [], 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "checkout"
        copy.mkdir()
        for name in PARTS:
            source = ROOT / name
            if source.is_dir():
                shutil.copytree(source, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(source, copy / name)
        for mutant in MUTANTS:
            test = caught_by(copy, mutant)
            missed += not test
            room = mutant.path.partition("/")[0]
            fault = f"`{mutant.line}` becomes `{mutant.planted}`".replace("|", "\\|")
            rows.append(f"| {room} | {fault} | {mutant.kind} | {test or '**nothing**'} |\n")
            print(rows[-1], end="", flush=True)
    REPORT.write_text(HEAD + "".join(rows), encoding="utf-8")
    raise SystemExit(missed > 0)


if __name__ == "__main__":
    main()
