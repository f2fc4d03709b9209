"""The reproduction of Galvão: figures beside the paper's, and what they are worth."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.noted import error

from weighbridge import ConfigError
from weighbridge.constants import GRAVITY
from weighbridge.estimators import changed, parsed
from weighbridge.papers import PAPERS, galvao
from weighbridge.papers.galvao import PAPER_WORST, item_figures
from weighbridge.papers.galvao_bounds import (
    FAST,
    SLOW,
    STEP,
    coasting_speed,
    speed_says,
    speed_table,
)
from weighbridge.simulation import COMPACT

DRIVES = import_module(galvao.easy_route.__module__)
PAPERS_DURATION = DRIVES.DURATION
BRIEF = 600.0
"""Of a drive of these tests [s]."""


@pytest.fixture(scope="module", autouse=True)
def brief():
    """Half the paper's time is enough to see what its drives show."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(DRIVES, "DURATION", BRIEF)
        yield


@pytest.fixture(scope="module")
def three(brief):
    return galvao.weigh_three(1234)


@pytest.fixture(scope="module")
def done(three, trial):
    fitted, drives, tests = three
    masses = np.linspace(1092.0, 1492.0, 9)
    weighed = type(next(iter(trial.ways.values())))
    std30, std40 = np.full(5, 30.0), np.full(5, 40.0)
    wild = 1000.0 + 700.0 * np.sin(np.arange(9.0))
    masses_apart = galvao.Trial(
        kind="other masses", masses=masses, answers=np.full(9, 1092.0), pinned=wild
    )
    return galvao.Reproduction(
        vehicle=fitted.vehicle,
        r_squared=fitted.fit.r_squared,
        tests=tests,
        starts=((800.0, 800.4, 810.0), (2000.0, 1999.0, 1900.0)),
        stated=((900.0, 900.1, 0.5),),
        trials=(masses_apart, masses_apart),
        torque=replace(
            trial,
            masses=np.array([1092.0, 1092.0, 1092.0, 1292.0, 1492.0]),
            ways=dict(
                zip(
                    trial.ways,
                    (
                        weighed(np.array([1092.0, 1081.08, 1102.92, 1292.0, np.nan]), std30),
                        weighed(np.array([1092.0, 982.8, 982.8, 1292.0, 1492.0]), std40),
                        weighed(np.array([1092.0, 1092.0, 1092.0, 1192.0, 1292.0]), std40),
                    ),
                    strict=True,
                )
            ),
        ),
        says=speed_says(drives, 1234),
    )


def test_the_paper_is_known_to_reproduce():
    assert PAPERS["galvao"] == galvao.__name__
    assert PAPERS_DURATION == 1200.0


def test_the_road_is_easy_and_the_drives_are_as_long_as_the_papers(three):
    _, drives, tests = three
    for made, test in zip(drives, tests, strict=True):
        assert set(made.drive.signals) == {"vehicle_speed"}
        assert made.drive.duration == pytest.approx(BRIEF, abs=15.0)
        assert np.std(made.truth.grade) < 0.01
        assert test.mass == pytest.approx(1092.0, abs=2.0)
        assert np.count_nonzero(test.ours.used) > 0.58 * BRIEF / 7.0


def test_same_mass_is_met_from_its_own_start_and_not_from_the_printed_one(three):
    for test in three[2]:
        assert abs(test.error(test.ours)) <= PAPER_WORST
        assert test.band(test.ours) <= 100.0
        assert abs(test.error(test.printed)) > 0.1


