# SPDX-License-Identifier: GPL-3.0-or-later
"""One GL context for all tests of passes; no test may leave an error, a message of the driver or an object behind."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from addon.gpu import context as context_module
from addon.gpu import loader
from addon.gpu.context import GpuContext, GpuUnavailable
from addon.gpu.program import Source

#: Every shader text that was handed to a compiler: stage ("comp", "vert", "frag") and text -> its file.
SHADER_VARIANTS: dict[tuple[str, str], str] = {}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests about all shaders that were compiled come after the tests that compile them."""
    items.sort(key=lambda item: item.get_closest_marker("last") is not None)


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "last: runs after all other tests of the session")


@pytest.fixture(scope="session")
def gpu_session() -> Iterator[GpuContext]:
    original = context_module.resolve

    def recorded(name: str, *arguments: Any, **named: Any) -> Source:
        source = original(name, *arguments, **named)
        SHADER_VARIANTS[name.split(".")[-2], source.text] = name
        return source

    context_module.resolve = recorded  # type: ignore[assignment]
    try:
        gpu = GpuContext.standalone()
    except GpuUnavailable as error:
        pytest.skip(str(error))
    loader.enable_debug_messages(loader.current_context_loader())
    yield gpu
    gpu.release()
    context_module.resolve = original


@pytest.fixture
def gpu(gpu_session: GpuContext) -> Iterator[GpuContext]:
    """The session's context, current on this thread, clean before the test and after it."""
    with gpu_session.mgl:
        gl = loader.current_context_loader()
        loader.debug_messages(gl)
        gpu_session.mgl.error  # noqa: B018  reading clears what an earlier test left
        gpu_session.times.clear()
        objects, memory = gpu_session.object_count, dict(gpu_session.memory)
        yield gpu_session
        assert (gpu_session.mgl.error, loader.debug_messages(gl)) == ("GL_NO_ERROR", [])
        assert gpu_session.object_count == objects, "the test left GL objects behind"
        assert gpu_session.memory == memory
