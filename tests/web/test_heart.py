"""The page's sign of life."""

import asyncio

from motionserver.telemetry.mapped import MappedFile
from motionserver.web import heart
from motionserver.web.heart import Heart


def test_it_beats_as_long_as_the_loop_turns(tmp_path, monkeypatch):
    monkeypatch.setattr(heart, "PERIOD", 0.0)
    file = MappedFile(tmp_path / "page.map", 0)

    async def live():
        beating = asyncio.create_task(Heart(tmp_path / "page.map").beat())
        seen = []
        for _ in range(5):
            await asyncio.sleep(0)
            seen.append(file.newest_sequence())
        beating.cancel()
        return seen

    assert asyncio.run(live()) == [1, 2, 3, 4, 5]


def test_without_a_service_nobody_is_told(tmp_path):
    asyncio.run(asyncio.wait_for(Heart(tmp_path / "page.map").beat(), 5.0))
    assert not list(tmp_path.iterdir())
