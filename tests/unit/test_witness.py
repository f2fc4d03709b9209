"""Torque readings held against other signals of the same engine, on made-up drives."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from tests.noted import error, refused

import weighbridge as wb
from weighbridge import Drive, DriveInfo, Signal, Vehicle
from weighbridge.balance import learn_second_signals
from weighbridge.checks import check_drive
from weighbridge.estimators import ESTIMATORS
from weighbridge.messages import phrase
from weighbridge.vehicle import Driveline, SecondSignalRelation, TorqueModel

END = 1500.0
MIDDLE = 0.5 * END
FULL_CHARGE = 1.9e-4  # kg per radian of a petrol engine of 2 l
CAR = Vehicle(
    name="car",
    driveline=Driveline(gearings=(20.0, 12.0, 8.0)),
    torque=TorqueModel(source="load", coefficients=(-20.0, 180.0)),
)
ELECTRIC = Vehicle(driveline=Driveline(gearings=(28.0,)), torque=TorqueModel(source="measured"))


def slow_noise(random, time, span):
    """Of unit size, changing within about ``span`` [s]."""
    knots = np.arange(0.0, time[-1] + 2.0 * span, span)
    return np.interp(time, knots, random.standard_normal(knots.size))


@cache
def drive(seed, *, warm=288.0, pressure=1.0e5, diesel=False, normalised=False):
    """Half an hour of town and country: load of a petrol engine with its air, pressure and fuel.

    Each signal is asked for in its turn, four times a second.
    """
    random = np.random.default_rng(seed)
    fine = np.arange(0.0, END, 0.05)
    turning = np.clip(210.0 + 55.0 * slow_noise(random, fine, 9.0), 90.0, 420.0)
    part = np.clip(0.45 + 0.22 * slow_noise(random, fine, 4.0), 0.12, 1.0)
    # Volumetric efficiency has its best in the middle, and charge the more air the colder it is.
    best = FULL_CHARGE * (1.0 - 3e-6 * (turning - 260.0) ** 2)
    air = (pressure / 1.0e5) * np.sqrt(288.0 / warm)
    charge = part * best * (air if normalised else 1.0)
    load = part if normalised else part * np.sqrt(1.0)
    if diesel:
        charge = best * (0.8 + 0.1 * slow_noise(random, fine, 6.0))
    values = {
        "vehicle_speed": turning / 12.0,
        "engine_speed": turning,
        "engine_load": load,
        "mass_air_flow": charge * turning,
        "intake_pressure": 1.0e5 * charge / best * np.sqrt(warm / 288.0),
        "fuel_rate": charge * turning / 14.7 / 745.0,
    }
    signals = {}
    for k, (name, row) in enumerate(values.items()):
        time = 0.3 + 0.04 * k + 0.25 * np.arange(int((END - 2.0) / 0.25))
        read = np.interp(time - 0.1, fine, row)
        signals[name] = Signal(name, time, read * (1.0 + 0.01 * random.standard_normal(time.size)))
    info = DriveInfo(ambient_temperature=warm, barometric_pressure=pressure)
    return Drive(f"drive {seed}", signals, info=info)


def changed(made, name, change):
    s = made.signals[name]
    return made.with_signals(replace(s, values=change(s.time, s.values)))


@cache
def known_drives():
    return [drive(seed) for seed in (1, 2, 3)]


@cache
def learnt(*signals):
    """The car with these witnesses, learnt from drives of known mass."""
    return with_witnesses(signals, known_drives(), CAR)


def doubts_of(made, vehicle):
    """Return what other signals and the steps of the reading say against it."""
    ids = ("torque.witness", "torque.steps", "witness.off")
    return tuple(p for p in check_drive(made, vehicle) if p.id in ids)


def with_witnesses(signals, known, vehicle):
    found, doubts = learn_second_signals(known, vehicle)
    assert not doubts
    return replace(vehicle, witnesses=tuple(w for w in found if w.signal in signals))


def test_the_relation_gives_the_reading_back():
    found, doubts = learn_second_signals(known_drives(), CAR)
    assert [w.signal for w in found] == ["mass_air_flow", "intake_pressure", "fuel_rate"]
    assert not doubts
    for relation in found:
        assert relation.scatter < 0.02 * relation.span
        assert (relation.pressure, relation.temperature) == (1.0e5, 288.0)
        assert abs(relation.lag) <= 0.25


def test_what_does_not_explain_the_reading_is_no_witness():
    diesels = [drive(seed, diesel=True) for seed in (1, 2, 3)]
    assert learn_second_signals(diesels, CAR) == ((), ())


def test_a_source_is_no_witness_of_itself():
    air = replace(CAR, torque=TorqueModel(source="air_flow"))
    found, _ = learn_second_signals(known_drives(), air)
    assert "mass_air_flow" not in [w.signal for w in found]
    assert "engine_load" in [w.signal for w in found]


def test_other_drives_agree():
    for seed in range(10, 14):
        made = drive(seed)
        assert doubts_of(made, learnt("mass_air_flow", "intake_pressure")) == ()


FAULTS = {
    "scale 0.8": (lambda t, x: 0.8 * x, {"scale": 0.8, "than": "as"}),
    "scale 1.15": (lambda t, x: 1.15 * x, {"scale": 1.15, "than": "as"}),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_reading_that_left_its_only_witness_gives_no_mass(fault):
    change, expected = FAULTS[fault]
    (problem,) = doubts_of(changed(drive(20), "engine_load", change), learnt("mass_air_flow"))
    assert problem.serious
    assert problem.signal == "engine_load"
    found = problem.values
    assert problem.id == "torque.witness"
    for name, value in expected.items():
        if isinstance(value, str):
            assert found[name] == value
        else:
            assert found[name] == pytest.approx(value, rel=0.02)


@pytest.mark.parametrize(
    "method", [m for m, e in ESTIMATORS.items() if e.compared and not e.speed_alone]
)
def test_every_method_refuses_it(method):
    made = changed(drive(20), "engine_load", lambda t, x: 0.8 * x)
    with refused("torque.witness") as found:
        wb.weigh(made, learnt("mass_air_flow"), method)
    assert found.value.problem.values["scale"] == pytest.approx(0.8, abs=0.005)


def test_a_moderate_disagreement_is_a_warning():
    made = changed(drive(20), "engine_load", lambda t, x: 0.93 * x)
    (problem,) = doubts_of(made, learnt("mass_air_flow"))
    assert not problem.serious
    assert problem.values["scale"] == pytest.approx(0.93, abs=0.005)
    assert problem.values["witnesses"] == "mass_air_flow"


def test_a_moderate_disagreement_with_a_reading_altered_on_the_way_gives_no_mass():
    step = 1.0 / 255.0
    sent = changed(drive(20), "engine_load", lambda t, x: step * np.round(x / step))
    made = changed(sent, "engine_load", lambda t, x: 0.93 * x)
    known = replace(
        learnt("mass_air_flow"), torque=replace(learnt("mass_air_flow").torque, reading_step=step)
    )
    steps, witness = doubts_of(made, known)
    assert steps.id == "torque.steps"
    assert f"{steps.values['ratio']:.3g}" == "0.93"
    assert steps.serious
    assert witness.serious
    assert not any(p.serious for p in doubts_of(sent, known))
    # A witness that goes with the altered reading clears it.
    cleared = doubts_of(changed(made, "mass_air_flow", lambda t, x: 0.93 * x), known)
    assert [(p.id, p.serious) for p in cleared] == [("torque.steps", False)]


def test_two_witnesses_say_that_the_reading_is_wrong():
    made = changed(drive(20), "engine_load", lambda t, x: 0.8 * x)
    (problem,) = doubts_of(made, learnt("mass_air_flow", "intake_pressure"))
    assert problem.serious
    assert problem.values["witnesses"] == "mass_air_flow and intake_pressure"
    assert problem.values["which"] == phrase("reading_wrong", reading="engine_load")


def test_a_witness_alone_against_another_is_off_itself():
    made = changed(drive(20), "mass_air_flow", lambda t, x: 0.7 * x)
    (problem,) = doubts_of(made, learnt("mass_air_flow", "intake_pressure"))
    assert not problem.serious
    assert problem.signal == "mass_air_flow"
    assert problem.id == "witness.off"
    assert problem.values["agree"] == "intake_pressure"
    assert problem.values["reading"] == "engine_load"


def test_more_fuel_than_torque_is_doubted_and_less_refused():
    fuel = learnt("fuel_rate")
    regenerating = changed(drive(20), "fuel_rate", lambda t, x: 1.25 * x)
    (problem,) = doubts_of(regenerating, fuel)
    assert not problem.serious
    (problem,) = doubts_of(changed(drive(20), "fuel_rate", lambda t, x: 0.8 * x), fuel)
    assert problem.serious


def test_what_a_person_vouches_for_gives_a_mass():
    made = changed(drive(20), "engine_load", lambda t, x: 0.8 * x)
    made = replace(made, info=replace(made.info, trusted=("engine_load",)))
    (problem,) = doubts_of(made, learnt("mass_air_flow"))
    assert not problem.serious


@pytest.mark.parametrize("normalised", [True, False])
def test_thin_air_is_no_fault(normalised):
    """Load is the share of what the air there lets the engine take, or it is not (SAE J1979)."""
    car = with_witnesses(
        ("mass_air_flow",), [drive(seed, normalised=normalised) for seed in (1, 2, 3)], CAR
    )
    high = drive(20, warm=303.0, pressure=0.82e5, normalised=normalised)
    assert doubts_of(high, car) == ()


@pytest.mark.parametrize(
    ("pressure", "known", "scale", "explained"),
    [
        # Air of 0.8 bar lets the engine take up to 1 / 0.8 of the load, and no less of it.
        (0.8e5, True, 0.9, False),
        (0.8e5, True, 1.2, True),
        (0.8e5, True, 1.3, False),
        (1.0e5, True, 0.93, False),
        (1.0e5, False, 0.93, True),
        (1.0e5, False, 1.07, True),
    ],
)
def test_air_accounts_for_no_more_than_it_can(pressure, known, scale, explained):
    made = changed(
        drive(20, pressure=pressure), "engine_load", lambda t, x: np.minimum(scale * x, 1.0)
    )
    made = made if known else replace(made, info=DriveInfo())
    assert (doubts_of(made, learnt("mass_air_flow")) == ()) == explained


def test_delays_gaps_jitter_and_dropouts_are_no_fault():
    random = np.random.default_rng(7)
    made = drive(20)

    def moved(name, shift):
        s = made.signals[name]
        return made.with_signals(replace(s, time=s.time + shift))

    def thinned(keep):
        return replace(
            made,
            signals={
                n: Signal(n, s.time[m := keep(s.time)], s.values[m])
                for n, s in made.signals.items()
            },
        )

    harmless = {
        "the reading late by 1 s": moved("engine_load", 1.0),
        "the witness late by 0.8 s": moved("mass_air_flow", 0.8),
        "half of all cells empty": thinned(lambda t: random.random(t.size) < 0.5),
        "gaps": thinned(lambda t: (t % 200.0) > 20.0),
        "dropouts of engine speed": changed(
            made, "engine_speed", lambda t, x: np.where(random.random(x.size) < 0.03, 0.0, x)
        ),
        "steps of load": changed(made, "engine_load", lambda t, x: np.round(x / 0.05) * 0.05),
        "a noisy witness": changed(
            made, "mass_air_flow", lambda t, x: x * (1.0 + 0.1 * random.standard_normal(x.size))
        ),
        "an hour's jump of all clocks": replace(
            made,
            signals={
                n: replace(s, time=s.time + 3600.0 * (s.time > MIDDLE))
                for n, s in made.signals.items()
            },
        ),
    }
    for what, spoilt in harmless.items():
        assert not any(p.serious for p in doubts_of(spoilt, learnt("mass_air_flow"))), what


def test_nothing_is_said_where_nothing_can_be():
    made = drive(20)
    assert doubts_of(made, None) == ()
    assert doubts_of(made, CAR) == ()
    assert doubts_of(made.without("mass_air_flow"), learnt("mass_air_flow")) == ()
    assert doubts_of(made.without("engine_load"), learnt("mass_air_flow")) == ()
    assert doubts_of(made.without("vehicle_speed"), learnt("mass_air_flow")) == ()
    assert doubts_of(made.between(0.0, 60.0), learnt("mass_air_flow")) == ()
    empty = Signal("mass_air_flow", np.zeros(0), np.zeros(0))
    assert doubts_of(made.with_signals(empty), learnt("mass_air_flow")) == ()
    load = made.signals["engine_load"]
    fraction = made.with_signals(replace(load, name="engine_torque_fraction"))
    percent = replace(learnt("mass_air_flow"), torque=TorqueModel(source="percent"))
    assert doubts_of(fraction, percent) == ()
    still = changed(made, "engine_speed", lambda t, x: 0.0 * x)
    assert doubts_of(still, learnt("mass_air_flow")) == ()


def test_calibration_drives_that_contradict_each_other_are_told():
    off = changed(drive(4), "engine_load", lambda t, x: 0.8 * x)
    found, doubts = learn_second_signals([*known_drives()[:2], off], CAR)
    assert found == ()
    assert len(doubts) == 3
    assert doubts[0].id == "calibration.drives_contradict"
    values = doubts[0].values
    assert (values["first"], values["second"]) == ("drive 1", "drive 4")
    assert (values["witness"], values["reading"]) == ("mass_air_flow", "engine_load")
    assert "0.80" in values["by"]


@cache
def electric_drive(seed, heating=0.0, read=1.0):
    """Motor torque of both signs with voltage and current, which is positive while charging."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, END, 0.2)
    turning = np.clip(400.0 + 150.0 * slow_noise(random, time, 20.0), 30.0, 1100.0)
    torque = 70.0 * slow_noise(random, time, 5.0)
    power = torque * turning * np.where(torque > 0.0, 1.0 / 0.9, 0.9) + 600.0 + heating
    volts = 360.0 - 2e-4 * power
    values = {
        "vehicle_speed": turning / 28.0,
        "engine_torque": read * torque,
        "battery_voltage": volts,
        "battery_current": -power / volts,
    }
    return Drive(f"trip {seed}", {n: Signal(n, time, x) for n, x in values.items()})


