"""The page of all messages by id, made from the catalogue of the program."""

from __future__ import annotations

import re
from itertools import groupby

from weighbridge.messages import catalogue

_VALUE = re.compile(r"\{[^}]*\}")

_HEAD = """# Messages by id

`weigh --json` lists what was found as `problems`. Each has an `id`, a `signal`, a time span from
`from_s` to `to_s` (null for the whole drive) and its `text`. Where there is no mass, `reason_id` is
the id of the reason. In Python these are `w.problems` and `w.reason_id`. Texts may change in later
versions; ids stay.

Here "…" replaces the values of a message. [Messages](../troubleshooting.md) has the causes.
"""


def messages_page() -> str:
    """Return the page: a table for each area of ids."""
    lines = [_HEAD]
    for area, messages in groupby(catalogue().items(), key=lambda item: item[0].partition(".")[0]):
        lines += [f"## {area}", "", "| id | found | effect | what to do |", "|---|---|---|---|"]
        for id, parts in messages:
            cells = [shown(parts.get(part, "")) for part in ("text", "effect", "remedy")]
            lines.append(f"| `{id}` | {' | '.join(cells)} |")
        lines.append("")
    return "\n".join(lines)


def shown(text: str) -> str:
    """Put an ellipsis in place of values; nothing of a sentence is a mark of Markdown."""
    text = _VALUE.sub("…", text.replace("{{", "(").replace("}}", ")"))
    return re.sub(r"([\\|*_<>`\[\]])", r"\\\1", text)