def test_a_setting_of_the_printed_filter_moves_it_alone(three):
    settings = changed(galvao.Settings(), {"printed.process_var": [0.1, 1e-8, 0.005]})
    assert settings.ours == galvao.Settings().ours
    for usual in three[2]:
        other = galvao.run_filter(usual.balance, three[0].vehicle, settings.printed)
        assert abs(usual.printed.mass[-1] - other.mass[-1]) > 10.0

    given = {
        "sampling.sample_time": 10.0,
        "model.drag": 0.5,
        "printed.groups": 1,
        "printed.tail": 1.0,
    }
    settings = changed(galvao.Settings(), given)
    fitted = settings.fitted(three[1][0])
    assert fitted.vehicle.speed_model.sample_time == 10.0
    assert fitted.vehicle.speed_model.drag == 0.5
    other = changed(galvao.Settings(), {"printed.groups": 1, "printed.tail": 1.0})
    run = galvao.run_filter(three[2][1].balance, three[0].vehicle, other.printed)
    # One group of all samples: nothing is left out.
    assert run.answer == pytest.approx(np.mean(run.mass[run.used]))
    assert run.answer != three[2][1].printed.answer
    limits = {"sampling.averaged": 0.0, "sampling.slowest": 8.0, "sampling.hardest": 0.2}
    model = changed(galvao.Settings(), limits).fitted(three[1][0]).vehicle.speed_model
    assert (model.averaged, model.slowest, model.hardest) == (0.0, 8.0, 0.2)
    with error(ConfigError, "sample_time [1 60] 0.5"):
        changed(galvao.Settings(), {"sampling.sample_time": 0.5})


def rows_of(done):
    found = item_figures(done)
    return {(i.item, i.what): i.row("galvao", found) for i in galvao.ITEMS}


def test_what_differs_has_its_reason(done):
    rows = rows_of(done)
    printed = rows["table 1", "mean mass, start and noise as printed"]
    assert (printed.verdict, printed.accounted) == ("differs", True)
    assert rows["table 1", "mean mass"].verdict == "agrees"
    for number in (1, 2, 3):
        speed = rows[f"fig. {6 + number}", f"model speed of Test 0{number}, one step ahead"]
        assert speed.verdict == "differs"
        known = np.isfinite(done.tests[number - 1].predicted)
        off = (done.tests[number - 1].rows.speed - done.tests[number - 1].predicted)[known]
        assert speed.ours.startswith(f"off by {np.sqrt(np.mean(off**2)):.2f} m/s")
    off = done.tests[0]
    moved = replace(off, mass=1.01 * off.mass)
    worse = rows_of(replace(done, tests=(moved, *done.tests[1:])))["table 1", "mean mass"]
    # Nothing excuses ours.
    assert (worse.verdict, worse.accounted) == ("differs", False)


def test_started_at_the_mass_the_printed_filter_gives_it_back(three):
    """The command of the rows that differ shows their reason."""
    (check,) = {i.check for i in galvao.ITEMS if i.item in ("fig. 10", "fig. 15")}
    settings = changed(galvao.Settings(), parsed(check.split()[4::2]))
    for test in three[2]:
        run = galvao.run_filter(test.balance, three[0].vehicle, settings.printed)
        assert abs(test.error(run)) < 0.1


def test_tables_have_a_text_for_every_column(done):
    tables = [made(done) for made in (galvao.tests_table, galvao.starts_table, galvao.trials_table)]
    for table in (*tables, galvao.torque_table(done.torque)):
        assert all(len(row) == len(table.columns) for row in table.rows)


def test_report_has_the_papers_nine_figures(done):
    titles = [panel.title for test in done.tests for panel in galvao._panels(test)]
    for number in range(7, 16):
        assert sum(f"(fig. {number})" in title for title in titles) == 1


def test_page_begins_with_the_papers_figures(done, tmp_path, monkeypatch):
    monkeypatch.setattr(galvao, "reproduce", lambda **_: done)
    page = tmp_path / "page.html"
    galvao.reproduced(1234, None).write_report(page)
    text = page.read_text(encoding="utf-8")
    assert text.index("start and noise as printed") < text.index("ours started at the calibration")


@pytest.fixture(scope="module")
def trial(brief):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(f"{galvao.torque_trial.__module__}.LOADS", (0.0, 200.0, 400.0))
        patch.setattr(DRIVES, "DURATION", 400.0)
        return galvao.torque_trial(1234, galvao.easy_route(1234))


