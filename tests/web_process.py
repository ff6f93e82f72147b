"""The page's real process, plain or with TLS, and a certificate made for it."""

import contextlib
import http.client
import os
import socket
import ssl
import subprocess
import sys
import threading
import time
from pathlib import Path

import trustme
from browser.scene import Peers, Scene, t2_compact, write_configuration

ROOT = Path(__file__).parent.parent


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def make_certificate(folder, *names):
    """Files of a certificate for ``names`` and its key, and a context that believes it alone."""
    authority = trustme.CA()
    made = authority.issue_cert(*names)
    cert, key = folder / "cert.pem", folder / "key.pem"
    for part in made.cert_chain_pems:
        part.write_to_path(cert, append=True)
    key.touch(mode=0o600)
    made.private_key_pem.write_to_path(key)
    context = ssl.create_default_context()
    authority.configure_trust(context)
    return cert, key, context


class Process:
    """The process, a scene behind it, and everything it wrote."""

    def __init__(self, folder, context=None, **config):
        self.port, self.context, self.folder = free_port(), context, folder
        self.scene = Scene(t2_compact())
        self.path = write_configuration(folder, self.port, self.scene.machine, **config)
        self.log = folder / "log"

    def __enter__(self):
        self._peers = Peers(self.folder, self.scene).__enter__()
        path = os.pathsep.join(str(ROOT / part) for part in ("", "protocol", "clients"))
        command = [sys.executable, "-m", "motionserver.web", str(self.path)]
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                command, env=os.environ | {"PYTHONPATH": path}, stdout=log, stderr=log
            )
        pause, until = threading.Event(), time.monotonic() + 60.0
        while time.monotonic() < until and self.process.poll() is None:
            with contextlib.suppress(OSError):
                socket.create_connection(("127.0.0.1", self.port), 1.0).close()
                return self
            pause.wait(0.05)
        self.__exit__()
        raise AssertionError(self.written())

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(30)
        self._peers.__exit__()

    def written(self):
        return self.log.read_text("utf-8", "replace")

    def connect(self):
        """A bare connection, TLS if there is a context."""
        link = socket.create_connection(("127.0.0.1", self.port), 30.0)
        return self.context.wrap_socket(link, server_hostname="127.0.0.1") if self.context else link

    @contextlib.contextmanager
    def ask(self, method, path, body=None, **headers):
        """One request; the answer, still open."""
        if self.context is None:
            line = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        else:
            line = http.client.HTTPSConnection(
                "127.0.0.1", self.port, timeout=30, context=self.context
            )
        try:
            named = {name.replace("_", "-"): value for name, value in headers.items()}
            line.request(method, path, body, named)
            yield line.getresponse()
        finally:
            line.close()

    def status(self, method, path, body=None, **headers):
        with self.ask(method, path, body, **headers) as answer:
            answer.read()
            return answer.status
