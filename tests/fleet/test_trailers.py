"""Which legs had a trailer, by mass, drag area and wheel slip, against numbers worked out apart."""

import math

import polars as pl
import pytest
from scipy.integrate import quad
from scipy.stats import expon, norm

from tests.fleet.made_rows import drive, reported
from weighbridge.fleet.trailers import with_trailers

SHOWN = {"drag_area_std_m2": 0.5, "slip_std": 0.007, "late_s": 0.05, "late_std_s": 0.01,
         "slip_late": 0.0}  # fmt: skip


def legs(*rows, tare=9000.0, gross=18000.0):
    """Legs of one truck: (mass, drag area, slip)."""
    vehicle = {"vehicle_id": "t", "vehicle_digest": "x", "vehicle_class": "truck",
               "tare_kg": tare, "gross_kg": gross, "coupled": False}  # fmt: skip
    return pl.DataFrame(
        [
            vehicle | SHOWN | {"mass_kg": float(mass), "std_kg": 0.03 * mass}
            | {"drag_area_m2": area, "slip": slip} | (more[0] if more else {})
            for mass, area, slip, *more in rows
        ]
    ).with_columns(trailer_connected=pl.lit(None, pl.Boolean))  # fmt: skip


def probabilities(*rows, **how):
    return with_trailers(legs(*rows, **how))["trailer_probability"].to_list()


OTHERS = [(m, 0.1 * k - 0.3, 0.027 + 0.001 * k) for k, m in enumerate(range(9000, 17000, 1200))]


@pytest.mark.parametrize("mass", [12000.0, 17000.0, 20000.0, 22500.0, 25000.0])
def test_one_mass_alone_has_the_probability_of_its_law(mass):
    std = 0.03 * mass / 18000.0
    seen, tare = mass / 18000.0, 0.5

    def over(density, low, high):
        return quad(lambda x: density(x) * norm.pdf(seen, x, std), low, high, limit=400)[0]

    alone = 0.9 * over(lambda x: 1.0 / (1.0 - tare), tare, 1.0)
    alone += 0.1 * over(lambda x: expon.pdf(x - 1.0, scale=0.1), 1.0, 3.0)
    # Vehicle with load evenly in 0.5 to 1 and trailer in 0.25 to 1, without a convolution.
    both = quad(lambda own: over(lambda x: 1.0 / 0.75, own + 0.25, own + 1.0) / 0.5, 0.5, 1.0)[0]
    expected = 0.1 * both / (0.1 * both + 0.9 * alone)
    (found,) = probabilities((mass, None, None))
    assert found == pytest.approx(expected, rel=0.03, abs=1e-6)


def test_a_larger_drag_area_and_slip_show_it_and_the_same_mass_as_a_load_does_not():
    *_, loaded = probabilities(*OTHERS, (17500.0, 0.1, 0.030))
    *rest, towing = probabilities(*OTHERS, (17500.0, 1.8, 0.055))
    assert loaded < 0.01
    assert towing > 0.95
    assert max(rest) < 0.05


def test_each_of_both_counts():
    *_, by_area = probabilities(*OTHERS, (20000.0, 1.8, None))
    *_, by_slip = probabilities(*OTHERS, (20000.0, None, 0.055))
    *_, by_none = probabilities(*OTHERS, (20000.0, None, None))
    assert by_area > 3.0 * by_none
    assert by_slip > 3.0 * by_none


def test_a_vehicle_that_has_more_drag_than_its_file_in_all_legs_has_no_trailer():
    moved = [(m, area + 1.8, slip + 0.020) for m, area, slip in OTHERS]
    assert max(probabilities(*moved, (17000.0, 1.8, 0.052))) < 0.05


def test_slip_is_compared_at_the_lateness_that_all_legs_show():
    # What a leg takes for slip is the receiver's lateness, by the correlation of their errors.
    late = {"slip_late": -0.95, "slip_std": 0.02, "late_s": 0.05, "late_std_s": 0.01}
    rows = [(m, area, slip, late) for m, area, slip in OTHERS]
    moved = late | {"late_s": 0.05 - 0.012}
    *_, shifted = probabilities(*rows, (20000.0, 0.8, 0.030 + 0.95 * 2.0 * 0.012, moved))
    *_, slipped = probabilities(*rows, (20000.0, 0.8, 0.030 + 0.95 * 2.0 * 0.012, late))
    assert slipped > 3.0 * shifted