def test_recorded_torque_weighs_the_load_where_speed_alone_does_not(trial):
    by_map, *_ = trial.ways
    assert np.max(np.abs(trial.errors(by_map))) < 0.05
    gain = np.polyfit(trial.masses, trial.ways[by_map].mass, 1)[0]
    assert gain == pytest.approx(1.0, abs=0.15)
    assert trial.slope(by_map)[0] == pytest.approx(gain)


def test_errors_of_recorded_torque_are_told(done):
    said = {name: found.text for name, found in item_figures(done).items()}
    # 30 kg of standard deviation are 59 kg of 95 %: 5.4 % of 1092, 4.6 of 1292, 3.9 of 1492.
    assert said["torque errors"].startswith("errors +0.0 / -1.0 / +1.0 % ± 5.4 / 5.4 / 5.4 %; ")
    assert "200 and 400 kg loaded +0.0 / no mass % ± 4.6 / 3.9 %" in said["torque errors"]
    assert said["blind torque errors"].startswith("errors +0.0 / -10.0 / -10.0 %")
    # 109 kg off with ± 78 told, twice.
    assert said["blind torque errors"].endswith("3 of 5 within 95 %")
    assert said["torque errors"].endswith("4 of 4 within 95 %")
    # A drive without a mass agrees with nothing.
    assert not item_figures(done)["torque errors"].agrees
    *_, last, slopes = galvao.torque_table(done.torque).rows
    assert last[2] == "no mass"
    # 100 kg found for 200 loaded, and 200 for 400.
    assert slopes[-2] == "+0.50 ± 0.00"


def test_the_error_that_stays_is_that_of_the_run(done):
    said = item_figures(done)
    for t in done.tests:
        end = 100.0 * (t.printed.mass[t.printed.used][-1] / t.mass - 1.0)
        assert said[f"end {t.number}"].text == f"{end:+.1f} %"


def test_errors_have_their_sign(done):
    light = replace(done.tests[1], mass=1.01 * done.tests[1].ours.answer)
    signed = replace(done, tests=(done.tests[0], light, done.tests[2]))
    errors = item_figures(signed)["errors"].text.removeprefix("errors ").split(" / ")
    assert [e[0] for e in errors] == ["-" if t.error(t.ours) < 0.0 else "+" for t in signed.tests]
    assert float(errors[1]) == pytest.approx(100.0 / 1.01 - 100.0, abs=1e-3)
    assert galvao.tests_table(signed).rows[1][6] == errors[1]
    assert not item_figures(signed)["errors"].agrees


@pytest.mark.parametrize("head_wind", [-4.0, 0.0, 3.0])
def test_a_coast_down_is_that_of_the_longitudinal_law(head_wind):
    speed = coasting_speed(head_wind)
    assert speed[0] == pytest.approx(FAST)
    assert speed[-1] <= SLOW < speed[-2]
    # Stepped, with drag, rolling resistance, air and wheels of the paper's car by hand.
    turning = 1092.0 + COMPACT.wheel_inertia / 0.29**2
    drag = 0.5 * 101_325.0 / (287.05 * 288.15) * 0.35 * 2.15

    def slowed(_, v):
        force = drag * (v + head_wind) ** 2 + 1092.0 * GRAVITY * COMPACT.rolling_coefficient
        return -force / turning

    time = STEP * np.arange(speed.size)
    stepped = solve_ivp(slowed, (0.0, time[-1]), [FAST], t_eval=time, rtol=1e-9, atol=1e-9).y[0]
    np.testing.assert_allclose(speed, stepped, atol=1e-4)


def test_speed_alone_bounds_the_mass_and_tells_the_drag_over_it(done):
    assert np.all(done.says.bounds > 1092.0)
    assert np.all(done.says.bounds < 10_000.0)
    low, high = done.says.coast.interval()
    # Drag area and mass of sec. 2.1.
    assert low < 0.35 * 2.15 / 1092.0 < high
    assert done.says.coast.drag_over_mass == pytest.approx(0.35 * 2.15 / 1092.0, rel=0.05)
    assert speed_table(done.says).rows[0][-1] == "1092"
