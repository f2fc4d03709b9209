"""Bars on a terminal that show how much of the work is done, and how long the rest takes."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from time import monotonic
from typing import TYPE_CHECKING, Any, TypeVar

from weighbridge.cli.terminal import console, shown
from weighbridge.cli.verbosity import watched

if TYPE_CHECKING:
    from rich.progress import Progress, Task

Item = TypeVar("Item")


class Bar:
    """Steps of a work; without a terminal it shows nothing.

    Parameters
    ----------
    total : of all steps, each counted by its share of the work
    clock : shows the time [s]
    """

    def __init__(self, total: float, clock: Callable[[], float] = monotonic) -> None:
        self.total = total
        self.done = 0.0
        self._before = self._share = 0.0
        self._clock = clock
        self._begun = self._reported = clock()
        self._what = ""
        self._progress: Progress | None = None

    def begin(self, what: str, share: float = 1.0) -> None:
        """Begin a step; the one before is over."""
        self._before += self._share
        self._share = share
        self._advance(self._before)
        self._what = what
        self.say()

    def say(self, more: str = "") -> None:
        """Show what is done, and more about it."""
        if self._progress is not None:
            text = shown(f"{self._what}{more}")
            self._progress.update(self._progress.task_ids[0], description=text)

    def within(self, done: float, total: float) -> None:
        """Say how much of the step under way is done."""
        self._advance(self._before + self._share * done / total)

    def tell(self, done: float, total: float) -> None:
        """Say how much of the whole is done; for work that counts by itself."""
        self.total = total
        self._advance(done)

    @property
    def left(self) -> float | None:
        """Time that the rest takes at the mean speed so far [s]; None before the first step."""
        if not self.done or not self.total:
            return None
        rest = (self.total - self.done) * (self._reported - self._begun) / self.done
        return max(rest - (self._clock() - self._reported), 0.0)

    def _advance(self, done: float) -> None:
        if done > self.done:
            self.done, self._reported = done, self._clock()
        if self._progress is not None:
            self._progress.update(
                self._progress.task_ids[0], completed=self.done, total=self.total or None
            )

    def _show(self, progress: Progress, what: str) -> None:
        progress.add_task(shown(what), total=self.total or None)
        self._progress, self._what = progress, what


@contextlib.contextmanager
def progress(what: str, total: float = 0.0) -> Iterator[Bar]:
    """Show a bar while something is done: on a terminal, on standard error, then gone.

    Parameters
    ----------
    what : is done
    total : of the steps; 0 where it is not known yet
    """
    bar = Bar(total)
    if not watched():
        yield bar
        return
    from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn
    from rich.table import Column
    from rich.text import Text

    class Left(ProgressColumn):
        # Not at each of the ten drawings per second.
        max_refresh = 0.5

        def render(self, task: Task) -> Text:
            left = bar.left
            share = f"{100.0 * bar.done / bar.total:3.0f} %" if bar.total else ""
            rest = f", {time_text(left)} left" if left is not None else ""
            return Text(f"{share}{rest}")

    columns = (
        TextColumn("{task.description}", table_column=Column(ratio=1, no_wrap=True)),
        BarColumn(bar_width=None, table_column=Column(ratio=1)),
        Left(table_column=Column(min_width=22, no_wrap=True)),
    )
    with Progress(
        *columns, console=console(stderr=True), transient=True, redirect_stdout=False, expand=True
    ) as drawn:
        bar._show(drawn, what)
        with compiling(bar):
            yield bar


@contextlib.contextmanager
def in_place() -> Iterator[Callable[[Callable[[], Any]], None]]:
    """Hand over what draws in place what a function makes: on a terminal, on standard error."""
    if not watched():
        yield lambda make: None
        return
    from rich.live import Live

    with Live(console=console(stderr=True), auto_refresh=False, redirect_stdout=False) as live:
        yield lambda make: live.update(make(), refresh=True)


@contextlib.contextmanager
def compiling(bar: Bar) -> Iterator[None]:
    """Let a bar say so while kernels are compiled, which only the first run does."""
    from numba.core import event

    class Compiling(event.Listener):
        # A kernel that calls another waits for it.
        waiting = begun = 0

        def on_start(self, event: object) -> None:
            self.waiting, self.begun = self.waiting + 1, self.begun + 1
            bar.say(f": compiling, in the first run only ({self.begun})")

        def on_end(self, event: object) -> None:
            self.waiting -= 1
            if not self.waiting:
                bar.say()

    with event.install_listener("numba:compile", Compiling()):
        yield


def each(items: Sequence[Item], what: str, name: Callable[[Item], Any] = str) -> Iterator[Item]:
    """Yield items, with a bar where there are several.

    Parameters
    ----------
    items : worked on one after the other
    what : is done with them
    name : of an item, as the bar shows it
    """
    if len(items) < 2:
        yield from items
        return
    with progress(what, len(items)) as bar:
        for item in items:
            bar.begin(f"{what} {name(item)}")
            yield item


def time_text(seconds: float) -> str:
    """Write a time for people."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"
