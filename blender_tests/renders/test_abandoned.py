# SPDX-License-Identifier: GPL-3.0-or-later
"""What becomes of a session's pipeline when the session goes, with stand-ins for the context and the pipeline."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("bpy")


class StandInContext:
    """Writes down what is done in it: what, on which thread, and whether under its guard."""

    def __init__(self) -> None:
        self.is_current = True
        self.log: list[str] = []
        self.threads: set[threading.Thread] = set()
        self.released = threading.Event()
        self._is_guarded = False

    def note(self, what: str) -> None:
        assert self.is_current and self._is_guarded
        self.threads.add(threading.current_thread())
        self.log.append(what)

    @contextlib.contextmanager
    def guard(self) -> Iterator[None]:
        assert self.is_current
        before, self._is_guarded = self._is_guarded, True
        try:
            yield
        finally:
            self._is_guarded = before

    def release(self) -> None:
        self.note("context")
        self.released.set()


class StandInPipeline:
    def __init__(self, context: StandInContext, *, is_live: bool) -> None:
        self.context = context
        context.note("made")

    def release(self) -> None:
        self.context.note("pipeline")


@pytest.fixture
def context(monkeypatch: pytest.MonkeyPatch) -> StandInContext:
    from addon import pipeline
    from addon.gpu.context import GpuContext
    from addon.host import abandoned, session

    made = StandInContext()
    monkeypatch.setattr(GpuContext, "standalone", lambda: made)
    monkeypatch.setattr(GpuContext, "attach", lambda: made)
    monkeypatch.setattr(pipeline, "Pipeline", StandInPipeline)
    monkeypatch.setattr(session, "backend_in_use", lambda: ("OPENGL", None))
    monkeypatch.setattr(abandoned, "_waiting", [])
    return made


def session(*, own: bool) -> Any:
    """One whose pipeline has something half done."""
    from addon.host.session import Session

    made = Session(own_context=own)

    def begin() -> bool:
        with made.pipeline() as pipeline:
            made.before_release = lambda: pipeline.context.note("stopped")
        return True

    made.thread.run(begin)
    return made


IN_ORDER = ["made", "stopped", "pipeline", "context"]


def test_a_context_of_our_own_ends_on_its_thread(context: StandInContext) -> None:
    gone = session(own=True)
    del gone
    assert context.released.wait(10.0) and context.log == IN_ORDER
    assert len(context.threads) == 1 and threading.current_thread() not in context.threads


def test_what_lives_in_the_current_context_is_freed_at_once(context: StandInContext) -> None:
    from addon.host import abandoned

    gone = session(own=False)
    del gone
    assert context.log == IN_ORDER and not abandoned._waiting


def test_what_lives_in_another_context_waits_for_it(context: StandInContext) -> None:
    from addon.host.abandoned import free_abandoned

    gone = session(own=False)
    context.is_current = False
    del gone
    free_abandoned()
    assert context.log == ["made"]
    context.is_current = True
    free_abandoned()
    assert context.log == IN_ORDER
    free_abandoned()
    assert context.log == IN_ORDER, "once"


def test_a_session_is_released_in_order_as_well(context: StandInContext) -> None:
    released = session(own=False)
    released.release()
    assert context.log == IN_ORDER
    del released
    assert context.log == IN_ORDER
