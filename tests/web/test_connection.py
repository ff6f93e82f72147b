import asyncio
import socket

import pytest
from starlette.responses import StreamingResponse
from uvicorn import Config
from uvicorn.server import ServerState

from motionserver.web.connection import PatientLoop, PatientProtocol

GET = b"GET / HTTP/1.1\r\nHost: a\r\n\r\n"


class Hasty(PatientProtocol):
    check_every = 0.02


class Patient(PatientProtocol):
    check_every = 0.5


class Narrow(PatientProtocol):
    most = 8


async def slow_app(scope, receive, send):
    await send({"type": "http.response.start", "status": 200, "headers": []})
    for part in range(8):
        await asyncio.sleep(0.02)
        more = part < 7
        await send({"type": "http.response.body", "body": b"part", "more_body": more})


async def endless_app(scope, receive, send):
    async def parts():
        while True:
            yield b"x" * 65536
            await asyncio.sleep(0)

    await StreamingResponse(parts())(scope, receive, send)


async def large_app(scope, receive, send):
    """An answer that is complete long before it is read."""
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"x" * 30_000_000})


class Server:
    def __init__(self, app, kind):
        self.app, self.kind = app, kind
        self.clients, self.made = [], 0

    async def __aenter__(self):
        config = Config(self.app, lifespan="off", log_config=None, timeout_keep_alive=60)
        config.load()
        self.state = ServerState()
        loop = asyncio.get_running_loop()
        self.server = await loop.create_server(lambda: self.connection(config), "127.0.0.1", 0)
        self.address = self.server.sockets[0].getsockname()
        return self

    def connection(self, config):
        self.made += 1
        return self.kind(config=config, server_state=self.state, app_state={})

    async def __aexit__(self, *_):
        self.server.close()
        for connection in list(self.state.connections):
            connection.transport.abort()
        for task in list(self.state.tasks):
            task.cancel()
        for writer in self.clients:
            writer.transport.abort()
        await self.server.wait_closed()
        await asyncio.gather(*self.state.tasks, return_exceptions=True)
        await asyncio.sleep(0.01)

    async def open(self, sent=b"", **named):
        reader, writer = await asyncio.open_connection(*self.address, **named)
        self.clients.append(writer)
        writer.write(sent)
        return reader, writer

    async def until(self, what):
        async with asyncio.timeout(20):
            while not what():  # noqa: ASYNC110  (the server does not tell)
                await asyncio.sleep(0.01)

    async def gone(self, left=0):
        """Wait until only ``left`` connections and requests are left."""
        await self.until(lambda: max(len(self.state.connections), len(self.state.tasks)) <= left)


def unread(address):
    """A connection with a small window that asks and never reads."""
    link = socket.socket()
    link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    link.connect(address)
    link.sendall(GET)
    return link


@pytest.mark.parametrize("sent", [b"", b"GET / HTTP/1.1\r\nHost: a\r\nX-Slow: "])
async def test_a_connection_that_never_asks_is_closed(sent):
    async with Server(slow_app, Hasty) as server:
        reader, _ = await server.open(sent)
        assert await asyncio.wait_for(reader.read(), 10) == b""


async def test_headers_that_trickle_do_not_keep_it_open():
    async with Server(slow_app, Hasty) as server:
        reader, writer = await server.open(GET[:-2])
        for _ in range(2000):
            if reader.at_eof() or reader.exception():
                break
            writer.write(b"X: y\r\n")
            await asyncio.sleep(0.005)
        else:
            raise AssertionError("still open after ten seconds of headers")


async def test_a_long_answer_is_not_cut_and_the_idle_connection_closed_after_it():
    async with Server(slow_app, Hasty) as server:
        reader, _ = await server.open(GET)
        answer = await asyncio.wait_for(reader.read(), 10)
        assert answer.count(b"part") == 8
        assert answer.endswith(b"0\r\n\r\n")


@pytest.mark.parametrize("app", [endless_app, large_app])
async def test_who_does_not_read_is_dropped_and_its_request_ends(app):
    async with Server(app, Hasty) as server:
        with unread(server.address):
            await server.until(lambda: server.made)
            await server.gone()


async def test_who_reads_slowly_but_reads_is_not_dropped():
    async with Server(endless_app, Patient) as server:
        reader, _ = await server.open(GET)
        for _ in range(40):
            assert len(await asyncio.wait_for(reader.readexactly(400_000), 10)) == 400_000
            await asyncio.sleep(0.01)


async def test_a_newcomer_is_served_however_many_idle_connections_there_are():
    async with Server(slow_app, Narrow) as server:
        crowd = [await server.open() for _ in range(40)]
        reader, _ = await server.open(GET)
        assert b"200 OK" in await asyncio.wait_for(reader.readline(), 10)
        await server.gone(Narrow.most)
        closed = sum(one.at_eof() or one.exception() is not None for one, _ in crowd)
        assert closed >= 40 - Narrow.most


async def test_a_flood_pushes_out_itself_and_not_a_neighbour():
    async with Server(slow_app, Narrow) as server:
        reader, writer = await server.open(local_addr=("127.0.0.2", 0))
        for _ in range(40):
            await server.open()
        await server.gone(Narrow.most)
        writer.write(GET)
        assert b"200 OK" in await asyncio.wait_for(reader.readline(), 10)


async def test_who_is_being_answered_is_not_pushed_out():
    async with Server(slow_app, Narrow) as server:
        asking = [(await server.open(GET))[0] for _ in range(Narrow.most)]
        for reader in asking:
            await reader.readline()
        late, _ = await server.open(GET)
        with pytest.raises((ConnectionResetError, asyncio.IncompleteReadError)):
            await asyncio.wait_for(late.readexactly(1), 10)
        for reader in asking:
            assert b"part" in await asyncio.wait_for(reader.readuntil(b"0\r\n\r\n"), 10)


async def test_a_tls_handshake_that_does_not_come_is_not_waited_for():
    seen = {}

    class Recording(asyncio.SelectorEventLoop):
        async def create_server(self, *args, **named):
            seen.update(named)

    class Both(PatientLoop, Recording):
        pass

    loop = Both()
    try:
        await Both.create_server(loop, None, ssl=object())
        assert seen["ssl_handshake_timeout"] == PatientLoop.handshake <= 10
        seen.clear()
        await Both.create_server(loop, None)
        assert seen == {}
    finally:
        loop.close()


def test_trouble_with_every_connection_is_told_once_a_second():
    told = []
    loop = PatientLoop()
    try:
        loop.set_exception_handler(lambda _, context: told.append(context["message"]))
        now = 100.0
        loop.time = lambda: now
        for k in range(2048):
            loop.call_exception_handler({"message": f"no descriptor {k}"})
        now += 1.0
        loop.call_exception_handler({"message": "still none"})
    finally:
        loop.close()
    assert told == ["no descriptor 0", "still none (2047 others untold)"]