def test_a_battery_bears_witness_of_a_motor_whatever_is_heated():
    found, _ = learn_second_signals([electric_drive(seed) for seed in (1, 2)], ELECTRIC)
    assert [w.signal for w in found] == ["battery_current"]
    car = replace(ELECTRIC, witnesses=found)
    assert doubts_of(electric_drive(3, heating=4000.0), car) == ()
    # Heating that changes on the way looks alike: it is told, and weighed.
    (problem,) = doubts_of(electric_drive(3, read=0.8), car)
    assert not problem.serious
    assert (problem.id, problem.values["witnesses"]) == ("torque.witness", "battery_current")
    assert problem.values["scale"] == pytest.approx(0.8, abs=0.015)


def test_a_relation_is_one_of_a_known_signal():
    good = learnt("mass_air_flow").witnesses[0]
    for fields, words in (
        ({"signal": "throttle"}, "signal throttle"),
        ({"coefficients": (1.0, 2.0)}, "4 mass_air_flow 2"),
        ({"span": 0.0}, "span 0.0"),
    ):
        with error(wb.ConfigError, words):
            replace(good, **fields)
    with error(wb.ConfigError, "mass_air_flow"):
        replace(CAR, witnesses=(good, good))
    assert isinstance(good, SecondSignalRelation)


def test_a_witness_that_only_unknown_air_makes_agree_clears_nothing():
    def told(made):
        load = made.signals["engine_load"]
        return made.with_signals(Signal("engine_torque", load.time, 180.0 * load.values - 20.0))

    car = replace(CAR, torque=TorqueModel(source="measured"))
    known = with_witnesses(
        ("mass_air_flow", "intake_pressure"), [told(d) for d in known_drives()], car
    )
    assert len(known.witnesses) == 2
    for scale in (0.88, 1.12):
        made = told(replace(drive(20), info=DriveInfo()))
        found = doubts_of(changed(made, "engine_torque", lambda t, x, k=scale: k * x), known)
        assert [p.signal for p in found] == ["engine_torque"]


def test_a_witness_that_is_on_another_clock_accuses_nobody():
    late = drive(20)
    air = late.signals["mass_air_flow"]
    late = late.with_signals(Signal(air.name, air.time + 2.5, air.values))
    assert not any(p.serious for p in doubts_of(late, learnt("mass_air_flow")))