def test_the_bit_of_the_vehicle_decides():
    # By mass, drag area and slip the first had a trailer, and the others had none.
    shown = [(24000.0, 1.6, 0.060), *OTHERS]
    bits = [False, True, *[None] * (len(OTHERS) - 1)]
    said = [
        drive(str(k), start=f"2026-05-{k + 1:02d}T06:00:00+00:00", mass=float(m), std=0.03 * m,
              drag_area_m2=a, slip=s, tare_kg=9000.0, trailer_connected=bit,
              maker_mass_kg=m + 100.0, **SHOWN)
        for k, ((m, a, s), bit) in enumerate(zip(shown, bits, strict=True))
    ]  # fmt: skip
    rows = reported(said).legs.sort("start")
    assert rows["trailer_probability"].to_list()[:2] == [0.0, 1.0]
    assert rows["coupled"].to_list() == [bit is True for bit in bits]
    assert rows["trailer"].to_list() == [bit is True for bit in bits]
    assert rows["maker_mass_kg"].to_list() == [m + 100.0 for m, _, _ in shown]
    # Nobody knows what the vehicle may have with its trailer.
    assert rows["level"].to_list()[:3] == ["alarm", None, "ok"]
    assert rows["permitted_kg"].to_list()[:3] == [18000.0, None, 18000.0]
    assert rows["reason_id"].to_list()[:3] == [None, "fleet.trailer_reported", None]
    untold = [row | {"trailer_connected": None} for row in said]
    assert reported(untold).legs.sort("start")["trailer_probability"][0] > 0.9


def test_an_announced_trailer_is_sure_and_does_not_move_the_vehicle():
    rows = legs(*OTHERS, (24000.0, 1.6, 0.060), (24000.0, 1.6, 0.060), (24000.0, 1.6, 0.060))
    known = rows.with_columns(coupled=pl.col("mass_kg") > 20000.0)
    found = with_trailers(known)["trailer_probability"].to_list()
    assert found[-3:] == [1.0] * 3
    assert max(found[:-3]) < 0.05


def test_vehicles_and_files_are_compared_with_themselves_alone():
    other = legs((17500.0, 1.8, 0.055)).with_columns(vehicle_digest=pl.lit("y"))
    *_, found = with_trailers(pl.concat([legs(*OTHERS), other]))["trailer_probability"]
    assert found < 0.5


def test_what_is_not_known_has_no_probability():
    rows = legs((12000.0, 0.1, 0.03), (12000.0, 0.1, 0.03)).with_columns(
        mass_kg=pl.Series([None, 12000.0]), gross_kg=pl.Series([18000.0, None])
    )
    assert with_trailers(rows)["trailer_probability"].to_list() == [None, None]


def test_a_bus_draws_no_trailer_by_its_drag_area():
    rows = legs(*OTHERS, (17500.0, 1.8, 0.055)).with_columns(vehicle_class=pl.lit("bus"))
    assert with_trailers(rows)["trailer_probability"].to_list()[-1] < 0.05


def test_a_fleet_reports_it():
    def at(hour):
        return f"2026-05-04T{hour:02d}:00:00+00:00"

    rows = [
        drive(f"{k}", start=at(k), mass=float(m), std=0.03 * m, tare_kg=9000.0, drag_area_m2=area,
              slip=slip, **SHOWN)
        for k, (m, area, slip) in enumerate([*OTHERS, (17500.0, 2.1, 0.062), (17500.0, 0.1, 0.030)])
    ]  # fmt: skip
    found = reported(rows)
    assert found.legs.sort("start")["trailer"].to_list() == [False] * len(OTHERS) + [True, False]
    assert found.track.filter(state="trailer")["mass_kg"].to_list() == [17500.0]
    assert math.isclose(found.totals["trailer_legs"], 1)
