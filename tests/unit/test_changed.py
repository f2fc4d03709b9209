"""Which tests `.ci/quick` chooses."""

import math

from tests import changed, order

TESTS = {
    "tests/unit/test_gear.py": {"weighbridge.vehicle.gear"},
    "tests/unit/test_fuel.py": {"weighbridge.vehicle"},
    "tests/unit/test_road.py": {"weighbridge.simulation"},
}


def test_a_module_comes_before_its_room():
    found = changed.concerned(["src/weighbridge/vehicle/gear.py"], TESTS)
    assert found == ["tests/unit/test_gear.py", "tests/unit/test_fuel.py"]


def test_a_changed_test_is_run():
    assert changed.concerned(["tests/unit/test_road.py", "docs/start.md"], TESTS) == [
        "tests/unit/test_road.py"
    ]


def test_what_does_not_fit_is_named(monkeypatch):
    monkeypatch.setattr(changed, "seconds", lambda: {"long": 50.0, "short": 1.0})
    monkeypatch.setattr(changed, "SMOKE", ("short",))
    assert changed.fitting(["long", "short", "unknown"], 20.0) == (["short", "unknown"], ["long"])


def test_the_order_is_read_from_the_results(tmp_path, monkeypatch):
    results, written = tmp_path / "tests.xml", tmp_path / "order.csv"
    results.write_text(
        "<testsuites><testsuite>"
        '<testcase classname="tests.unit.test_changed" time="1.25"/>'
        '<testcase classname="tests.unit.test_changed.TestAll" time="2.0"/>'
        "</testsuite></testsuites>"
    )
    monkeypatch.setattr(order, "LIST", written)
    order.write(results)
    assert order.seconds() == {"tests/unit/test_changed.py": 3.2}


def test_files_that_need_the_browser_are_not_run_at_once():
    took = {"page": 20.0, "site": 10.0, "first": 15.0, "second": 5.0, "new": math.inf}
    ordered = order.one_at_a_time(list(took), {"page", "site"}, took)
    # The browser is free after 20 s, as is who ran "second".
    assert ordered == ["page", "first", "second", "site", "new"]
