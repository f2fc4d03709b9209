"""What a user reads has none of the words of `website/words.toml`, and messages are short."""

import tomllib

import pytest
from website.words import INSTEAD, SOURCE, found, private_words

from weighbridge.messages import catalogue

MOST, USUAL = 40, 25
"""Words of the longest message and of a message on average; a value in braces is one word."""


def lengths():
    return {id: sum(len(p.split()) for p in parts.values()) for id, parts in catalogue().items()}


def test_no_private_word_is_left_in_what_a_user_reads():
    assert [f"{place}:{line}: {word}" for place, line, word in found()] == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("it was told\nand doubted", [(1, "told"), (2, "doubted")]),
        ("`told` and [a word](told.md) of G.told", []),
        ("a value stands for another; told apart", [(1, "stands for"), (1, "told")]),
    ],
)
def test_private_words_are_seen_outside_code(text, words):
    assert private_words(text) == words


def test_each_word_says_what_to_write_in_its_place():
    assert all(instead.strip() for instead in INSTEAD.values())


def test_messages_are_short():
    words = lengths()
    assert {id: count for id, count in words.items() if count > MOST} == {}
    assert sum(words.values()) / len(words) <= USUAL


def test_phrases_of_messages_are_short():
    phrases = tomllib.loads((SOURCE / "messages.toml").read_text(encoding="utf-8"))["phrase"]
    assert {name for name, text in phrases.items() if len(text.split()) > USUAL} == set()
