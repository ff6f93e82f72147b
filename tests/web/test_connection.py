import asyncio

import pytest
from uvicorn import Config
from uvicorn.server import ServerState

from motionserver.web.connection import PatientProtocol


class Hasty(PatientProtocol):
    check_every = 0.02


async def slow_app(scope, receive, send):
    await send({"type": "http.response.start", "status": 200, "headers": []})
    for part in range(8):
        await asyncio.sleep(0.02)
        more = part < 7
        await send({"type": "http.response.body", "body": b"part", "more_body": more})


@pytest.fixture
async def address():
    config = Config(slow_app, lifespan="off", log_config=None, timeout_keep_alive=60)
    config.load()
    state = ServerState()
    loop = asyncio.get_running_loop()
    server = await loop.create_server(
        lambda: Hasty(config=config, server_state=state, app_state={}), "127.0.0.1", 0
    )
    yield server.sockets[0].getsockname()
    server.close()
    for connection in list(state.connections):
        connection.transport.close()
    await server.wait_closed()


@pytest.mark.parametrize("sent", [b"", b"GET / HTTP/1.1\r\nHost: a\r\nX-Slow: "])
async def test_a_connection_that_never_asks_is_closed(address, sent):
    reader, writer = await asyncio.open_connection(*address)
    writer.write(sent)
    assert await asyncio.wait_for(reader.read(), 10) == b""
    writer.close()
    await writer.wait_closed()


async def test_a_long_answer_is_not_cut_and_the_idle_connection_closed_after_it(address):
    reader, writer = await asyncio.open_connection(*address)
    writer.write(b"GET / HTTP/1.1\r\nHost: a\r\n\r\n")
    answer = await asyncio.wait_for(reader.read(), 10)
    assert answer.count(b"part") == 8
    assert answer.endswith(b"0\r\n\r\n")
    writer.close()
    await writer.wait_closed()
