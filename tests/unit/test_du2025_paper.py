"""The experiment of Du 2025: one drive of it, its tables and its page."""

from dataclasses import replace

import numpy as np
import pytest

from weighbridge.papers import du2025
from weighbridge.papers.reproduced import Reproduced

SEED = 3


@pytest.fixture(scope="module")
def judged() -> du2025.DriveResult:
    made = du2025.simulate(3000.0, SEED, as_paper=True)
    assert not made.drive.has("latitude")
    return du2025.judge("half-load", made, du2025.known_bus())


def test_all_methods_are_better_than_the_papers_at_half_load(judged):
    assert judged.true_mass == pytest.approx(10_000.0, abs=1.0)
    for method, theirs in zip(du2025.METHODS, du2025.PAPER_RMSE["half-load"], strict=True):
        assert judged.late_rmse[method] < theirs
        assert judged.worst[method] < du2025.BAND
        track = judged.tracks[method]
        late = track.time >= 24.0
        error = track.running_mass[late] - judged.true_mass
        assert judged.late_rmse[method] == pytest.approx(np.sqrt(np.mean(error**2)), rel=0.05)


def test_the_data_sheet_is_that_of_table_1():
    bus = du2025.data_sheet()
    assert bus.driveline.gearings[4] * bus.driveline.wheel_radius == pytest.approx(3.545)
    assert bus.road_load.drag_area == pytest.approx(0.69 * 7.9)
    assert (bus.tare, bus.gross, bus.driveline.efficiency) == (7000.0, 13_000.0, 0.95)


def test_tables_and_page_name_what_falls_behind(judged, tmp_path, monkeypatch):
    drives = tuple(replace(judged, load=load) for load in du2025.LOADS)
    poor = replace(judged, load="no-load", late_rmse=dict.fromkeys(du2025.METHODS, 5000.0))
    known = du2025.known_bus()
    vehicle = replace(known, torque=known.torque.scaled(1.0))
    vehicle = replace(vehicle, torque=replace(vehicle.torque, coefficients=(-80.0, 0.95)))

    def run(first: du2025.DriveResult) -> Reproduced:
        made = du2025.Reproduction(
            drives=(first, *drives[1:]), road=drives, sheet=drives, vehicle=vehicle
        )
        monkeypatch.setattr(du2025, "reproduce", lambda **_: made)
        return du2025.reproduced(777, None)

    assert not any(name.startswith("RMSE") for name in run(drives[0]).behind)
    done = run(poor)
    assert "RMSE, no-load, hybrid" in done.behind
    assert "RMSE, half-load, hybrid" not in done.behind
    page = tmp_path / "page.html"
    done.write_report(page)
    text = page.read_text(encoding="utf-8")
    assert text.index("RMSE, no-load, hybrid") < text.index("Table 2 as in the paper")
    assert ">behind<" in text
    for title in ("Fig. 4: h(v)", "Fig. 5a", "Fig. 5d", "Fig. 6", "Fig. 7", "With all effects"):
        assert title in text
