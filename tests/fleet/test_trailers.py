"""Which legs had a trailer, by mass, drag area and wheel slip, against numbers worked out apart."""

import math

import pytest
from scipy.integrate import quad
from scipy.stats import expon, norm

from tests.fleet.made_rows import drive, reported

SHOWN = {"drag_area_std_m2": 0.5, "slip_std": 0.007, "late_s": 0.05, "late_std_s": 0.01,
         "slip_late": 0.0}  # fmt: skip


def said(*rows, tare=9000.0, gross=18000.0):
    """Drives of one truck, one on each day: (mass, drag area, slip)."""
    return [
        drive(str(k), start=f"2026-05-{k + 1:02d}T06:00:00+00:00", mass=mass, std=0.03 * mass,
              drag_area_m2=area, slip=slip, tare_kg=tare, gross_kg=gross,
              **SHOWN | (more[0] if more else {}))
        for k, (mass, area, slip, *more) in enumerate(rows)
    ]  # fmt: skip


def probability(drives, **how):
    """Probability of a trailer of each leg that a report has, in the order of time."""
    legs = reported(drives, **how).legs.sort("start")
    return legs["trailer_probability"].to_list()


def probabilities(*rows, **how):
    return probability(said(*rows, **how))


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
    told = [
        row | {"trailer_connected": bit, "maker_mass_kg": row["mass_kg"] + 100.0}
        for row, bit in zip(said(*shown), bits, strict=True)
    ]
    rows = reported(told).legs.sort("start")
    assert rows["trailer_probability"].to_list()[:2] == [0.0, 1.0]
    assert rows["coupled"].to_list() == [bit is True for bit in bits]
    assert rows["trailer"].to_list() == [bit is True for bit in bits]
    assert rows["maker_mass_kg"].to_list() == [m + 100.0 for m, _, _ in shown]
    # Nobody knows what the vehicle may have with its trailer.
    assert rows["level"].to_list()[:3] == ["alarm", None, "ok"]
    assert rows["permitted_kg"].to_list()[:3] == [18000.0, None, 18000.0]
    assert rows["reason_id"].to_list()[:3] == [None, "fleet.trailer_reported", None]
    assert probabilities(*shown)[0] > 0.9


def test_an_announced_trailer_is_sure_and_does_not_move_the_vehicle(tmp_path):
    towed = [(24000.0, 1.6, 0.060)] * 3
    couplings = tmp_path / "couplings.csv"
    first = f"2026-05-{len(OTHERS) + 1:02d}T00:00:00+00:00"
    couplings.write_text(
        f"vehicle,start,end,permitted_kg\ntruck1,{first},2026-05-31T00:00:00+00:00,36000\n"
    )
    found = probability(said(*OTHERS, *towed), couplings=couplings)
    assert found[-3:] == [1.0] * 3
    assert max(found[:-3]) < 0.05


def test_vehicles_and_files_are_compared_with_themselves_alone():
    *rest, last = said(*OTHERS, (17500.0, 1.8, 0.055))
    drives = [*(row | {"vehicle_digest": "x"} for row in rest), last | {"vehicle_digest": "y"}]
    assert probability(drives)[-1] < 0.5


def test_what_is_not_known_has_no_probability():
    lone, untold = said((12000.0, 0.1, 0.03), (12000.0, 0.1, 0.03))
    drives = [lone | {"mass_kg": None, "std_kg": None}, untold | {"gross_kg": None}]
    assert probability(drives) == [None, None]


def test_a_bus_draws_no_trailer_by_its_drag_area():
    drives = said(*OTHERS, (17500.0, 1.8, 0.055))
    assert probability([row | {"vehicle_class": "bus"} for row in drives])[-1] < 0.05


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
