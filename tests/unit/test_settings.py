"""Settings of estimators by name: in Python, as text, in a weighing."""

from dataclasses import replace

import pytest
from tests.noted import error, has

import weighbridge as wb
from weighbridge import ConfigError
from weighbridge.estimators import ESTIMATORS, differences, parsed


def test_settings_within_settings_are_reached_by_dots():
    hybrid = ESTIMATORS["hybrid"].settings_of(
        {"blend_speed": 8, "ekf.gate": 4.0, "ekf.start.count_grade_twice": True}
    )
    assert (hybrid.blend_speed, hybrid.ekf.gate) == (8.0, 4.0)
    assert isinstance(hybrid.blend_speed, float)
    assert hybrid.ekf.start.count_grade_twice is True
    assert hybrid.blend_width == 1.0
    assert differences(hybrid) == (
        "ekf.start.count_grade_twice = True, ekf.gate = 4.0, blend_speed = 8.0"
    )
    assert differences(ESTIMATORS["rls"].settings_of({})) == ""


@pytest.mark.parametrize(
    ("method", "given", "said"),
    [
        ("joint", {"gate": 0.0}, "0"),
        ("joint", {"change_std": 2.0}, "change_std 0 1 2"),
        ("joint", {"settle_windows": 0}, "settle_windows 1 0"),
        (
            "rls",
            {"lambda": 0.99},
            "lambda fewest_rows forgetting initial_mass",
        ),
        ("rls", {"forgetting": 0.5}, "0.9 1 0.5"),
        ("rls", {"forgetting": "fast"}, "forgetting fast"),
        ("rls", {"settle_rows": 1.5}, "settle_rows 1.5"),
        ("rls", {"gate.inner": 1.0}, "gate gate.inner"),
        ("hybrid", {"ekf": 3.0}, "ekf ekf.start.window 3.0"),
        ("hybrid", {"ekf.start.count_grade_twice": 1}, "ekf.start.count_grade_twice 1"),
        ("hybrid", {"blend": "wind"}, "blend speed wind"),
        ("hybrid", {"blend": 1.0}, "blend speed 1.0"),
        ("hybrid", {"ekf.start_mass": "speed"}, "ekf.start_mass speed"),
        ("speed-ekf", {"process_var": [1.0, 2.0]}, "process_var 3 list"),
    ],
)
def test_what_cannot_be_set_is_one_sentence(method, given, said):
    with error(ConfigError, said):
        ESTIMATORS[method].settings_of(given)


def test_a_method_without_settings_says_so():
    bare = replace(ESTIMATORS["rls"], settings=None)
    with error(ConfigError, "rls gate"):
        bare.settings_of({"gate": 5.0})


def test_texts_are_read_as_toml():
    texts = ["forgetting=0.999", "a.b = true", "process_var=[0.1, 1e-12, 5e-3]", "blend=speed"]
    assert parsed(texts) == {
        "forgetting": 0.999,
        "a.b": True,
        "blend": "speed",
        "process_var": [0.1, 1e-12, 5e-3],
    }
    assert parsed(["process_var=0.1, 1e-12,5e-3"]) == {"process_var": [0.1, 1e-12, 5e-3]}


def test_words_with_commas_are_a_list():
    given = parsed(["terms=mass, drag_area,disturbance"])
    assert given == {"terms": ["mass", "drag_area", "disturbance"]}
    assert ESTIMATORS["joint"].settings_of(given).terms == ("mass", "drag_area", "disturbance")
    few = ESTIMATORS["joint"].settings_of(parsed(["terms=mass"]))
    assert few.terms == ("mass",)
    given = ESTIMATORS["joint"].settings_of({"terms": ["mass", "disturbance"]})
    assert differences(given) == "terms = mass,disturbance"


@pytest.mark.parametrize("text", ["forgetting", "=1", "gate=", "gate=5;0", "gate=1\nmass=2"])
def test_a_text_of_another_form_is_one_sentence(text):
    with error(ConfigError, "=") as refused:
        parsed([text])
    assert "\n" not in str(refused.value)


def test_a_name_twice_is_refused():
    with error(ConfigError, "gate"):
        parsed(["gate=1", "gate=2"])


def test_a_weighing_uses_them_and_says_so(short_drive, short_car):
    usual = wb.weigh(short_drive.drive, short_car, "rls")
    quick = wb.weigh(short_drive.drive, short_car, "rls", settings={"forgetting": 0.99})
    assert usual.settings is None
    assert quick.settings.forgetting == 0.99
    assert has(quick.problems, "method.settings", method="rls", own="forgetting = 0.99")
    assert not has(usual.problems, "method.settings")
    # A shorter memory follows noise: the running mass moves more.
    moved = [w.track["mass_kg"].drop_nulls().diff().abs().mean() for w in (usual, quick)]
    assert moved[1] > 1.5 * moved[0]
