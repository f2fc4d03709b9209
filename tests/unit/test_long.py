"""Tests that run only when asked for have a quicker one beside them."""

from tests.order import ROOT, guards, is_long

LISTED = guards()


def test_every_name_on_the_list_is_a_test():
    for name in {*LISTED, *LISTED.values()}:
        file, _, function = name.partition("::")
        text = (ROOT / "tests" / file).read_text(encoding="utf-8")
        assert not function or f"def {function.partition('[')[0]}(" in text, name


def test_no_guard_is_long_itself():
    assert not [guard for guard in LISTED.values() if is_long(guard, LISTED)]
