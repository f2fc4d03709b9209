"""Alerts begin when their case is sure enough, and rest in between."""

from statistics import NormalDist

import numpy as np
import pytest

from weighbridge import ConfigError, LiveStatus, LiveWeighing
from weighbridge.live import Alert


def weighing(mass, std=50.0, status=LiveStatus.WEIGHED):
    return LiveWeighing(
        vehicle="van", time=1.0, age=0.0, status=status, refusal=None, mass=mass, std=std,
        tare=2000.0, gross=3500.0, tared=None, driven=600.0, progress=1.0, minutes_to_5=0.0,
        minutes_to_2=0.0, advice="",
    )  # fmt: skip


def test_an_alert_begins_once_and_ends_once():
    alert = Alert(3500.0)
    masses = [3400.0, 3560.0, 3600.0, 3570.0, 3520.0, 3590.0, 3480.0, 3400.0]
    events = [(m, e) for m in masses if (e := alert.look(weighing(m))) is not None]
    assert [(m, e.on) for m, e in events] == [(3600.0, True), (3480.0, False)]
    # Two standard deviations above.
    assert events[0][1].probability == pytest.approx(0.9772, abs=1e-4)
    assert "above 3500 kg" in events[0][1].text


def test_the_interval_is_that_of_the_normal_distribution():
    exact = NormalDist(3000.0, 50.0)
    low, high = weighing(3000.0).interval(0.9)
    assert low == pytest.approx(exact.inv_cdf(0.05))
    assert high == pytest.approx(exact.inv_cdf(0.95))


def test_below_is_the_other_side():
    alert = Alert(2500.0, above=False)
    assert alert.look(weighing(2450.0)) is None
    assert alert.look(weighing(2400.0)).on
    assert alert.text == "below 2500 kg"


def test_its_state_goes_on_between_events():
    alert = Alert(2500.0, above=False)
    for mass, active in ((2550.0, False), (2400.0, True), (2490.0, True), (2560.0, False)):
        alert.look(weighing(mass))
        state = alert.state(weighing(mass))
        assert (state.side, state.limit, state.active) == ("below", 2500.0, active)
        # By the normal distribution's own series, not by that of the code.
        assert state.probability == pytest.approx(NormalDist(mass, 50.0).cdf(2500.0))
    assert alert.state(weighing(np.nan, np.nan)).probability is None


@pytest.mark.parametrize("status", [LiveStatus.LEARNING, LiveStatus.INCONSISTENT])
def test_a_mass_that_is_not_weighed_alerts_nobody(status):
    alert = Alert(3500.0)
    assert alert.look(weighing(9000.0, status=status)) is None
    assert alert.look(weighing(np.nan, np.nan)) is None
    assert not alert.active


@pytest.mark.parametrize("wrong", [{"limit": 0.0}, {"limit": 1.0, "on": 0.4}, {"limit": np.nan}])
def test_what_cannot_be_is_refused(wrong):
    with pytest.raises(ConfigError):
        Alert(**wrong)
